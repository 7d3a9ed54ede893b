"""Effects around an FMU: before its inputs, after its outputs, and added to its derivatives (Model Exchange).

The equations come from the classes of :mod:`hovercontrol.craft.effects`. A class for a command acts on an
input as it is given, or on an output as a sensor's signal (a lag of a sensor is the same equation as that of
an actuator); a class for a measurement acts on an output; a class for a force acts on a derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.drag import per_second

#: Ending of the name of a signal as the FMU gets it (before) or as it is measured (after).
GIVEN, SEEN = "_given", "_measured"


@checked
@dataclass(frozen=True)
class Around:
    """Named effects around an FMU; immutable, and independent of the FMU's file.

    With u the inputs as they are given, y the FMU's outputs, x its states::

        u_fmu = before(u),    x' = f(x, u_fmu) + added(x, u_fmu),    y_measured = after(y)

    Parameters
    ----------
    inputs, outputs : tuple of Signal
        The FMU's, by their names.
    states : tuple of Signal, optional
        The FMU's continuous states; only of Model Exchange.
    derivatives : tuple of (str, str), optional
        Each state and the FMU's name of its derivative.
    at_inputs, at_outputs, in_equations : tuple of Effect, optional
        The effects, in the order in which they act: sorted by ``order``, else as given.

    Raises
    ------
    InputError
        If an effect stands where its class cannot act, or is listed twice.

    Examples
    --------
    >>> from hovercontrol.craft.effects.generic_commands import lag
    >>> u, y = Signal("u", "V"), Signal("y", "m")
    >>> slow = Around((u,), (y,), at_inputs=(lag("u", "V")(seconds=0.2),))
    >>> print(slow.before.equations())
    u_lagged' = (u - u_lagged)/before.u_lag_seconds
    u_given = u_lagged
    >>> slow.after is None, slow.values
    (True, {'before.u_lag_seconds': 0.2})
    """

    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...] = ()
    derivatives: tuple[tuple[str, str], ...] = ()
    at_inputs: tuple[Effect, ...] = ()
    at_outputs: tuple[Effect, ...] = ()
    in_equations: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        for place in ("at_inputs", "at_outputs", "in_equations"):
            effects = tuple(sorted(getattr(self, place), key=lambda e: e.order))
            object.__setattr__(self, place, effects)
            names = [e.name for e in effects]
            for e in effects:
                if e.kind() not in _KINDS[place]:
                    raise InputError(f"effect {e.name}: acts on {_where(e)}, not {_PLACES[place]}")
                if names.count(e.name) > 1:
                    raise InputError(f"the effect {e.name!r} is listed twice")
        if self.in_equations and not self.states:
            raise InputError("effects in equations need an FMU for Model Exchange")

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All effects, in order."""
        return (*self.at_inputs, *self.at_outputs, *self.in_equations)

    @property
    def before(self) -> Block | None:
        """The Block before the FMU: inputs as given, outputs ``NAME_given`` as the FMU gets them."""
        if not self.at_inputs:
            return None
        way = _commands(self.inputs)
        states = _through(self.at_inputs, "before", way)
        late = {} if way.delay is None else {s.name: way.delay for s in self.inputs}
        return _block("before", self.inputs, GIVEN, way.thrusts, states, self.at_inputs, late)

    @property
    def after(self) -> Block | None:
        """The Block after the FMU: inputs its outputs, outputs ``NAME_measured``."""
        if not self.at_outputs:
            return None
        way = _commands(self.outputs)
        states = _through([e for e in self.at_outputs if e.kind() == "input"], "after", way)
        true = SimpleNamespace(**way.thrusts)
        seen = SimpleNamespace(**way.thrusts, true=true, late=None)
        for e in self.at_outputs:
            e.measured(e.symbols("after"), seen)
        delay = way.delay if way.delay is not None else seen.late
        late = {} if delay is None else {s.name: delay for s in self.outputs}
        results = {s.name: getattr(seen, s.name) for s in self.outputs}
        return _block("after", self.outputs, SEEN, results, states, self.at_outputs, late)

    @property
    def added(self) -> Mapping[str, Block]:
        """For each derivative that is added to: by the FMU's name of it, a Block with one output ``added``.

        Its inputs are the FMU's states and its inputs as the FMU gets them.
        """
        found: dict[str, Block] = {}
        named = dict(self.derivatives)
        signals = (*self.states, *self.inputs)
        motion = SimpleNamespace(**{s.name: s.symbol for s in signals}, time=time, fastest=None)
        by_state: dict[str, list[tuple[Effect, sp.Expr]]] = {}
        for e in self.in_equations:
            for state, term in e.terms(e.symbols("added"), motion).items():
                if state not in {s.name for s in self.states}:
                    hint = did_you_mean(state, [s.name for s in self.states])
                    raise InputError(f"effect {e.name}: the FMU has no state {state!r}{hint}")
                by_state.setdefault(state, []).append((e, term))
        for state, pairs in by_state.items():
            own: dict[Signal, sp.Expr] = {}
            for e, _ in pairs:
                own |= e.states(e.symbols("added"), motion)
            unit = next(s.unit for s in self.states if s.name == state)
            effects = [e for e, _ in pairs]
            found[named.get(state, f"der({state})")] = Block(
                "added",
                states=tuple(own),
                inputs=signals,
                outputs=(Signal("added", per_second(unit)),),
                parameters=_parameters(effects, "added", {s.name: s.unit for s in signals}),
                derivatives={s.name: slope for s, slope in own.items()},
                output_expressions={"added": sp.Add(*(term for _, term in pairs))},
            )
        return found

    @property
    def values(self) -> dict[str, float]:
        """All numbers of the effects: by ``before.NAME``, ``after.NAME`` or ``added.NAME``."""
        places = (("before", self.at_inputs), ("after", self.at_outputs), ("added", self.in_equations))
        return {
            f"{owner}.{e.parameter(k)}": value
            for owner, effects in places
            for e in effects
            for k, value in e.values.items()
        }

    def with_values(self, values: Mapping[str, float]) -> Around:
        """Return the same effects with other numbers, by the keys of :attr:`values`; clipped to bounds.

        Raises
        ------
        InputError
            If a key is unknown.
        """
        known = self.values
        for key in values:
            check_known(key, known, f"no number {key!r} around the FMU")
        merged = known | dict(values)

        def again(owner: str, effects: Sequence[Effect]) -> tuple[Effect, ...]:
            return tuple(
                e.within_bounds(**{k: merged[f"{owner}.{e.parameter(k)}"] for k in e.values}) for e in effects
            )

        return replace(
            self,
            at_inputs=again("before", self.at_inputs),
            at_outputs=again("after", self.at_outputs),
            in_equations=again("added", self.in_equations),
        )


_PLACES = {"at_inputs": "an input", "at_outputs": "an output", "in_equations": "a derivative"}


#: The kinds of effect that may act at each place.
_KINDS = {"at_inputs": ("input",), "at_outputs": ("input", "measurement"), "in_equations": ("force",)}


def _where(e: Effect) -> str:
    return {"input": "an input", "measurement": "an output", "force": "a derivative"}[e.kind()]


def _commands(signals: Sequence[Signal]) -> Any:
    return SimpleNamespace(
        thrusts={s.name: s.symbol for s in signals},
        time=time,
        inputs={s.name: s.symbol for s in signals},
        units={s.name: s.unit for s in signals},
        delay=None,
    )


def _through(effects: Sequence[Effect], owner: str, way: Any) -> dict[Signal, sp.Expr]:
    states: dict[Signal, sp.Expr] = {}
    for e in effects:
        states |= e.commands(e.symbols(owner), way)
    return states


def _parameters(effects: Sequence[Effect], owner: str, units: Mapping[str, str]) -> tuple[Signal, ...]:
    return tuple(p for e in effects for p in e.signals(owner, units))


def _block(
    owner: str,
    signals: Sequence[Signal],
    ending: str,
    results: Mapping[str, sp.Expr],
    states: Mapping[Signal, sp.Expr],
    effects: Sequence[Effect],
    late: Mapping[str, sp.Expr],
) -> Block:
    named = {s.name: s.replace(name=_ended(s.name, ending)) for s in signals}
    return Block(
        owner,
        states=tuple(states),
        inputs=tuple(signals),
        outputs=tuple(named.values()),
        parameters=_parameters(effects, owner, {s.name: s.unit for s in signals}),
        derivatives={s.name: slope for s, slope in states.items()},
        output_expressions={named[s.name].name: results[s.name] for s in signals},
        delays=dict(late),
    )


def _ended(name: str, ending: str) -> str:
    """Return a name with an ending: ``u[1]`` becomes ``u_given[1]``."""
    stem, bracket, rest = name.partition("[")
    return f"{stem}{ending}{bracket}{rest}"
