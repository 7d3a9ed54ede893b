"""The linear model of a controller design: chosen states and inputs of a plant about an operating point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from hovercontrol.controllers import operating_point
from hovercontrol.controllers.friction_feedforward import Friction, frictions_at_rest
from hovercontrol.core.block import Block
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.targets.friction_slopes import Point, Slope

if TYPE_CHECKING:
    import control

    from hovercontrol.targets.trim import Trim

Array = NDArray[np.float64]

#: Largest rate of a state that counts as zero [its unit/s], and smallest entry of A, relative to the largest,
#: that counts as a dependence: trims are solved to about 1e-9.
STEADY, DEPENDS = 1e-5, 1e-12


@dataclass(frozen=True)
class Measured:
    """One quantity that a controller reads.

    Parameters
    ----------
    signal : Signal
        Under the name by which wiring knows it; its start is the value at the operating point.
    angle : bool
        Whether 2 pi more is the same.
    """

    signal: Signal
    angle: bool


@dataclass(frozen=True)
class Design:
    """What a controller is designed for.

    Parameters
    ----------
    states : tuple of Measured
        Those that are fed back.
    inputs : tuple of Signal
        Those that are commanded; their start is the value at the operating point.
    A, B : ndarray, shapes (n_states, n_states) and (n_states, n_inputs)
        ``(x - x0)' = A (x - x0) + B (u - u0)``
    integrals : tuple of Measured
        Quantities whose error is integrated.
    C : ndarray, shape (n_integrals, n_states)
        Each as a combination of the states.
    frictions : tuple of Friction
        Dry friction of states at rest, by index among `states`.
    """

    states: tuple[Measured, ...]
    inputs: tuple[Signal, ...]
    A: Array
    B: Array
    integrals: tuple[Measured, ...]
    C: Array
    frictions: tuple[Friction, ...] = ()

    @property
    def names(self) -> list[str]:
        """The names of the states."""
        return [m.signal.name for m in self.states]

    @property
    def integral_names(self) -> list[str]:
        """The names of the integrals: ``integral_y``."""
        return [f"integral_{m.signal.name}" for m in self.integrals]

    @property
    def input_names(self) -> list[str]:
        """The names of the inputs."""
        return [s.name for s in self.inputs]

    def with_integrals(self, period: float | None = None) -> tuple[Array, Array]:
        """Return A and B of the states followed by the integrals, ``z' = C (x - x0)``.

        With a period h [s] the states' are those of the exact discretisation with held inputs, and
        ``z+ = z + h C (x - x0)``.
        """
        n, p, m = len(self.states), len(self.integrals), len(self.inputs)
        A, B, C, own = self.A, self.B, self.C, np.zeros((p, p))
        if period is not None:
            A, B, *_ = cont2discrete((A, B, np.eye(n), np.zeros((n, m))), period)
            C, own = period * C, np.eye(p)
        return np.block([[A, np.zeros((n, p))], [C, own]]), np.vstack([B, np.zeros((p, m))])

    def disturbances(self, period: float | None = None) -> Array:
        """Return how each friction at rest acts on the states and integrals, shape (n, n_frictions)."""
        E = np.zeros((len(self.states), len(self.frictions)))
        for column, friction in enumerate(self.frictions):
            E[friction.state, column] = friction.level
        if period is not None and self.frictions:
            n = len(E)
            _, E, *_ = cont2discrete((self.A, E, np.eye(n), np.zeros_like(E)), period)
        return np.vstack([E, np.zeros((len(self.integrals), E.shape[1]))])


def design_of(
    where: str,
    plant: Block,
    trim: Trim | control.OperatingPoint | Mapping[str, float],
    *,
    friction: Slope,
    amplitude: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    inputs: Iterable[str] | None = None,
    weighted: Iterable[str] | None = None,
    integrate: Sequence[str] = (),
    compensate: bool = False,
) -> Design:
    """Return the linear model of chosen states and inputs.

    Parameters
    ----------
    where : str
        Of errors: the function that designs.
    plant : Block
        Continuous.
    trim : Trim, control.OperatingPoint or mapping
    friction, amplitude
        As for :meth:`hovercontrol.Block.linearize`.
    states : sequence of str, optional
        Which states are fed back. Default: those of `weighted` and all on which these depend; without
        `weighted` all that do not move at the operating point.
    inputs : iterable of str, optional
        Which inputs are commanded (default: all).
    weighted : iterable of str, optional
        States with a weight.
    integrate : sequence of str, optional
        States or outputs whose error is integrated.
    compensate : bool, optional
        Whether dry friction of states at rest is part of the design.

    Raises
    ------
    InputError
        If a name is unknown, or a state that is fed back moves at the operating point.
    """
    point = operating_point.point_of(plant, trim)
    A, B, C, D = operating_point.linear_model(plant, point, friction, amplitude)
    names = _Names(where, plant)
    rates = operating_point.rates(plant, point)
    columns = _columns(where, plant, inputs)
    rows, integrals = _integrals(where, plant, names, point, integrate, C, D[:, columns])
    if states is not None:
        kept = [names.index(s) for s in states]
    elif weighted is None:
        kept = [k for k in range(len(A)) if abs(rates[k]) <= STEADY]
    else:
        needed = {k for row in rows for k in np.flatnonzero(row).tolist()}
        kept = _closure(A, {names.index(s) for s in weighted} | needed)
    if not kept:
        raise InputError(f"{where}: expected one or more states to feed back, found none")
    chosen = tuple(
        Measured(names.signal(k).replace(start=point.x[k]), is_angle(plant, plant.states[k])) for k in kept
    )
    commanded = tuple(
        plant.inputs[j].replace(start=_inside(where, plant.inputs[j], point.u[j])) for j in columns
    )
    for k in kept:
        if abs(rates[k]) > STEADY:
            s = plant.states[k]
            raise InputError(
                f"{where}: {s.name} moves by {rates[k]:.3g} {s.unit} per second at the operating"
                " point and has no constant setpoint; leave it out of the states and weights"
            )
    part = np.ix_(kept, kept)
    C_kept = np.array([row[kept] for row in rows]).reshape(len(rows), len(kept))
    frictions = tuple(
        replace(f, state=kept.index(f.state)) for f in frictions_at_rest(plant, point, kept) if compensate
    )
    return Design(chosen, commanded, A[part], B[np.ix_(kept, columns)], integrals, C_kept, frictions)


class _Names:
    """Which state a name means: a state's own name, or that of an output that is the state."""

    def __init__(self, where: str, plant: Block) -> None:
        self._where, self._plant = where, plant
        self._states = [s.name for s in plant.states]
        symbols = {s.symbol: k for k, s in enumerate(plant.states)}
        self._aliases = {
            o.name: symbols[e] for o in plant.outputs if (e := plant.output_expressions[o.name]) in symbols
        }

    def index(self, name: str) -> int:
        if name in self._states:
            return self._states.index(name)
        if name in self._aliases:
            return self._aliases[name]
        hint = did_you_mean(name, [*self._aliases, *self._states])
        raise InputError(f"{self._where}: block {self._plant.name!r} has no state {name!r}{hint}")

    def find(self, name: str) -> int | None:
        return self.index(name) if name in self._states or name in self._aliases else None

    def signal(self, k: int) -> Signal:
        """Return the k-th state under the name by which an output shows it."""
        state = self._plant.states[k]
        shown = [name for name, index in self._aliases.items() if index == k]
        if state.name in shown or not shown:
            return state
        return state.replace(name=shown[0])


def _closure(A: Array, kept: set[int]) -> list[int]:
    """Return the states of a set and all on which their derivatives depend, in order."""
    depends = np.abs(A) > DEPENDS * max(np.abs(A).max(), 1.0)
    while True:
        more = kept | {int(j) for k in kept for j in np.flatnonzero(depends[k])}
        if more == kept:
            return sorted(kept)
        kept = more


def _columns(where: str, plant: Block, inputs: Iterable[str] | None) -> list[int]:
    names = [s.name for s in plant.inputs]
    wanted = names if inputs is None else list(inputs)
    for name in wanted:
        if name not in names:
            raise InputError(
                f"{where}: block {plant.name!r} has no input {name!r}{did_you_mean(name, names)}"
            )
    if not wanted:
        raise InputError(f"{where}: expected one or more inputs to command, found none")
    return [k for k, name in enumerate(names) if name in wanted]


def _integrals(
    where: str, plant: Block, names: _Names, point: Point, integrate: Sequence[str], C: Array, D: Array
) -> tuple[list[Array], tuple[Measured, ...]]:
    """Return each integrated quantity as a row over all states, and its signal."""
    rows, found = [], []
    outputs = [s.name for s in plant.outputs]
    for name in integrate:
        k = names.find(name)
        if k is not None:
            rows.append(np.eye(len(plant.states))[k])
            found.append(
                Measured(names.signal(k).replace(start=point.x[k]), is_angle(plant, plant.states[k]))
            )
            continue
        if name not in outputs:
            hint = did_you_mean(name, [*(s.name for s in plant.states), *outputs])
            raise InputError(f"{where}: block {plant.name!r} has no state or output {name!r}{hint}")
        j = outputs.index(name)
        if np.abs(D[j]).max() > 0.0:
            raise InputError(
                f"{where}: the output {name!r} depends on an input directly and cannot be integrated"
            )
        rows.append(C[j])
        found.append(
            Measured(plant.outputs[j].replace(start=operating_point.outputs(plant, point)[j]), False)
        )
    return rows, tuple(found)


def _inside(where: str, signal: Signal, value: float) -> float:
    """Return an input's value at the operating point; one a rounding outside its bounds is at the bound."""
    nearest = min(max(value, signal.lower), signal.upper)
    if abs(nearest - value) <= 1e-9 * (1.0 + abs(value)):
        return nearest
    try:
        return signal.check(value)
    except InputError as error:
        raise InputError(f"{where}: the operating point is out of reach: {error}") from None


def is_angle(plant: Block, state: Signal) -> bool:
    """Return whether 2 pi more of a state is the same to the plant: an angle of its equations of motion.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> [s.name for s in plant.states if is_angle(plant, s)]
    ['psi']
    """
    if state.unit != "rad":
        return False
    turn = {state.symbol: state.symbol + 2 * sp.pi}
    expanded = (plant.expand(e) for e in plant.derivatives.values())
    return all(e.xreplace(turn) == e for e in expanded)


def by_name(given: object) -> list[str] | None:
    """Return the names of weights that are given by name, None of others."""
    return list(given) if isinstance(given, Mapping) else None
