"""Effects between commands and forces: delay, lag, dead zone, saturation, sag, offset.

They act in this order: delay, bend of the static curve, lag, limit of the rate, play, dead zone, saturation,
sag, loss in reverse, offset. On a fan craft those of the thrust act on the force of each fan.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.actuator import clipped
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape


class _Delay(Effect):
    shifts_time = True

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.delay = c.seconds  # of all commands: becomes the plant's `delays`
        return {}


class InputDelay(_Delay):
    """Commands that act late by a fixed time; before the beginning they were zero."""

    name, source, order, craft = "input_delay", "transport delay of a radio link", 1, "rudder"
    seconds = Shape("s", lower=0.0, neutral=0.0, search=(0.02, 0.06, 0.15))


class FanDelay(_Delay):
    """Fans that act late by a fixed time; before the beginning they stood still."""

    name, source, order, craft = "fan_delay", "transport delay of a radio link", 1, "fan"
    instead_of = "input_delay"
    seconds = Shape("s", lower=0.0, neutral=0.0, search=(0.01, 0.02, 0.06, 0.15))


def _lagged(c: Any, s: Any, name: str, command: sp.Expr, unit: str = "") -> tuple[Signal, sp.Expr]:
    """Return the state of a lag and its derivative."""
    state = Signal(f"{name}_lagged", unit or s.units[name], f"{name} behind its lag")
    return state, (command - state.symbol) / c.seconds


class _ThrustLag(Effect):
    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        states = {}
        for name, command in s.thrusts.items():
            state, slope = _lagged(c, s, name, command)
            states[state], s.thrusts[name] = slope, state.symbol
        return states


class ThrustLag(_ThrustLag):
    """Thrust that follows its command with a lag of first order, from rest."""

    name, source, order, craft = "thrust_lag", "first order of a motor and its propeller", 3, "rudder"
    seconds = Shape("s", lower=TINY, neutral=0.0, search=(0.05, 0.15, 0.4))


class FanLag(_ThrustLag):
    """Force of each fan that follows its command with a lag of first order, from rest; one time for all."""

    name, source, order, craft = "fan_lag", "first order of a motor and its fan", 3, "fan"
    instead_of = "thrust_lag"
    seconds = Shape("s", lower=TINY, neutral=0.0, search=(0.03, 0.1, 0.3))


class FanSignalLag(Effect):
    """Signal of each fan that its speed follows with a lag of first order, before the static curve.

    A motor's speed lags, and its force follows the speed by the static curve: :class:`FanLag` acts on the
    force. Without a curve the two are the same. A search considers it only where it is named: logs of real
    fans hardly tell the two apart.
    """

    name, source, order, craft = "fan_signal_lag", "first order of a motor's speed", 3, "fan"
    before_curve, by_name = True, True
    seconds = Shape("s", lower=TINY, neutral=0.0, search=(0.03, 0.1, 0.3))

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        states = {}
        for name, command in s.thrusts.items():
            state, slope = _lagged(c, s, f"{name}_signal", command, s.units[name])
            states[state], s.thrusts[name] = slope, state.symbol
        return states


class RudderLag(Effect):
    """A rudder that follows its command with a lag of first order, from rest."""

    name, source, order, craft = "rudder_lag", "first order of a servo", 3, "rudder"
    seconds = Shape("s", lower=TINY, neutral=0.0, search=(0.05, 0.15, 0.4))

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        state, slope = _lagged(c, s, "rudder", s.rudder)
        s.rudder = state.symbol
        return {state: slope}


def bent(T: sp.Expr, c: Any) -> sp.Expr:
    """Return T (1 + b (1 - abs(T)/S)) up to the scale S, and T beyond."""
    return T * (1 + c.value * sp.Max(0, 1 - sp.Abs(T) / c.scale))


class ThrustCurve(Effect):
    """Another bend of the static curve: T (1 + b (1 - abs(T)/S)) up to the scale S, T itself beyond.

    Zero at zero, unchanged at S, and monotone for every b within its bounds. S is not fitted: give the
    largest thrust.
    """

    name, source, order = "thrust_curve", "second order of a static curve, its ends held", 2
    value = Coefficient("1", lower=-1.0, upper=1.0)
    scale = Shape("{thrust}", lower=TINY, default=1.0, search=(1.0,), of="input", fixed=True)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        for name, T in s.thrusts.items():
            s.thrusts[name] = bent(T, c)
        return {}


class ThrustDeadzone(Effect):
    """Small thrust commands that do nothing: max(0, T - d), odd in T."""

    name, source, order = "thrust_deadzone", "static friction of a motor", 6
    width = Shape("{thrust}", lower=0.0, neutral=0.0, search=(0.05, 0.1, 0.2, 0.3), of="input")

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        for name, T in s.thrusts.items():
            s.thrusts[name] = sp.Max(0, T - c.width) - sp.Max(0, -T - c.width)
        return {}


class ThrustSaturation(Effect):
    """Thrust that does not grow beyond a limit: min(T, s), odd in T."""

    name, source, order = "thrust_saturation", "limit of a supply's current", 7
    limit = Shape("{thrust}", lower=TINY, search=(0.5, 0.65, 0.8, 0.9), of="input")

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        for name, T in s.thrusts.items():
            s.thrusts[name] = clipped(T, -c.limit, c.limit)
        return {}


class BatterySag(Effect):
    """Thrust that fades with time: T (1 - c t), t from the start of each log."""

    name, source, order = "battery_sag", "first order of a battery that empties", 8
    value = Coefficient("1/s", lower=0.0)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        for name, T in s.thrusts.items():
            s.thrusts[name] = T * (1 - c.value * s.time)
        return {}


class FanCrosstalk(Effect):
    """Force of each fan that falls with the others': F_i (1 - c sum of abs(F_j), j not i)."""

    name, source, order, craft = "fan_crosstalk", "first order of a supply that all fans share", 8, "fan"
    value = Coefficient("1/{thrust}")

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        sizes = {name: sp.Abs(F) for name, F in s.thrusts.items()}
        total = sp.Add(*sizes.values())
        for name, F in s.thrusts.items():
            s.thrusts[name] = F * (1 - c.value * (total - sizes[name]))
        return {}


class ReverseThrustLoss(Effect):
    """Thrust backward that is weaker than forward: times (1 - c) where T < 0."""

    name, source, order = "reverse_thrust_loss", "K06 (4.4): a propeller that turns backward", 9
    value = Coefficient("1", lower=0.0, upper=1.0)

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        for name, T in s.thrusts.items():
            s.thrusts[name] = T - c.value * sp.Min(T, 0)
        return {}


class RudderOffset(Effect):
    """A rudder with a constant offset from its command."""

    name, source, order, craft = "rudder_offset", "misadjusted linkage", 10, "rudder"
    value = Coefficient("rad")

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.rudder = s.rudder + c.value
        return {}
