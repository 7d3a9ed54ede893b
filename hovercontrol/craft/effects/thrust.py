"""Forces of the actuators: a propeller with a rudder [C17 eq 9, 10], or fixed fans."""

from __future__ import annotations

import math
from typing import Any

import sympy as sp

from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient, Shape


# [K06 eq 2.6]
class Thrust(Effect):
    """Force of the propeller, turned by the rudder: c T cos(theta) in surge, c T sin(theta) in sway."""

    name, source, craft = "thrust", "C17 (9), c7 = b_T/m", "rudder"
    drives = True
    value = Coefficient("m/s^2/{thrust}", lower=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"u": c.value * s.thrust_x, "v": c.value * s.thrust_y}


class RudderTorque(Effect):
    """Torque of the rudder's side force on its arm: -c T sin(theta) in yaw [K06 eq 2.9]."""

    name, source, craft = "rudder_torque", "C17 (10), c8 = a b_T/J", "rudder"
    drives = True
    value = Coefficient("rad/s^2/{thrust}")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": -c.value * s.thrust_y}


class ThrustYawTorque(Effect):
    """Torque of a thrust line that passes beside the centre of mass: c T in yaw."""

    name, source = "thrust_yaw_torque", "Euler; c = offset of the thrust line times b_T/J"
    craft = "rudder"
    value = Coefficient("rad/s^2/{thrust}")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": c.value * s.thrust}


class ThrustRudderLoss(Effect):
    """Thrust and rudder torque that fall with the rudder angle: times (1 - c theta^2)."""

    name, source, craft = "thrust_rudder_loss", "second order of a deflected jet's loss", "rudder"
    value = Coefficient("1/{rudder}^2", lower=0.0)

    def motion(self, c: Any, s: Any) -> None:
        left = 1 - c.value * s.rudder**2
        s.thrust_x, s.thrust_y = left * s.thrust_x, left * s.thrust_y


class RudderDamping(Effect):
    """Damping of yaw by the rudder in the propeller's stream: -c T r."""

    name, source = "rudder_damping", "first order of the angle of attack that yaw adds at the rudder"
    craft = "rudder"
    value = Coefficient("1/s/{thrust}", lower=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": -c.value * s.thrust * s.r}


class FanForce(Effect):
    """Sum of the fans' forces, each in its direction, per mass."""

    name, source, craft = "fan_force", "Newton; c = 1/m times the fans' effectiveness", "fan"
    drives = True
    value = Coefficient("m/s^2/N", lower=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"u": c.value * s.fan_x, "v": c.value * s.fan_y}


class FanTorque(Effect):
    """Sum of the fans' torques about the centre of mass, per inertia."""

    name, source, craft = "fan_torque", "Euler; c = 1/J times the fans' effectiveness", "fan"
    drives = True
    value = Coefficient("rad/s^2/(N*m)", lower=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": c.value * s.fan_torque}


class FanMisalignment(Effect):
    """Fans that all push turned by one angle from where they should, each at its own place."""

    name, source, craft = "fan_misalignment", "rotation of a force about its own point of attack", "fan"
    turns_fans = True
    value = Shape("rad", lower=-math.pi / 2, upper=math.pi / 2, neutral=0.0, search=(0.05,))

    def motion(self, c: Any, s: Any) -> None:
        cos, sin = sp.cos(c.value), sp.sin(c.value)
        s.fan_x, s.fan_y = s.fan_x * cos - s.fan_y * sin, s.fan_x * sin + s.fan_y * cos
        s.fan_torque, s.fan_cross_torque = (
            s.fan_torque * cos + s.fan_cross_torque * sin,
            s.fan_cross_torque * cos - s.fan_torque * sin,
        )
