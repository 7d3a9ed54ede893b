"""Actuators: the limits of a command, play between command and actuator, and a limit of its rate.

The last two have a state with the time constant :data:`TAU`, which a fit keeps.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Shape

#: Time constant of these states [s]: small against what a log of some 100 Hz shows.
TAU = 0.001


def play(command: sp.Expr, width: sp.Expr, tau: sp.Expr, state: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the output of play of total width d, and the derivative of its memory z.

    The actuator y lies within half the width of the command c, and rests while it does:

        y = max(c - d/2, min(c + d/2, z)),    z' = (y - z)/tau.

    y follows its command at once: only the memory has the lag tau, so there is no delay.
    """
    acting = sp.Max(command - width / 2, sp.Min(command + width / 2, state))
    return acting, (acting - state) / tau


def clipped(command: sp.Expr, lower: sp.Expr | None, upper: sp.Expr | None) -> sp.Expr:
    """Return a command kept between two limits; None stands for no limit."""
    below = command if upper is None else sp.Min(command, upper)
    return below if lower is None else sp.Max(below, lower)


def limited_rate(command: sp.Expr, limit: sp.Expr, tau: sp.Expr, state: sp.Expr) -> sp.Expr:
    """Return the derivative of a state that follows a command at a limited rate."""
    return sp.Max(-limit, sp.Min(limit, (command - state) / tau))


class _Backlash(Effect):
    def played(self, c: Any, s: Any, name: str, command: sp.Expr) -> tuple[Signal, sp.Expr, sp.Expr]:
        """Return the memory of the play, at rest at zero, the output, and the memory's derivative."""
        state = Signal(f"{name}_played", s.units[name], f"{name} behind its play")
        return state, *play(command, c.width, c.tau, state.symbol)


class _RateLimit(Effect):
    def limited(self, c: Any, s: Any, name: str, command: sp.Expr) -> tuple[Signal, sp.Expr]:
        """Return the actuator's state and its derivative, from rest at zero."""
        state = Signal(f"{name}_rate_limited", s.units[name], f"{name} behind the limit of its rate")
        return state, limited_rate(command, c.limit, c.tau, state.symbol)


class ThrustBacklash(_Backlash):
    """Play between command and thrust (hysteresis): it rests while within half the width of its command."""

    name, source, order = "thrust_backlash", "Nordin and Gutman, Automatica 38 (2002)", 5
    width = Shape("{thrust}", lower=0.0, neutral=0.0, search=(0.05, 0.15, 0.4), of="input")
    tau = Shape("s", lower=TINY, default=TAU, fixed=True)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        states = {}
        for name, command in s.thrusts.items():
            state, s.thrusts[name], states[state] = self.played(c, s, name, command)
        return states


class RudderBacklash(_Backlash):
    """Play of the rudder's linkage (hysteresis): it rests while within half the width of its command."""

    name, source, order, craft = "rudder_backlash", "Nordin and Gutman, Automatica 38 (2002)", 5, "rudder"
    width = Shape("rad", lower=0.0, neutral=0.0, search=(0.04, 0.12, 0.35))
    tau = Shape("s", lower=TINY, default=TAU, fixed=True)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        state, s.rudder, slope = self.played(c, s, "rudder", s.rudder)
        return {state: slope}


class ThrustRateLimit(_RateLimit):
    """Thrust that changes no faster than a limit per second."""

    name, source, order = "thrust_rate_limit", "ramp of a motor's controller", 4
    limit = Shape("{thrust}/s", lower=TINY, search=(0.5, 1.5, 5.0), of="input")
    tau = Shape("s", lower=TINY, default=TAU, fixed=True)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        states = {}
        for name, command in s.thrusts.items():
            state, slope = self.limited(c, s, name, command)
            states[state], s.thrusts[name] = slope, state.symbol
        return states


class RudderRateLimit(_RateLimit):
    """A rudder that turns no faster than a limit."""

    name, source, order, craft = "rudder_rate_limit", "speed of a servo under load", 4, "rudder"
    limit = Shape("rad/s", lower=TINY, search=(0.5, 1.5, 5.0))
    tau = Shape("s", lower=TINY, default=TAU, fixed=True)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        state, slope = self.limited(c, s, "rudder", s.rudder)
        s.rudder = state.symbol
        return {state: slope}
