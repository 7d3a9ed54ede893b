"""Shared parts of sensors: checks of numbers, switches, limits and rounding."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite, not_negative, positive
from hovercontrol.blocks.signals import Signal

#: One tick of K06's inertial measurement unit [s] (section 5.4.1).
IMU_TICK = 0.0065536


def pair(where: str, value: Sequence[float]) -> tuple[float, float]:
    """Return two finite numbers."""
    if not hasattr(value, "__len__") or len(value) != 2:
        raise InputError(f"{where}: expected two numbers, found {value!r}")
    return finite(where, value[0]), finite(where, value[1])


def size(name: str, unit: str, description: str, where: str, value: float) -> Signal:
    """Return a parameter that is not negative; 0 switches its error off."""
    start = not_negative(f"{where}: {name}", value)
    return Signal(name, unit, description, start=start, nominal=start or 1.0, lower=0.0)


def offset(name: str, unit: str, description: str, where: str, value: float) -> Signal:
    """Return a parameter of either sign."""
    return Signal(name, unit, description, start=finite(f"{where}: {name}", value))


def switch(name: str, description: str, on: bool = True) -> Signal:
    """Return a parameter that is ``off`` (0) or ``on`` (1)."""
    return Signal(name, "1", description, start=float(on), modes=("off", "on"))


def tick(where: str, period: float) -> Signal:
    """Return a sampled Block's period as a constant with a unit, for rates and random walks."""
    seconds = positive(f"{where}: period", period)
    return Signal("period", "s", "of the ticks, fixed", start=seconds, lower=seconds, upper=seconds)


def limited(value: sp.Expr, limit: sp.Symbol) -> sp.Expr:
    """Return a value limited to plus and minus a limit; 0 is no limit."""
    return sp.Piecewise((sp.Max(-limit, sp.Min(limit, value)), limit > 0), (value, True))


def rounded(value: sp.Expr, step: sp.Symbol) -> sp.Expr:
    """Return a value rounded to a multiple of a step; 0 is no rounding."""
    # Mod, not floor(value / step): 1 / step is not computed where the step is 0.
    above = value + step / 2
    return sp.Piecewise((above - sp.Mod(above, step), step > 0), (value, True))


def turned(angle: sp.Expr, x: sp.Expr, y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return a vector given in body axes, turned into earth axes at a heading."""
    cos, sin = sp.cos(angle), sp.sin(angle)
    return cos * x - sin * y, sin * x + cos * y
