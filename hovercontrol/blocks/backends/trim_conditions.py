"""The conditions of a trim: the rates and outputs with given values, and the residuals at a point.

With x, u the states and inputs, f the rates and g the outputs of the Block, a trim is a point with

    f_i(t, x, u) = given rate (0 unless given),    g_j(t, x, u) = given output,

and x and u within the bounds of their signals. The rate of a sampled state is its change per step,
next x - x.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import partial_derivatives
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import dimension

_VELOCITIES = (dimension("m/s"), dimension("rad/s"), dimension("1/s"))


def with_rates(block: Block) -> Block:
    """Return a Block in which the derivative of each sampled state is its change per step, next x - x.

    Examples
    --------
    >>> from hovercontrol import Signal
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s")
    >>> step = Block("step", [v], [a], derivatives={"v": 0.8 * v.symbol + a.symbol}, period=0.1)
    >>> print(with_rates(step).equations())
    v' = a - 0.2*v
    """
    after = _next_values(block)
    if not after:
        return block
    rates = {
        name: after[name] - sp.Symbol(name, real=True) if name in after else e
        for name, e in block.derivatives.items()
    }
    return block.unchecked(derivatives=Expressions(rates), ticks=(), period=0.0)


def _next_values(block: Block) -> Mapping[str, sp.Expr]:
    if block.period:
        return block.derivatives
    return {name: e for tick in block.ticks for name, e in tick.updates.items()}


def rate_name(block: Block, state: str) -> str:
    """Return the name of a state's rate in messages: ``u'``, or ``mode per step`` if it is sampled."""
    return f"{state} per step" if state in _next_values(block) else f"{state}'"


def rate_unit(block: Block, state: str) -> str:
    """Return the unit of a state's rate; for a sampled state it is that of the state.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> rate_unit(craft, "x"), rate_unit(craft, "u")
    ('m/s', 'm/s^2')
    """
    unit = block.signal(state).unit
    if state in _next_values(block):
        return unit
    base, slash, power = unit.rpartition("/s")
    if slash and (not power or (power.startswith("^") and power[1:].isdigit())):
        return f"{base}/s^{int(power[1:] or 1) + 1}"
    return f"{unit}/s" if "/" not in unit else f"({unit})/s"


def ignorable_states(block: Block, asked: Collection[str] = ()) -> tuple[str, ...]:
    """Return the states that may change while all others are constant: a craft's position and heading.

    A state is ignorable if three conditions hold: its rate depends neither on the state itself nor on an
    input; it is neither a velocity nor a mode; and every rate that depends on it belongs to an ignorable
    state and has the period 2 pi in it, as for an angle. So a motion with constant u, v and r is steady, but
    a motion with a constant acceleration is not.

    Parameters
    ----------
    block : Block
        From :func:`with_rates`.
    asked : collection of str, optional
        States with given rates. Their rates are constant only if the states that they depend on are constant:
        a craft that goes north keeps its heading.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> ignorable_states(vehicle("c17_simulation").plant())
    ('x', 'y', 'psi')
    >>> ignorable_states(vehicle("c17_simulation").plant(), ["x"])
    ('x', 'y')
    """
    names = [s.name for s in block.states]
    inputs = [s.name for s in block.inputs]
    depends = set(partial_derivatives(block, "derivatives", names))
    by_input = {i for i, _ in partial_derivatives(block, "derivatives", inputs)}
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
    """Return the states and inputs on which some rates and outputs, given by row, depend."""
    names = [s.name for s in (*block.states, *block.inputs)]
    found = {names[j] for i, j in partial_derivatives(block, "derivatives", names) if i in rates}
    return found | {names[j] for i, j in partial_derivatives(block, "outputs", names) if i in outputs}


def _periodic(block: Block, state: str, angle: Signal) -> bool:
    e = block.expand(block.derivatives[state])
    return bool(e.xreplace({angle.symbol: angle.symbol + 2 * sp.pi}) == e)


@dataclass(frozen=True)
class Condition:
    """One equation of a trim.

    Parameters
    ----------
    name : str
        Name in messages: ``u'``, or an output.
    unit : str
    nominal : float
        Nominal size, by which the residual is divided.
    state : str, optional
        Name of the state, if the condition is on a rate.
    """

    name: str
    unit: str
    wanted: float
    nominal: float
    state: str = ""

    def line(self, found: float) -> str:
        """Return the deviation of a point as text: ``u' = -0.35 m/s^2, wanted 0``."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} = {found:.4g}{unit}, wanted {self.wanted:.4g}"


@dataclass(frozen=True)
class Conditions:
    """The equations of a trim as functions of the unknown states and inputs, scaled by nominal sizes.

    Parameters
    ----------
    rates_block : Block
        The same Block without delays, from :func:`with_rates`.
    x, u : ndarray, shapes (n_states,) and (n_inputs,)
        Given values, and initial values of the search for the others.
    free_states, free_inputs : sequence of int
        Indices of the unknowns.
    rates, outputs : mapping of int to float
        Wanted values by row.
    params : mapping, optional
        Parameter values by key.
    time : float
        Time [s].
    """

    block: Block
    rates_block: Block
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
                rate_name(self.block, states[k].name),
                rate_unit(self.block, states[k].name),
                wanted,
                states[k].nominal,
                states[k].name,
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
        """Initial values of the search, in nominal sizes."""
        return np.concatenate([self.x[list(self.free_states)], self.u[list(self.free_inputs)]]) / self.sizes

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the unknowns, in nominal sizes."""
        lower = np.array([s.lower for s in self.unknowns])
        return lower / self.sizes, np.array([s.upper for s in self.unknowns]) / self.sizes

    def point(self, z: Array) -> tuple[Array, Array]:
        """Return the states and inputs for the unknowns z (in nominal sizes)."""
        x, u, values = self.x.copy(), self.u.copy(), z * self.sizes
        n = len(self.free_states)
        x[list(self.free_states)], u[list(self.free_inputs)] = values[:n], values[n:]
        return x, u

    def found(self, z: Array) -> Array:
        """Return the rates and outputs at z, in the order of the conditions, in their units."""
        x, u = self.point(z)
        f = numpy_functions(self.rates_block)
        with np.errstate(all="ignore"):
            rates = f.derivatives(self.time, x, u, self.params)
            outputs = f.outputs(self.time, x, u, self.params) if self.outputs else np.zeros(0)
        return np.concatenate([rates[list(self.rates)], outputs[list(self.outputs)]])

    def missing(self, z: Array) -> Array:
        """Return the residuals F_i(z) = (found_i - wanted_i)/n_i, with the nominal sizes n_i."""
        wanted = np.array([c.wanted for c in self.each])
        return (self.found(z) - wanted) / np.array([c.nominal for c in self.each])

    def jacobian(self, z: Array) -> Array:
        """Return the exact Jacobian dF/dz of :meth:`missing`, shape (n_conditions, n_unknowns)."""
        x, u = self.point(z)
        f = numpy_functions(self.rates_block)

        def of(rows: str, columns: str) -> Array:
            with np.errstate(all="ignore"):
                return f.jacobian(self.time, x, u, self.params, rows, columns)  # type: ignore[arg-type]

        def of_unknowns(rows: str, wanted: Sequence[int]) -> Array:
            parts = [of(rows, "states")[:, list(self.free_states)]]
            parts += [of(rows, "inputs")[:, list(self.free_inputs)]]
            return np.hstack(parts)[list(wanted)]

        # dF_i/dz_j = (s_j/n_i) dfound_i/dv_j, with v_j = s_j z_j and the nominal sizes s_j, n_i
        whole = of_unknowns("derivatives", list(self.rates))
        if self.outputs:
            whole = np.vstack([whole, of_unknowns("outputs", list(self.outputs))])
        return whole * self.sizes / np.array([c.nominal for c in self.each])[:, None]


def closest_names(name: str, groups: Mapping[str, Sequence[str]], wanted: str) -> str:
    """Return the end of an error message about a name that is not of the expected kind.

    Parameters
    ----------
    groups : mapping of str to sequence of str
        Names by kind.
    wanted : str
        The expected kind.

    Examples
    --------
    >>> closest_names("thrust", {"state": ["u"], "input": ["thrust"]}, "state")
    '; it is an input'
    """
    for kind, names in groups.items():
        if name in names:
            return f"; it is an {kind}" if kind[0] in "aeiou" else f"; it is a {kind}"
    return did_you_mean(name, groups[wanted])
