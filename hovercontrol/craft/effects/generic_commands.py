"""Generic effects at an input: offset, dead zone, play, hysteresis, lags, limits, another gain astern."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.actuator import TAU, clipped, limited_rate, play
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.generic_classes import make_class, remembered, word


@remembered
def command_offset(signal: str, unit: str, same_as: str) -> type[Effect]:
    """Return the class of a constant added to an input as it is sent; `same_as` is that of the class."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal] = s.thrusts[signal] + c.value
        return {}

    return make_class(
        f"{word(signal)}_offset",
        (),
        f"A constant added to the command {signal}.",
        "calibration",
        signal=signal,
        order=2,
        before_curve=True,
        same_as=same_as,
        value=Coefficient(unit),
        commands=commands,
    )


@remembered
def asymmetry(signal: str, unit: str) -> type[Effect]:
    """Return the class of a gain of an input that differs with the sign of the command."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal] = s.thrusts[signal] + c.value * sp.Abs(s.thrusts[signal])
        return {}

    return make_class(
        f"{word(signal)}_asymmetry",
        (),
        f"A gain of {signal} that differs with its sign: times 1 + c above zero, 1 - c below.",
        "K06 (4.4): a propeller that turns backward",
        signal=signal,
        order=9,
        value=Coefficient("1", lower=-1.0, upper=1.0),
        commands=commands,
    )


@remembered
def hysteresis(signal: str, unit: str) -> type[Effect]:
    """Return the class of a hysteresis of an input: a part c of it passes a play, the rest does not."""
    state = Signal(f"{word(signal)}_hysteresis_memory", unit, f"memory of the hysteresis of {signal}")
    simple = backlash(signal, unit)

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        played, slope = play(s.thrusts[signal], c.play, c.tau, state.symbol)
        s.thrusts[signal] = (1 - c.value) * s.thrusts[signal] + c.value * played
        return {state: slope}

    def becomes(self: Effect, other: Effect) -> bool:
        return isinstance(other, simple)

    return make_class(
        f"{word(signal)}_hysteresis",
        (),
        f"Hysteresis of {signal}: (1 - c) {signal} + c play({signal}); with c = 1 it is play.",
        "Kuhnen, European Journal of Control 9 (2003): Prandtl-Ishlinskii, one operator",
        signal=signal,
        order=5,
        value=Coefficient("1", lower=0.0, upper=1.0),
        play=Shape(unit, lower=TINY, search=(0.2, 0.5, 1.0), of="input"),
        tau=Shape("s", lower=TINY, default=TAU, fixed=True),
        commands=commands,
        becomes=becomes,
    )


@remembered
def deadzone(signal: str, unit: str) -> type[Effect]:
    """Return the class of a dead zone of an input."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        u = s.thrusts[signal]
        s.thrusts[signal] = sp.Max(0, u - c.width) - sp.Max(0, -u - c.width)
        return {}

    return make_class(
        f"{word(signal)}_deadzone",
        (),
        f"Small values of {signal} that do nothing: max(0, {signal} - d), odd.",
        "static friction of an actuator",
        signal=signal,
        order=6,
        width=Shape(unit, lower=0.0, neutral=0.0, search=(0.05, 0.1, 0.2, 0.3), of="input"),
        commands=commands,
    )


@remembered
def backlash(signal: str, unit: str) -> type[Effect]:
    """Return the class of a play between an input and what it drives."""
    state = Signal(f"{word(signal)}_played", unit, f"{signal} behind its play")

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal], slope = play(s.thrusts[signal], c.width, c.tau, state.symbol)
        return {state: slope}

    return make_class(
        f"{word(signal)}_backlash",
        (),
        f"Play between {signal} and what it drives (hysteresis).",
        "Nordin and Gutman, Automatica 38 (2002)",
        signal=signal,
        order=5,
        width=Shape(unit, lower=0.0, neutral=0.0, search=(0.05, 0.1, 0.2, 0.4), of="input"),
        tau=Shape("s", lower=TINY, default=TAU, fixed=True),
        commands=commands,
    )


@remembered
def lag(signal: str, unit: str) -> type[Effect]:
    """Return the class of a lag of first order of an input."""
    state = Signal(f"{word(signal)}_lagged", unit, f"{signal} behind its lag")

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        slope = (s.thrusts[signal] - state.symbol) / c.seconds
        s.thrusts[signal] = state.symbol
        return {state: slope}

    return make_class(
        f"{word(signal)}_lag",
        (),
        f"What {signal} drives follows it with a lag of first order, from rest.",
        "first order of an actuator",
        signal=signal,
        order=3,
        seconds=Shape("s", lower=TINY, neutral=0.0, search=(1.0, 4.0, 15.0), of="step"),
        commands=commands,
    )


@remembered
def second_order_lag(signal: str, unit: str) -> type[Effect]:
    """Return the class of a lag of second order of an input."""
    name = word(signal)
    rate_unit = f"({unit})/s" if set(unit) & set("*/^ ") else f"{unit}/s"
    state = Signal(f"{name}_responding", unit, f"{signal} behind its lag of second order")
    rate = Signal(f"{name}_responding_rate", rate_unit, f"rate of {signal} behind its lag")
    simple = lag(signal, unit)

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        slope = ((s.thrusts[signal] - state.symbol) / c.seconds - 2 * c.damping * rate.symbol) / c.seconds
        s.thrusts[signal] = state.symbol
        return {state: rate.symbol, rate: slope}

    def becomes(self: Effect, other: Effect) -> bool:
        return isinstance(other, simple)

    return make_class(
        f"{name}_second_order_lag",
        (),
        f"Lag of second order behind {signal}, from rest: T^2 y'' + 2 d T y' + y = {signal}.",
        "second order of an actuator: a motor with its inductance or its controller",
        signal=signal,
        order=3,
        seconds=Shape("s", lower=TINY, neutral=0.0, search=(1.0, 4.0, 15.0), of="step"),
        damping=Shape("1", lower=0.05, upper=20.0, default=0.7, search=(0.4, 1.0)),
        commands=commands,
        becomes=becomes,
    )


@remembered
def rate_limit(signal: str, unit: str) -> type[Effect]:
    """Return the class of a limit of the rate of what an input drives; no search tries it."""
    state = Signal(f"{word(signal)}_rate_limited", unit, f"{signal} behind the limit of its rate")

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        slope = limited_rate(s.thrusts[signal], c.limit, c.tau, state.symbol)
        s.thrusts[signal] = state.symbol
        return {state: slope}

    return make_class(
        f"{word(signal)}_rate_limit",
        (),
        f"What {signal} drives changes no faster than a limit.",
        "speed of an actuator",
        signal=signal,
        order=4,
        limit=Shape(f"({unit})/s" if set(unit) & set("*/^ ") else f"{unit}/s", lower=TINY),
        tau=Shape("s", lower=TINY, default=TAU, fixed=True),
        commands=commands,
    )


@remembered
def saturation(signal: str, unit: str) -> type[Effect]:
    """Return the class of a limit of an input."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal] = clipped(s.thrusts[signal], -c.limit, c.limit)
        return {}

    return make_class(
        f"{word(signal)}_saturation",
        (),
        f"What {signal} drives does not grow beyond a limit: min({signal}, s), odd.",
        "limit of an actuator",
        signal=signal,
        order=7,
        limit=Shape(unit, lower=TINY, search=(0.5, 0.65, 0.8, 0.9), of="input"),
        commands=commands,
    )


@remembered
def gain(signal: str, unit: str) -> type[Effect]:
    """Return the class of a wrong gain of an input; only FMUs are searched for it, as Blocks have gains."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal] = (1 + c.value) * s.thrusts[signal]
        return {}

    return make_class(
        f"{word(signal)}_gain",
        (),
        f"A wrong gain of {signal}: (1 + c) {signal}.",
        "calibration",
        signal=signal,
        order=8,
        value=Coefficient("1", lower=-1.0),
        commands=commands,
    )
