"""Drag in surge, sway and yaw: dry (Coulomb, Stribeck), linear, quadratic [C17 eq 9, 10]."""

from __future__ import annotations

from typing import Any, ClassVar

import sympy as sp

from hovercontrol.core.sgn import sgn
from hovercontrol.effects.base import TINY, Coefficient, Effect, Shape


class Drag(Effect):
    """Drag along one axis, against the velocity ``axis``; relative to the air if ``in_air``."""

    axis: ClassVar[str]
    in_air: ClassVar[bool] = False

    def velocity(self, s: Any) -> sp.Expr:
        """Return the velocity that the drag acts against."""
        return getattr(s, f"air_{self.axis}" if self.in_air and self.axis != "r" else self.axis)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.axis: -c.value * self.law(c, self.velocity(s))}

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        """Return the drag per coefficient at velocity `w`."""
        raise TypeError(f"{type(self).__name__} does not define its law")


class _Coulomb(Drag):
    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sgn(w, c.width)


class _Linear(Drag):
    in_air = True

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return w


class _Quadratic(Drag):
    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sp.Abs(w) * w


class _Cubic(Drag):
    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return w**3


class _Stribeck(Drag):
    contains = (_Coulomb,)

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sgn(w, c.width) * sp.exp(-((w / c.speed) ** 2))


class AirDrag(Effect):
    """Quadratic drag of the air against the velocity as a whole: -c V (u, v), V the speed through the air."""

    name, source = "air_drag", "Fossen, Handbook of Marine Craft, 2nd ed., 8.1: equal areas, one coefficient"
    mistaken_for = ("surge_quadratic_drag", "sway_quadratic_drag", "added_mass_coriolis")
    value = Coefficient("1/m", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01, fixed=True)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        speed = sp.sqrt(s.air_u**2 + s.air_v**2 + c.width**2)  # smooth at rest
        return {"u": -c.value * speed * s.air_u, "v": -c.value * speed * s.air_v}


class SurgeCoulomb(_Coulomb):
    """Dry friction against surge, a force of constant size."""

    name, axis, source = "surge_coulomb", "u", "C17 (9), c1 = d_u0/m"
    value = Coefficient("m/s^2", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01)


class SwayCoulomb(_Coulomb):
    """Dry friction against sway, a force of constant size."""

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


class SurgeQuadraticDrag(_Quadratic):
    """Drag in proportion to the square of the surge velocity."""

    name, axis, source = "surge_quadratic_drag", "u", "Fossen, Handbook of Marine Craft, 2nd ed., 6.4"
    value = Coefficient("1/m", lower=0.0)


class SwayQuadraticDrag(_Quadratic):
    """Drag in proportion to the square of the sway velocity."""

    name, axis, source = "sway_quadratic_drag", "v", "Fossen, Handbook of Marine Craft, 2nd ed., 6.4"
    value = Coefficient("1/m", lower=0.0)


class YawQuadraticDrag(_Quadratic):
    """Drag torque in proportion to the square of the yaw rate."""

    name, axis, source = "yaw_quadratic_drag", "r", "Fossen, Handbook of Marine Craft, 2nd ed., 6.4"
    value = Coefficient("1/rad", lower=0.0)


class SurgeStribeck(_Stribeck):
    """Dry friction in surge that is larger at low speed and fades at about ``speed``."""

    name, axis, source = "surge_stribeck", "u", "Armstrong-Helouvry et al., Automatica 30 (1994)"
    value = Coefficient("m/s^2", lower=0.0)
    speed = Shape("m/s", lower=TINY, default=0.2, search=(0.05, 0.12, 0.3, 0.8), of="speed")
    width = Shape("m/s", lower=TINY, default=0.01)


class SwayStribeck(_Stribeck):
    """Dry friction in sway that is larger at low speed and fades at about ``speed``."""

    name, axis, source = "sway_stribeck", "v", "Armstrong-Helouvry et al., Automatica 30 (1994)"
    value = Coefficient("m/s^2", lower=0.0)
    speed = Shape("m/s", lower=TINY, default=0.2, search=(0.05, 0.12, 0.3, 0.8), of="speed")
    width = Shape("m/s", lower=TINY, default=0.01)


class YawStribeck(_Stribeck):
    """Dry friction in yaw that is larger at low speed and fades at about ``speed``."""

    name, axis, source = "yaw_stribeck", "r", "Armstrong-Helouvry et al., Automatica 30 (1994)"
    value = Coefficient("rad/s^2", lower=0.0)
    speed = Shape("rad/s", lower=TINY, default=0.5, search=(0.05, 0.12, 0.3, 0.8), of="speed")
    width = Shape("rad/s", lower=TINY, default=0.01)


class SurgeCubicDrag(_Cubic):
    """Drag in proportion to the third power of the surge velocity."""

    name, axis, source = "surge_cubic_drag", "u", "Abkowitz, HyA Report Hy-5 (1964): X_uuu"
    mistaken_for = ("surge_quadratic_drag", "surge_stribeck")
    value = Coefficient("s/m^2", lower=0.0)


class SwayCubicDrag(_Cubic):
    """Drag in proportion to the third power of the sway velocity."""

    name, axis, source = "sway_cubic_drag", "v", "Abkowitz, HyA Report Hy-5 (1964): Y_vvv"
    mistaken_for = ("sway_quadratic_drag", "sway_stribeck")
    value = Coefficient("s/m^2", lower=0.0)


class YawCubicDrag(_Cubic):
    """Drag torque in proportion to the third power of the yaw rate."""

    name, axis, source = "yaw_cubic_drag", "r", "Abkowitz, HyA Report Hy-5 (1964): N_rrr"
    mistaken_for = ("yaw_quadratic_drag", "yaw_stribeck")
    value = Coefficient("s/rad^2", lower=0.0)
