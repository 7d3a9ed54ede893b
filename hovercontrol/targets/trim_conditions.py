"""What a trim asks of a Block: which rates and outputs have given values, and how far a point is from them.

With x, u the states and inputs, f the rates and g the outputs of the Block, a trim is a point with

    f_i(t, x, u) = given rate (0 unless given),    g_j(t, x, u) = given output,

x and u within the bounds of their signals. Of a sampled Block the rate is what a step adds, next x - x.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.derivatives import partial_derivatives
from hovercontrol.core.functions import numpy_functions
from hovercontrol.core.signals import Signal
from hovercontrol.core.units import dimension
from hovercontrol.errors import did_you_mean

Array = NDArray[np.float64]

_VELOCITIES = (dimension("m/s"), dimension("rad/s"), dimension("1/s"))


def rate_unit(block: Block, state: str) -> str:
    """Return the unit of a state's rate; of a sampled Block that of the state.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> rate_unit(craft, "x"), rate_unit(craft, "u")
    ('m/s', 'm/s^2')
    """
    unit = block.signal(state).unit
    if block.period:
        return unit
    base, slash, power = unit.rpartition("/s")
    if slash and (not power or (power.startswith("^") and power[1:].isdigit())):
        return f"{base}/s^{int(power[1:] or 1) + 1}"
    return f"{unit}/s" if "/" not in unit else f"({unit})/s"


def ignorable_states(block: Block, asked: Collection[str] = ()) -> tuple[str, ...]:
    """Return the states that may move while all others rest: a craft's position and heading.

    A state is ignorable if its own rate depends neither on itself nor on an input, it is no velocity, and the
    rates that depend on it belong to ignorable states and have the period 2 pi in it, as an angle's have. So
    a motion at constant u, v and r is steady, whereas one at a constant acceleration is not.

    Parameters
    ----------
    block : Block
    asked : collection of str, optional
        States whose rates are given. They are steady only if the states that they depend on rest: a craft
        that is to go north keeps its heading.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> ignorable_states(vehicle("c17_simulation").plant())
    ('x', 'y', 'psi')
    >>> ignorable_states(vehicle("c17_simulation").plant(), ["x"])
    ('x', 'y')
    """
    names = [s.name for s in block.states]
    inputs = [s.name for s in block.inputs]
    by_state = partial_derivatives(block, "derivatives", names)
    by_input = {i for i, _ in partial_derivatives(block, "derivatives", inputs)}
    rests = {(i, i) for i in range(len(names))} if block.period else set()
    depends = {
        (i, j)
        for (i, j), entry in by_state.items()
        if (i, j) not in rests or block.expand(entry) != 1  # next x = x + ... does not depend on x
    }
    ignorable: set[int] = set()
    while True:
        more = {
            j
            for j, signal in enumerate(block.states)
            if j not in ignorable | by_input
            and (j, j) not in depends
            and signal.dimension not in _VELOCITIES
            and not signal.modes
            and all(
                i in ignorable and names[i] not in asked and _periodic(block, names[i], signal)
                for i, k in depends
                if k == j
            )
        }
        if not more:
            return tuple(name for k, name in enumerate(names) if k in ignorable)
        ignorable |= more


def names_that_count(block: Block, rates: Collection[int], outputs: Collection[int]) -> set[str]:
    """Return the states and inputs on which any of some rates (outputs), by row, depends."""
    names = [s.name for s in (*block.states, *block.inputs)]
    found = {names[j] for i, j in partial_derivatives(block, "derivatives", names) if i in rates}
    return found | {names[j] for i, j in partial_derivatives(block, "outputs", names) if i in outputs}


def _periodic(block: Block, state: str, angle: Signal) -> bool:
    e = block.expand(block.derivatives[state])
    if block.period:
        e = e - sp.Symbol(state, real=True)
    return bool(e.xreplace({angle.symbol: angle.symbol + 2 * sp.pi}) == e)


@dataclass(frozen=True)
class Condition:
    """One equation of a trim.

    Parameters
    ----------
    name : str
        As lines have it: ``u'``, or an output.
    unit : str
    wanted : float
    nominal : float
        Size by which what is missing is divided.
    """

    name: str
    unit: str
    wanted: float
    nominal: float

    def line(self, found: float) -> str:
        """Return how a point falls short: ``u' = -0.35 m/s^2, wanted 0``."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} = {found:.4g}{unit}, wanted {self.wanted:.4g}"


@dataclass(frozen=True)
class Conditions:
    """The equations of a trim as functions of the unknown states and inputs, each in its nominal size.

    Parameters
    ----------
    block : Block
        Without delays.
    x, u : ndarray, shapes (n_states,) and (n_inputs,)
        Given values, and where the search for the others begins.
    free_states, free_inputs : sequence of int
        The unknowns.
    rates, outputs : mapping of int to float
        Wanted values by row.
    params : mapping, optional
    time : float
        [s]
    """

    block: Block
    x: Array
    u: Array
    free_states: Sequence[int]
    free_inputs: Sequence[int]
    rates: Mapping[int, float]
    outputs: Mapping[int, float]
    params: Mapping[str, float] | None = None
    time: float = 0.0
    unknowns: tuple[Signal, ...] = field(init=False)
    each: tuple[Condition, ...] = field(init=False)

    def __post_init__(self) -> None:
        states, inputs = self.block.states, self.block.inputs
        unknowns = (*(states[k] for k in self.free_states), *(inputs[k] for k in self.free_inputs))
        of_rates = (
            Condition(
                f"{states[k].name} per step" if self.block.period else f"{states[k].name}'",
                rate_unit(self.block, states[k].name),
                wanted,
                states[k].nominal,
            )
            for k, wanted in self.rates.items()
        )
        signals = self.block.outputs
        of_outputs = (
            Condition(signals[k].name, signals[k].unit, wanted, signals[k].nominal)
            for k, wanted in self.outputs.items()
        )
        object.__setattr__(self, "unknowns", unknowns)
        object.__setattr__(self, "each", (*of_rates, *of_outputs))

    @property
    def sizes(self) -> Array:
        """Nominal sizes of the unknowns."""
        return np.array([s.nominal for s in self.unknowns])

    @property
    def start(self) -> Array:
        """Where the search begins, in nominal sizes."""
        return np.concatenate([self.x[list(self.free_states)], self.u[list(self.free_inputs)]]) / self.sizes

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the unknowns, in nominal sizes."""
        lower = np.array([s.lower for s in self.unknowns])
        return lower / self.sizes, np.array([s.upper for s in self.unknowns]) / self.sizes

    def point(self, z: Array) -> tuple[Array, Array]:
        """Return states and inputs of the unknowns z."""
        x, u, values = self.x.copy(), self.u.copy(), z * self.sizes
        n = len(self.free_states)
        x[list(self.free_states)], u[list(self.free_inputs)] = values[:n], values[n:]
        return x, u

    def found(self, z: Array) -> Array:
        """Return rates and outputs, in the order of the conditions, in their units."""
        x, u = self.point(z)
        f = numpy_functions(self.block)
        with np.errstate(all="ignore"):
            rates = f.derivatives(self.time, x, u, self.params) - (x if self.block.period else 0.0)
            outputs = f.outputs(self.time, x, u, self.params) if self.outputs else np.zeros(0)
        return np.concatenate([rates[list(self.rates)], outputs[list(self.outputs)]])

    def missing(self, z: Array) -> Array:
        """Return found less wanted, in nominal sizes."""
        wanted = np.array([c.wanted for c in self.each])
        return (self.found(z) - wanted) / np.array([c.nominal for c in self.each])

    def jacobian(self, z: Array) -> Array:
        """Return the exact derivative of :meth:`missing`, shape (n_conditions, n_unknowns)."""
        x, u = self.point(z)
        f = numpy_functions(self.block)

        def of(rows: str, columns: str) -> Array:
            with np.errstate(all="ignore"):
                return f.jacobian(self.time, x, u, self.params, rows, columns)  # type: ignore[arg-type]

        def of_unknowns(rows: str, wanted: Sequence[int], less: Array | float = 0.0) -> Array:
            parts = [(of(rows, "states") - less)[:, list(self.free_states)]]
            parts += [of(rows, "inputs")[:, list(self.free_inputs)]]
            return np.hstack(parts)[list(wanted)]

        stays = np.eye(len(x)) if self.block.period else 0.0
        whole = of_unknowns("derivatives", list(self.rates), stays)
        if self.outputs:
            whole = np.vstack([whole, of_unknowns("outputs", list(self.outputs))])
        return whole * self.sizes / np.array([c.nominal for c in self.each])[:, None]


def closest_names(name: str, groups: Mapping[str, Sequence[str]], wanted: str) -> str:
    """Return the end of an error line on a name that is not of the wanted kind.

    Parameters
    ----------
    name : str
    groups : mapping of str to sequence of str
        Names by kind.
    wanted : str
        The kind.

    Examples
    --------
    >>> closest_names("thrust", {"state": ["u"], "input": ["thrust"]}, "state")
    '; it is an input'
    """
    for kind, names in groups.items():
        if name in names:
            return f"; it is an {kind}" if kind[0] in "aeiou" else f"; it is a {kind}"
    return did_you_mean(name, groups[wanted])
