"""Generic actuator effects at an input: dead zone, play, lag, limits."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.core.signals import Signal
from hovercontrol.effects.actuator import TAU, clipped, limited_rate, play
from hovercontrol.effects.base import Effect
from hovercontrol.effects.coefficient import TINY, Shape
from hovercontrol.effects.generic_classes import make_class, remembered, word


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
