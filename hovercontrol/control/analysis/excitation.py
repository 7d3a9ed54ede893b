"""Are coefficients excited by a motion? The condition of C17 section V, sampled [C17 eq 14a, 14b, 14c].

In ``x' = h + G c`` the coefficients follow from the motion iff no direction d has ``G d = 0``
at all times [C17 eq 7] [C17 lemma 2]. Row by row this is the linear independence of the functions
that multiply the coefficients in one equation: for the hovercraft the sets (14a-c).

C17 says "if and only if (14a-c)". Independent sets do suffice, but they are not necessary: a
coefficient shared by two equations (thrust) may be known from one of them and then helps the
other. Both are answered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.directions import Direction
from hovercontrol.control.observers.observable_subspace import readable
from hovercontrol.control.observers.regression import Regression, regression
from hovercontrol.control.observers.regressors import regressors_along

#: A function whose RMS is below this (per unit coefficient, in nominal sizes of the state a second)
#: is taken as zero.
ZERO = 1e-6


@checked
@dataclass(frozen=True, eq=False)
class FunctionSet:
    """The functions that multiply the coefficients in one equation, or in all at once.

    Attributes
    ----------
    equation : str
        Name of the state, or ``"all"``.
    functions : dict of str to str
        Expression of each function by its coefficient; of all equations where there are several.
    rms : dict of str to float
        Root mean square over the window, per unit coefficient (in ``"all"``: in nominal sizes of
        the states a second).
    gram : ndarray, shape (k, k)
        Inner products of the functions that are not zero, each scaled to RMS 1.
    singular_values : ndarray, shape (k,)
        Of those functions, falling: the RMS of their combinations.
    not_excited : tuple of str
        Coefficients whose function is zero all the time.
    directions : tuple of Direction
        The combinations that are zero; those of ``not_excited`` alone come first.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> found = excitation(hc.vehicle("c17_simulation").plant(), t, {"u": 2.0 + 0 * t}, ["surge_coulomb"])
    >>> found.joint.equation, found.joint.not_excited, found.joint.directions
    ('all', (), ())
    """

    equation: str
    functions: dict[str, str]
    rms: dict[str, float]
    gram: Array
    singular_values: Array
    not_excited: tuple[str, ...]
    directions: tuple[Direction, ...]

    __repr__ = short_repr

    @property
    def independent(self) -> bool:
        """Whether no combination of the functions is zero."""
        return not self.directions

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite where a function is zero."""
        if self.not_excited or not self.singular_values[-1] > 0:
            return math.inf
        return float(self.singular_values[0] / self.singular_values[-1])


@checked
@dataclass(frozen=True, eq=False)
class Excitation:
    """The excitation of coefficients by a motion.

    Attributes
    ----------
    sets : tuple of FunctionSet
        One for each equation: (14a-c).
    joint : FunctionSet
        All equations together: no d with G d = 0.
    tolerance : float

    Examples
    --------
    >>> import hovercontrol as hc
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> found = excitation(hc.vehicle("c17_simulation").plant(), t, {"u": 2.0 + 0 * t}, ["surge_coulomb"])
    >>> found.observable, [s.equation for s in found.sets]
    (True, ['u'])
    """

    sets: tuple[FunctionSet, ...]
    joint: FunctionSet
    tolerance: float

    def __repr__(self) -> str:
        return self.table()

    @property
    def observable(self) -> bool:
        """Whether the motion excites all coefficients."""
        return self.joint.independent

    def sentence(self) -> str:
        """Return the verdict in words."""
        if self.observable:
            return f"observable: condition number {self.joint.condition:.3g}"
        alone = ", ".join(self.joint.not_excited)
        mixed = [str(d) for d in self.joint.directions[len(self.joint.not_excited) :]]
        parts = [f"not excited at all: {alone}"] if alone else []
        return "; ".join(["not observable", *parts, *(f"not seen: {text}" for text in mixed)])

    def table(self) -> str:
        """Return the sets as text, one line each, with the combinations that are not seen."""
        lines = [f"{'equation':10} {'condition':>10}  verdict"]
        for s in (*self.sets, self.joint):
            hidden = "; ".join(map(str, s.directions))
            text = f"dependent: {hidden}" if hidden else "independent"
            name = s.equation if s is self.joint else f"{s.equation}'"
            lines.append(f"{name:10} {s.condition:10.3g}  {text}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Return a figure: the singular values of every set, with the tolerance."""
        figure = Figure(figsize=(7.0, 4.0), layout="constrained")
        ax = figure.subplots()
        for s in (*self.sets, self.joint):
            if s.singular_values.size:
                relative = np.maximum(s.singular_values / s.singular_values[0], 1e-16)
                order = np.arange(1, relative.size + 1)
                label = f"{s.equation}'" if s is not self.joint else "all equations"
                ax.semilogy(order, relative, "o-", label=label)
        ax.axhline(self.tolerance, color="black", linestyle="--", label="tolerance")
        ax.set(xlabel="number of the singular value [1]", ylabel="singular value / largest [1]")
        ax.legend()
        return open_in_pyplot(figure)


@checked
def excitation(
    block: Block,
    time: ArrayLike,
    signals: Mapping[str, ArrayLike],
    coefficients: Sequence[str] | None = None,
    *,
    tolerance: float = 1e-3,
) -> Excitation:
    """Return the excitation of a Block's coefficients by a motion.

    Parameters
    ----------
    block : Block
        Linear in the coefficients.
    time : array_like, shape (n,)
        Increasing times [s]; steps may differ.
    signals : mapping of str to array_like, shape (n,)
        The states and inputs that G needs, by name; more are ignored. Noise excites too: ``sgn v``
        of a craft that does not slip is full of it, so pass velocities that are smoothed.
    coefficients : sequence of str, optional
        Default: all in which the Block is linear.
    tolerance : float, optional
        Functions scaled to RMS 1 are dependent when a combination has less than this share of the
        largest combination's RMS.

    Returns
    -------
    Excitation

    Raises
    ------
    InputError
        If signals are missing (all are named), of another length or not finite, time does not
        increase, the Block is not linear in a coefficient, or tolerance is not in (0, 1).

    Notes
    -----
    C17 (7), (14a-c).

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> straight = {"u": 2.0 + 0 * t}
    >>> drag = ["surge_coulomb", "surge_linear_drag"]
    >>> excitation(c17_simulation().plant(), t, straight, drag).sentence()
    'not observable; not seen: surge_coulomb - 0.5 surge_linear_drag'
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance must be between 0 and 1, found {tolerance!r}")
    model = regression(block, coefficients)
    t = np.asarray(time, dtype=float)
    G = regressors_along(model, t, signals)
    weights = mean_weights(t)
    sets = []
    for i, state in enumerate(model.states):
        own = [j for j in range(len(model.names)) if model.G[i, j] != 0]
        sets.append(_function_set(model, state.name, [i], own, G, weights, tolerance))
    everything = list(range(len(model.names)))
    rows = list(range(len(model.states)))
    joint = _function_set(model, "all", rows, everything, G, weights, tolerance)
    return Excitation(tuple(sets), joint, tolerance)


@checked
def signals_of(response: control.TimeResponseData) -> dict[str, Array]:
    """Return states, inputs and outputs of a simulation by name, shape (n,) each.

    Parameters
    ----------
    response : control.TimeResponseData
        Of one trace.

    Raises
    ------
    InputError
        If there are several traces.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.trajectory import simulate
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> response = simulate(hoverdemon().plant(), [0.0, 1.0], {"thrust": 1.0})
    >>> list(signals_of(response))
    ['x', 'y', 'psi', 'u', 'v', 'r', 'thrust', 'rudder']
    """
    if response.ntraces > 1:
        raise InputError(f"expected a response of one trace, found {response.ntraces}")
    n = len(response.t)
    found: dict[str, Array] = {}
    for labels, values in (
        (response.state_labels, response.x),
        (response.input_labels, response.u),
        (response.output_labels, response.y),
    ):
        if values is not None and labels:
            found |= dict(zip(labels, np.asarray(values).reshape(-1, n), strict=True))
    return found


def mean_weights(t: Array) -> Array:
    """Return the weights, sum 1, that make a sum over samples a mean over time (trapezoidal)."""
    step = np.diff(t)
    return (np.append(step, 0.0) + np.append(0.0, step)) / (2 * (t[-1] - t[0]))


def _function_set(
    model: Regression,
    equation: str,
    rows: list[int],
    own: list[int],
    G: Array,
    weights: Array,
    tolerance: float,
) -> FunctionSet:
    """Return the analysis of the functions of some coefficients in some equations."""
    names = [model.names[j] for j in own]
    units = {model.names[j]: model.coefficients[j].unit for j in own}
    nominal = np.array([model.states[i].nominal for i in rows])[:, None, None]
    F = (G[np.ix_(rows, own)] / nominal * np.sqrt(weights)).swapaxes(1, 2).reshape(-1, len(own))
    rms = np.sqrt((F**2).sum(axis=0))
    zero = rms < ZERO
    live = np.flatnonzero(~zero)
    scaled = F[:, live] / rms[live]
    _, s, Vt = np.linalg.svd(scaled, full_matrices=len(scaled) < len(live))
    s = np.append(s, np.zeros(len(live) - len(s)))
    hidden = Vt[s < tolerance * s[0]] if live.size else Vt[:0]
    vectors = [np.eye(len(own))[j] for j in np.flatnonzero(zero)]
    for row in readable(hidden):
        vectors.append(np.zeros(len(own)))
        vectors[-1][live] = row
    sizes = np.where(zero, 1.0, 1.0 / np.where(zero, 1.0, rms))
    text = {
        name: ", ".join(str(model.G[i, j]) for i in rows if model.G[i, j] != 0)
        for name, j in zip(names, own, strict=True)
    }
    shown = rms * (nominal[0, 0, 0] if len(rows) == 1 else 1.0)
    return FunctionSet(
        equation,
        text,
        dict(zip(names, shown.tolist(), strict=True)),
        scaled.T @ scaled,
        s,
        tuple(name for name, dead in zip(names, zero, strict=True) if dead),
        tuple(Direction.of(units, v, sizes) for v in vectors),
    )
