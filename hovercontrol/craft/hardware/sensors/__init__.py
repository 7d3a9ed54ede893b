"""Sensors as sampled Blocks, every error a parameter that can be switched off (K06 chapters 3, 5 and 6).

* :mod:`.motion`: specific force, derived from a plant; :mod:`.inertial`: accelerometers and gyro;
  :mod:`.gyro`: the gyro's dynamics and their compensation
* :mod:`.magnetometer`: the field and its heading
* :mod:`.beacons`, :mod:`.ranging`, :mod:`.cone`: ultrasonic ranges and their correction; :mod:`.bancroft`,
  :mod:`.cricket`, :mod:`.two_units`: positions from ranges, and the heading from two units
* :mod:`.mocap`: motion capture; :mod:`.poor_view`: a part of the floor with poor measurements
* :mod:`.arrivals`: pulses for readers that are faster than the sensor
"""

from hovercontrol.craft.hardware.sensors.arrivals import arrivals
from hovercontrol.craft.hardware.sensors.bancroft import locate, range_solver
from hovercontrol.craft.hardware.sensors.beacons import Beacons, k06_beacons
from hovercontrol.craft.hardware.sensors.cone import cone_correction, corrected_range
from hovercontrol.craft.hardware.sensors.cricket import cricket, cricket_fixes, k06_cricket
from hovercontrol.craft.hardware.sensors.gyro import gyro_compensation, gyro_dynamics
from hovercontrol.craft.hardware.sensors.inertial import imu, k06_imu
from hovercontrol.craft.hardware.sensors.magnetometer import k06_magnetometer, magnetic_heading, magnetometer
from hovercontrol.craft.hardware.sensors.mocap import mocap, noisy_motion
from hovercontrol.craft.hardware.sensors.motion import with_specific_force
from hovercontrol.craft.hardware.sensors.poor_view import poor_view
from hovercontrol.craft.hardware.sensors.ranging import cricket_ranges
from hovercontrol.craft.hardware.sensors.sound import speed_of_sound
from hovercontrol.craft.hardware.sensors.two_units import two_unit_heading

__all__ = [
    "with_specific_force",
    "imu",
    "k06_imu",
    "gyro_dynamics",
    "gyro_compensation",
    "magnetometer",
    "k06_magnetometer",
    "magnetic_heading",
    "Beacons",
    "k06_beacons",
    "cricket",
    "k06_cricket",
    "cricket_ranges",
    "cricket_fixes",
    "range_solver",
    "cone_correction",
    "corrected_range",
    "locate",
    "speed_of_sound",
    "two_unit_heading",
    "arrivals",
    "mocap",
    "noisy_motion",
    "poor_view",
]
