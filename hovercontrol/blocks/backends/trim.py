"""Operating points of a Block, by name: given values, solved values, and rates of the states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.html import card, table
from hovercontrol.base.tables import finite
from hovercontrol.blocks.backends.friction_slopes import Point, creeping
from hovercontrol.blocks.backends.trim_conditions import (
    Conditions,
    closest_names,
    ignorable_states,
    names_that_count,
    rate_name,
    rate_unit,
    with_rates,
)
from hovercontrol.blocks.backends.trim_solver import bound_at, failure, solve, undetermined
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.functions import numpy_functions

if TYPE_CHECKING:
    import control

Values = Mapping[str, float]


@checked
@dataclass(frozen=True, eq=False)
class Trim:
    """An operating point of a Block, from ``block.trim(...)``.

    Parameters
    ----------
    block : Block
    states, inputs, outputs : mapping of str to float
        Values in their units, in the Block's order.
    rates : mapping of str to float
        The states' derivatives, in the unit of the state per second; for sampled states, the change per step.
    params : mapping of str to float
        Given parameter values by key, in their units.
    time : float
        Time of the operating point [s].
    how : mapping of str to str
        Origin of the value of each state and input: "given", "solved", "at its lower bound", "at its upper
        bound", "nearest to its start" (the conditions leave a choice), "at its start" (no condition depends
        on it). A velocity within the width of its smoothed dry friction is "solved, creeping": Coulomb
        friction would hold it at rest.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation").plant()
    >>> ahead = craft.trim(states={"u": 1.0})
    >>> round(ahead.inputs["thrust"], 3), ahead.rates["x"], ahead.free
    (1.8, 1.0, ('v', 'r', 'rudder'))
    """

    block: Block
    states: Values
    inputs: Values
    outputs: Values
    rates: Values
    params: Values = field(default_factory=dict)
    time: float = 0.0
    how: Mapping[str, str] = field(default_factory=dict)

    @property
    def x(self) -> Array:
        """The states as an array, shape (n_states,)."""
        return np.array(list(self.states.values()), dtype=float)

    @property
    def u(self) -> Array:
        """The inputs as an array, shape (n_inputs,)."""
        return np.array(list(self.inputs.values()), dtype=float)

    @property
    def y(self) -> Array:
        """The outputs as an array, shape (n_outputs,)."""
        return np.array(list(self.outputs.values()), dtype=float)

    @property
    def free(self) -> tuple[str, ...]:
        """States and inputs that the conditions leave undetermined; they are nearest to their start."""
        return tuple(name for name, how in self.how.items() if how == "nearest to its start")

    @property
    def operating_point(self) -> control.OperatingPoint:
        """The same point as a :class:`control.OperatingPoint`."""
        import control

        return control.OperatingPoint(self.x, self.u, self.y)

    def linearize(self, **options: Any) -> control.StateSpace:
        """Return the linear system about this point.

        Parameters
        ----------
        **options
            As for :meth:`hovercontrol.Block.linearize`: ``friction``, ``amplitude``.
        """
        return self.block.linearize(self, **options)

    def __str__(self) -> str:
        rows = [(name, f"{value:.5g}", unit, how) for name, value, unit, how in self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(3)] if rows else [0, 0, 0]
        lines = [
            f"  {n:<{widths[0]}}  {v:>{widths[1]}}  {u:<{widths[2]}}  {how}".rstrip() for n, v, u, how in rows
        ]
        return "\n".join([f"Trim of {self.block.name!r}", *lines])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return card("Trim", self.block.name, "", table(("name", "value", "unit", ""), self._rows()))

    def _rows(self) -> list[tuple[str, float, str, str]]:
        """Return rows of name, value, unit and origin; rates that are not zero come last."""
        own = {**self.states, **self.inputs}
        rows = [(name, value, self.block.signal(name).unit, self.how[name]) for name, value in own.items()]
        rows += [(key, value, self.block.parameter(key).unit, "given") for key, value in self.params.items()]
        for signal in self.block.outputs:
            if signal.name not in own:
                value = self.outputs[signal.name]
                room = 1e-6 * signal.nominal
                within = signal.lower - room <= value <= signal.upper + room
                rows.append(
                    (signal.name, value, signal.unit, "output" if within else "output, out of bounds")
                )
        for name, rate in self.rates.items():
            if abs(rate) > 1e-6 * self.block.signal(name).nominal:
                rows.append((rate_name(self.block, name), rate, rate_unit(self.block, name), "rate"))
        return rows


def trim(
    block: Block,
    states: Values | None = None,
    inputs: Values | None = None,
    outputs: Values | None = None,
    *,
    rates: Mapping[str, float | None] | None = None,
    params: Values | None = None,
    time: float = 0.0,
    guess: Values | Trim | None = None,
) -> Trim:
    """Return an operating point of a Block; arguments and errors as for :meth:`hovercontrol.Block.trim`.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation").plant()
    >>> circle = trim(craft, {"u": 1.0, "r": 0.5})
    >>> {name: round(value, 4) for name, value in circle.inputs.items()}
    {'thrust': 2.1574, 'rudder': -0.0808}
    """
    plain = with_rates(undelayed(block))
    guess = {**guess.states, **guess.inputs} if isinstance(guess, Trim) else _full(block, guess)
    states, rates = _full(block, states), _full(block, rates)
    params = {block.full_key(name): value for name, value in (params or {}).items()}
    groups = {
        "state": [s.name for s in block.states],
        "input": [s.name for s in block.inputs],
        "output": [s.name for s in block.outputs],
    }
    given = {kind: _given(block, kind, values or {}, groups) for kind, values in
             (("state", states), ("input", inputs), ("output", outputs))}  # fmt: skip
    x = _values(block, "states", given["state"], guess)
    u = _values(block, "inputs", given["input"], guess)
    _check_guess(block, guess or {}, groups)
    of_rates = _wanted_rates(plain, rates or {}, groups)
    of_outputs = {groups["output"].index(name): value for name, value in given["output"].items()}
    counts = names_that_count(plain, of_rates, of_outputs)

    def free(kind: str) -> list[int]:
        signals = enumerate(getattr(block, f"{kind}s"))
        return [k for k, s in signals if s.name in counts - set(given[kind]) and not _fixed(s)]

    unknowns = free("state"), free("input")
    conditions = Conditions(block, plain, x, u, *unknowns, of_rates, of_outputs, params, finite("time", time))
    block.parameter_values(params)
    z, holds = solve(conditions)
    if not holds:
        raise InputError(block.where(failure(conditions, z)))
    return _result(block, conditions, z, given)


def _full(block: Block, values: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return values by the full names of states; other names as they are."""
    inputs = {s.name for s in block.inputs}
    return {k if k in inputs else block.full_state(k): value for k, value in (values or {}).items()}


def _fixed(signal: Any) -> bool:
    """Return whether a signal is a mode, or its bounds are equal."""
    return bool(signal.modes) or signal.lower == signal.upper


def _given(block: Block, kind: str, values: Values, groups: Mapping[str, list[str]]) -> dict[str, float]:
    signals = {s.name: s for s in getattr(block, f"{kind}s")}
    found = {}
    for name, value in values.items():
        if name not in signals:
            raise InputError(block.where(f"no {kind} {name!r}{closest_names(name, groups, kind)}"))
        finite(f"{block.name}: {name}", value)
        try:
            found[name] = signals[name].check(float(value))
        except InputError as error:
            raise InputError(block.where(str(error))) from None
    return found


def _check_guess(block: Block, guess: Values, groups: Mapping[str, list[str]]) -> None:
    own = [*groups["state"], *groups["input"]]
    for name, value in guess.items():
        if name not in own:
            hint = closest_names(name, {**groups, "guess": own}, "guess")
            raise InputError(block.where(f"guess: no state or input {name!r}{hint}"))
        finite(f"{block.name}: guess of {name}", value)


def _values(block: Block, kind: str, given: Values, guess: Values | None) -> Array:
    """Return the given values, else the guess (clipped to the bounds), else the start values."""
    guessed = guess or {}
    return np.array(
        [
            given.get(s.name, np.clip(guessed.get(s.name, s.start), s.lower, s.upper))
            for s in getattr(block, kind)
        ],
        dtype=float,
    )


def _wanted_rates(
    block: Block, rates: Mapping[str, float | None], groups: Mapping[str, list[str]]
) -> dict[int, float]:
    for name, rate in rates.items():
        if name not in groups["state"]:
            hint = closest_names(name, groups, "state")
            raise InputError(block.where(f"rates: no state {name!r}{hint}"))
        if rate is not None:
            finite(f"{block.name}: rate of {name}", rate)
    moving = set(ignorable_states(block, [name for name, rate in rates.items() if rate is not None]))
    wanted = {s.name: None if s.name in moving else 0.0 for s in block.states} | dict(rates)
    return {k: float(rate) for k, rate in enumerate(wanted.values()) if rate is not None}


def _result(block: Block, conditions: Conditions, z: Array, given: Mapping[str, Values]) -> Trim:
    x, u = conditions.point(z)
    plain, t, params = conditions.rates_block, conditions.time, conditions.params
    f = numpy_functions(plain)
    choice = {conditions.unknowns[k].name for k in undetermined(conditions, z)}
    asked = np.abs(conditions.jacobian(z)).max(axis=0, initial=0.0) > 0
    how = dict.fromkeys((s.name for s in (*block.states, *block.inputs)), "at its start")
    how |= dict.fromkeys([*given["state"], *given["input"]], "given")
    for k, signal in enumerate(conditions.unknowns):
        side = bound_at(conditions, k, float(z[k]))
        if side:
            how[signal.name] = f"at its {side} bound"
        elif asked[k]:
            how[signal.name] = "nearest to its start" if signal.name in choice else "solved"
    for name in creeping(plain, Point(t, x, u, params or {})):
        if how.get(name) == "solved":
            how[name] = "solved, creeping: dry friction would hold it"

    def named(signals: Any, values: Array) -> dict[str, float]:
        return {s.name: float(v) for s, v in zip(signals, values, strict=True)}

    return Trim(
        block,
        named(block.states, x),
        named(block.inputs, u),
        named(block.outputs, f.outputs(t, x, u, params)),
        named(block.states, f.derivatives(t, x, u, params)),
        dict(params or {}),
        t,
        how,
    )
