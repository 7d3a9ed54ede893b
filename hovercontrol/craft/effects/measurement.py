"""Measurement effects: biases, scales, places and clocks of sensors."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import time
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient, Shape


class SensorLeverArm(Effect):
    """Velocities measured at a point ahead of the centre of mass: v + l r."""

    name, source, order = "sensor_lever_arm", "kinematics of a rigid body", 1
    value = Coefficient("m")

    def measured(self, c: Any, s: Any) -> None:
        s.v = s.v + c.value * s.true.r


class PoseLeverArm(Effect):
    """A tracked point that lies off the centre of mass: measured (x, y) = centre + R(psi) (lx, ly)."""

    name, source, order = "pose_lever_arm", "kinematics of a rigid body", 1
    x = Coefficient("m", default=0.0)
    y = Coefficient("m", default=0.0)

    def measured(self, c: Any, s: Any) -> None:
        cos, sin = sp.cos(s.true.psi), sp.sin(s.true.psi)
        s.x, s.y = s.x + c.x * cos - c.y * sin, s.y + c.x * sin + c.y * cos


class VelocityMisalignment(Effect):
    """A velocity sensor turned on the hull: measured (u, v) are turned by minus its angle."""

    name, source, order = "velocity_misalignment", "rotation of axes", 2
    value = Shape("rad", neutral=0.0, search=(0.01,))

    def measured(self, c: Any, s: Any) -> None:
        cos, sin = sp.cos(c.value), sp.sin(c.value)
        s.u, s.v = s.u * cos + s.v * sin, -s.u * sin + s.v * cos


class GyroBias(Effect):
    """A gyro that is off by a constant rate: r + b."""

    name, source, order = "gyro_bias", "K06 (5.12)", 3
    value = Coefficient("rad/s")

    def measured(self, c: Any, s: Any) -> None:
        s.r = s.r + c.value


class GyroScale(Effect):
    """A gyro with a wrong scale: (1 + s) r."""

    name, source, order = "gyro_scale", "K06 (5.12)", 3
    value = Coefficient("1")

    def measured(self, c: Any, s: Any) -> None:
        s.r = s.r + c.value * s.true.r


class GyroDrift(Effect):
    """A gyro whose error grows with time: r + d t, t from the start of each log."""

    name, source, order = "gyro_drift", "first order of a gyro that warms up", 3
    mistaken_for = ("gyro_bias", "gyro_scale")
    value = Coefficient("rad/s^2")

    def measured(self, c: Any, s: Any) -> None:
        s.r = s.r + c.value * time


class TimeOffset(Effect):
    """Measurements whose clock is late against the commands' clock."""

    name, source, order = "time_offset", "two clocks that were not set together", 4
    shifts_time = True
    seconds = Shape("s", neutral=0.0, search=(-0.15, -0.06, -0.02, 0.02, 0.06, 0.15))

    def measured(self, c: Any, s: Any) -> None:
        s.late = c.seconds  # of all channels: a plant that runs by their clock acts that late
