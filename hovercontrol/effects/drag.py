"""Drag in surge, sway and yaw: dry (Coulomb) and linear. C17 equations (9)-(10)."""

from __future__ import annotations

from typing import Any, ClassVar

import sympy as sp

from hovercontrol.effects.base import TINY, Coefficient, Effect, Shape
from hovercontrol.sgn import sgn


class _Coulomb(Effect):
    """-c sgn(w) in the equation of its axis."""

    axis: ClassVar[str]

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.axis: -c.value * sgn(getattr(s, self.axis), c.width)}


class _Linear(Effect):
    """-c w in the equation of its axis."""

    axis: ClassVar[str]

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.axis: -c.value * getattr(s, self.axis)}


class SurgeCoulomb(_Coulomb):
    """Dry friction against surge, of constant size."""

    name, axis, source = "surge_coulomb", "u", "C17 (9), c1 = d_u0/m"
    value = Coefficient("m/s^2", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01)


class SwayCoulomb(_Coulomb):
    """Dry friction against sway, of constant size."""

    name, axis, source = "sway_coulomb", "v", "C17 (9), c3 = d_v0/m"
    value = Coefficient("m/s^2", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01)


class YawCoulomb(_Coulomb):
    """Dry friction against yaw, a torque of constant size."""

    name, axis, source = "yaw_coulomb", "r", "C17 (10), c5 = d_r0/J"
    value = Coefficient("rad/s^2", lower=0.0)
    width = Shape("rad/s", lower=TINY, default=0.01)


class SurgeLinearDrag(_Linear):
    """Drag in proportion to the surge velocity."""

    name, axis, source = "surge_linear_drag", "u", "C17 (9), c2 = d_u/m"
    value = Coefficient("1/s", lower=0.0)


class SwayLinearDrag(_Linear):
    """Drag in proportion to the sway velocity."""

    name, axis, source = "sway_linear_drag", "v", "C17 (9), c4 = d_v/m"
    value = Coefficient("1/s", lower=0.0)


class YawLinearDrag(_Linear):
    """Drag torque in proportion to the yaw rate."""

    name, axis, source = "yaw_linear_drag", "r", "C17 (10), c6 = d_r/J"
    value = Coefficient("1/s", lower=0.0)
