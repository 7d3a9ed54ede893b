"""K06's actuators: from the force that a law commands to the force on the craft.

In the order of the signals: :func:`force_command` (dead zone, polar coordinates), :func:`rudder_lookup` and
:func:`thrust_lookup` (calibration tables), then, where they act, :func:`rudder_servo`,
:func:`speed_controller`, :func:`fan_motor` and :func:`thrust_force`, whose outputs the plant takes. Each is a
Block of its own; :func:`actuators` returns all of them for a loop.
:func:`variable_pitch_propeller` replaces fan and speed controller, as K06 chapter 7 suggests.
"""

from hovercontrol.craft.hardware.actuators.chain import Actuators, actuators
from hovercontrol.craft.hardware.actuators.command import force_command
from hovercontrol.craft.hardware.actuators.k06 import (
    fan_force,
    fan_tables,
    force_angle_of_rudder,
    forward_thrust,
    ideal_fan,
    ideal_servo,
    reverse_ratio,
    rudder_of_force_angle,
    servo_table,
)
from hovercontrol.craft.hardware.actuators.measured import read_servo_table, table_pair, with_reverse
from hovercontrol.craft.hardware.actuators.pitch import (
    VariablePitch,
    blade_element,
    pitch_lookup,
    pitch_servo,
    pitch_thrust,
    variable_pitch_propeller,
)
from hovercontrol.craft.hardware.actuators.regulator import battery_fan, speed_regulator
from hovercontrol.craft.hardware.actuators.rudder import rudder_lookup, rudder_servo
from hovercontrol.craft.hardware.actuators.speed import fan_motor, speed_controller
from hovercontrol.craft.hardware.actuators.tables import FanTable, ServoTable, read_fan_table
from hovercontrol.craft.hardware.actuators.thrust import thrust_force, thrust_lookup

__all__ = [
    "battery_fan",
    "speed_regulator",
    "actuators",
    "Actuators",
    "force_command",
    "rudder_lookup",
    "thrust_lookup",
    "rudder_servo",
    "speed_controller",
    "fan_motor",
    "thrust_force",
    "VariablePitch",
    "variable_pitch_propeller",
    "pitch_lookup",
    "pitch_servo",
    "pitch_thrust",
    "blade_element",
    "FanTable",
    "ServoTable",
    "read_fan_table",
    "read_servo_table",
    "table_pair",
    "with_reverse",
    "fan_tables",
    "servo_table",
    "ideal_fan",
    "ideal_servo",
    "fan_force",
    "forward_thrust",
    "reverse_ratio",
    "rudder_of_force_angle",
    "force_angle_of_rudder",
]
