"""The signals between the parts of K06's actuation, in order.

Shaft speeds are in rad/s and pulses in seconds, as everywhere inside; tables are in the units of their files
(RPM, ms, degrees).
"""

from __future__ import annotations

import math

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.ticks import Clock

#: One revolution per minute [rad/s].
RPM = 2 * math.pi / 60
#: One millisecond [s], the unit of servo pulses.
MILLISECOND = 1e-3
DEGREE = math.pi / 180

FORCE_X = Signal("force_x", "N", "commanded force along the bow")
FORCE_Y = Signal("force_y", "N", "commanded force to the left, at the rudder")
THRUST_COMMAND = Signal("thrust_command", "N", "commanded force of the fan, negative astern")
FORCE_ANGLE_COMMAND = Signal("force_angle_command", "rad", "commanded angle of the force from the bow")
RUDDER_ANGLE_COMMAND = Signal("rudder_angle_command", "rad", "commanded rudder angle", nominal=0.5)
SERVO_COMMAND = Signal(
    "servo_command", "s", "width of the servo's pulse", start=1.5 * MILLISECOND, nominal=MILLISECOND
)
FAN_SPEED_COMMAND = Signal(
    "fan_speed_command", "rad/s", "commanded fan speed, negative in reverse", nominal=1e3
)
FAN_SPEED_SET = Signal("fan_speed_set", "rad/s", "fan speed set by the speed controller", nominal=1e3)
FAN_SPEED = Signal("fan_speed", "rad/s", "fan speed, negative in reverse", nominal=1e3)
RUDDER_ANGLE = Signal("rudder_angle", "rad", "angle of the rudder", nominal=0.5)

#: K06's base tick and the period of servos and speed controllers [s].
TICK, UPDATE = 0.001, 0.02


def whole_ticks(where: str, seconds: float, period: float) -> int:
    """Return the number of ticks in a time.

    Raises
    ------
    InputError
        If the time is negative or not a multiple of the period.

    Examples
    --------
    >>> whole_ticks("demo: brake", 0.15, 0.001)
    150
    """
    not_negative(where, seconds)
    clock = Clock([seconds, period])
    ticks, rest = divmod(clock.count(seconds), clock.count(period))
    if rest:
        raise InputError(f"{where} must be a multiple of the period {period:g} s, found {seconds:g} s")
    return ticks
