"""Observability of a Block's states from its measured outputs, at an operating point.

For the exact linearisation ``dx' = A dx, dy = C dx`` the unobservable subspace is the largest A-invariant
subspace of the null space of C. It is computed with orthonormal bases, so no power of A is formed. The
observability Gramian over a window T measures how well the other directions are observable,

    W(T) = integral from 0 to T of exp(A' t) C' C exp(A t) dt,

with states and outputs scaled by their nominal sizes. The pair is detectable if all eigenvalues of A on the
unobservable subspace have negative real parts. Of a sampled Block, ``dx+ = A dx``, the Gramian is the sum
over N steps of A'^k C' C A^k, and these eigenvalues lie inside the unit circle.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.linear_systems import growth
from hovercontrol.blocks.singular import finite_jacobian
from hovercontrol.control.observers.observable_subspace import (
    gramian_over,
    gramian_over_steps,
    readable,
    unobservable,
)
from hovercontrol.control.observers.observed import measured_expressions, measured_signals, plant_of
from hovercontrol.craft.models.interface import AnyModel

#: Components below this share of a direction's largest component are omitted from its text.
MINOR = 2e-2


@checked
@dataclass(frozen=True, eq=False)
class Observability:
    """Observability of the states at an operating point; made by :func:`observability`.

    Attributes
    ----------
    block : str
        Name of the Block.
    states, measured : tuple of str
        Names.
    units : dict of str to str
        Units of the states.
    rank : int
        Dimension of the observable subspace; if it equals the number of states, all are observable.
    gramian : ndarray, shape (n, n)
        W over the window, with states and outputs scaled by their nominal sizes [s; sampled 1].
    singular_values : ndarray, shape (n,)
        Singular values of the Gramian, in descending order [s; sampled 1].
    weakest : dict of str to float
        The least observable (or an unobservable) direction in state space, in the units of the states, with
        its largest component scaled to 1.
    window : float
        T [s].
    hidden : tuple of dict of str to float
        A basis of the unobservable subspace, in the units of the states, each direction with its largest
        component scaled to 1.
    hidden_modes : tuple of complex
        Eigenvalues of A in that subspace [1/s; sampled 1].
    period : float
        Of a sampled Block [s]; 0 of a continuous one.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> seen = observability(craft, {"u": 1.0}, ["u", "v", "r"])
    >>> seen.rank, seen.detectable
    (3, False)
    """

    block: str
    states: tuple[str, ...]
    measured: tuple[str, ...]
    units: dict[str, str]
    rank: int
    gramian: Array
    singular_values: Array
    weakest: dict[str, float]
    window: float
    hidden: tuple[dict[str, float], ...]
    hidden_modes: tuple[complex, ...]
    period: float = 0.0

    def __repr__(self) -> str:
        return self.sentence()

    @property
    def observable(self) -> bool:
        """Whether all states are observable from the outputs."""
        return self.rank == len(self.states)

    @property
    def detectable(self) -> bool:
        """Whether all unobservable modes decay."""
        return bool((growth(self.hidden_modes, self.period > 0.0) < 0).all())

    def sentence(self) -> str:
        """Return the result as one sentence."""
        where = f"block {self.block!r} with {', '.join(self.measured)} measured"
        if self.observable:
            unit = "" if self.period else " s"
            size = (
                f"singular value {self.singular_values[-1]:.2g}{unit} of the Gramian over {self.window:g} s"
            )
            weakest = f"weakest: {self._text(self.weakest)} ({size})"
            return f"{where}: all {self.rank} states are observable; {weakest}"
        changes = "; ".join(self._text(change) for change in self.hidden)
        end = ", decaying by itself" if self.detectable else ""
        found = f"{self.rank} of {len(self.states)} states are observable"
        return f"{where}: {found}; unobservable: {changes}{end}"

    def __str__(self) -> str:
        return self.sentence()

    def _text(self, change: Mapping[str, float]) -> str:
        main = {name: v for name, v in change.items() if abs(v) >= MINOR}
        if len(main) == 1:
            return next(iter(main))
        return " with ".join(f"{v:+.3g} {self.units[name]} {name}" for name, v in main.items())


@checked
def observability(
    block: AnyModel,
    at: Any = None,
    measured: Sequence[str] = ("x", "y", "psi"),
    *,
    window: float | None = None,
    params: Mapping[str, float] | None = None,
) -> Observability:
    """Return which states are observable from the measured outputs at an operating point.

    Parameters
    ----------
    block : Model, BlockModel or Block
        Continuous or sampled.
    at : Trim, control.OperatingPoint, array_like of shape (n_states,), or mapping by name, optional
        The operating point: states, or states and inputs by name; the others keep their start values. A Trim
        also supplies its parameters and its time.
    measured : sequence of str, optional
        Outputs, or states, of the Block.
    window : float, optional
        Window T of the Gramian [s] (default: 1 s; of a sampled Block as many periods as it has states).
    params : mapping, optional
        Parameter values by key, in place of the defaults.

    Returns
    -------
    Observability

    Raises
    ------
    InputError
        If the Block has parts that tick or late inputs, a name is unknown, or the operating point does not
        fit the Block.

    Examples
    --------
    From the position alone the heading is not observable at rest; under way it is.

    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> print(observability(craft, {"u": 0.0}, ["x", "y"]).sentence())
    block 'plant' with x, y measured: 4 of 6 states are observable; unobservable: psi; r
    >>> observability(craft, {"u": 1.0}, ["x", "y"]).observable
    True
    """
    plant = plant_of(block, "observability", "observability at an operating point")
    channels = measured_signals(plant, measured, "observability")
    seen = measured_expressions(plant, channels)
    x, u = operating_point(plant, at)
    own = getattr(at, "params", None) or {}
    values, t = plant.default_parameters | dict(own) | dict(params or {}), float(getattr(at, "time", 0.0))
    plant.parameter_values(values)
    try:
        A = finite_jacobian(seen, t, x, u, values)
        C = finite_jacobian(seen, t, x, u, values, "outputs")
    except InputError as error:
        raise InputError(f"observability: {error}") from None
    # Scaled by the nominal sizes S_x, S_y:  A <- S_x^-1 A S_x,  C <- S_y^-1 C S_x.
    size, wide = (np.array([s.nominal for s in group]) for group in (plant.states, channels))
    A, C = A * size / size[:, None], C * size / wide[:, None]
    basis = unobservable(A, C)
    if window is not None:
        positive("observability: window", window)
    if plant.period:
        steps = max(1, round(window / plant.period)) if window else len(A)
        window, gramian = steps * plant.period, gramian_over_steps(A, C, steps)
    else:
        window = window or 1.0
        gramian = gramian_over(A, C, window)
    names = tuple(s.name for s in plant.states)
    _, singular_values, directions = np.linalg.svd(gramian)
    return Observability(
        plant.name,
        names,
        tuple(measured),
        {s.name: s.unit for s in plant.states},
        len(A) - basis.shape[1],
        gramian,
        np.asarray(singular_values, dtype=float),
        _change(names, directions[-1] * size),
        float(window),
        tuple(_change(names, row * size) for row in readable(basis.T)),
        tuple(map(complex, np.linalg.eigvals(basis.T @ A @ basis))),
        plant.period,
    )


def _change(names: Sequence[str], values: Array) -> dict[str, float]:
    largest = values[int(np.abs(values).argmax())]
    return {name: float(v / largest) for name, v in zip(names, values, strict=True)}


def operating_point(block: Block, at: Any) -> tuple[Array, Array]:
    """Return states and inputs of an operating point, arguments as for :func:`observability`.

    Raises
    ------
    InputError
        If a name is unknown, the number of values is wrong, or a value is not finite.
    """
    start = {s.name: s.start for s in (*block.states, *block.inputs)}
    n = len(block.states)
    if isinstance(at, Mapping):
        for key in at:
            check_known(
                key, start, f"observability: at: block {block.name!r} has no state or input {shown(key)}"
            )
        start |= dict(at)
        at = None
    values = list(start.values())
    x, u = values[:n], values[n:]
    if hasattr(at, "x") and hasattr(at, "u"):  # a Trim
        x, u = at.x, at.u
    elif hasattr(at, "states") and hasattr(at, "inputs"):  # a control.OperatingPoint
        x, u = at.states, at.inputs
    elif at is not None:
        x = at
    return _finite("states", x, n), _finite("inputs", u, len(block.inputs))


def _finite(kind: str, values: ArrayLike, size: int) -> Array:
    try:
        found = np.ravel(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        found = np.full(0, math.nan)
    if found.size != size or not np.isfinite(found).all():
        raise InputError(f"observability: at: expected {size} finite {kind}, found {shown(values)}")
    return found


def warn_if_undetectable(plant: Block, measured: Sequence[str], name: str) -> None:
    """Warn if the pair of plant and measured outputs is not detectable at the plant's start values.

    Unobservable modes that decay need no measurement and cause no warning.
    """
    try:
        found = observability(plant, None, measured)
    except InputError as error:
        raise InputError(f"{name}: {error}; set other start values of the plant") from None
    if not found.detectable:
        warnings.warn(f"{name}: at the start values of {found.sentence()}", stacklevel=caller_level())
