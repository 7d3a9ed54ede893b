"""The imperfections that distinguish the real loop from the ideal one, by name, with their switches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.blocks.block import Block

#: For each imperfection the parameters of the loop that are zero without it. Parameters that a loop lacks are
#: ignored.
SWITCHES: dict[str, tuple[str, ...]] = {
    "gyro_dynamics": ("gyro_dynamics.dynamics",),
    "ins_bias": (
        "navigation.acceleration_bias",
        "navigation.gyro_bias",
        "imu.acceleration_bias_spread",
        "imu.yaw_rate_bias_spread",
    ),
    "ins_noise": (
        "navigation.gyro_noise",
        "imu.acceleration_noise",
        "imu.yaw_rate_noise",
        "magnetometer.noise",
        "position_fix.noise",
    ),
    "gyro_range": ("imu.yaw_rate_limit", "imu.acceleration_limit"),
    "ins_update": ("ins_update.on",),
    "downlink_delay": ("downlink_delay.on",),
    "dead_zone": ("command_polar.dead_zone",),
    "saturation": ("saturation.on",),
    "tables": ("tables.on", "calibration.on"),
    "uplink_delay": ("uplink_delay.on",),
    "update_20ms": ("update_20ms.on",),
    "brake": ("speed_controller.brake", "pitch_servo.lag"),
}


@checked
@dataclass(frozen=True)
class Imperfections:
    """Which imperfections a loop has; the default is K06's simulated autopilot (section 6.1.1).

    Parameters
    ----------
    gyro_dynamics : bool, optional
        The gyro's lag (6.2), uncompensated. K06's simulation has none, because its autopilot compensates it.
    ins_bias : bool, optional
        The remaining biases of the inertial sensors.
    ins_noise : bool, optional
        Noise of the inertial sensors and of the navigation's aids.
    gyro_range : bool, optional
        The inertial sensors' full scale: 300 deg/s, less than the 6.4 rad/s of the stop trial's start.
    ins_update : bool, optional
        The navigation outputs the motion at the IMU's ticks. Without it the law receives the motion at its
        own ticks, plus the errors of the navigation.
    downlink_delay : bool, optional
        Delay of 6 times 6 ms from the craft to the law.
    dead_zone : bool, optional
        Forces of 0.05 N or less count as zero.
    saturation : bool, optional
        The force and its angle are limited to the ranges of fan and rudder.
    tables : bool, optional
        Lookup tables convert forces to commands and commands to forces. They are limited to their own range
        even without the saturation.
    uplink_delay : bool, optional
        Delay of 2 times 20 ms from the law to the craft; without it a delay of one base tick remains.
    update_20ms : bool, optional
        Servo and speed controller read their commands every 20 ms.
    brake : bool, optional
        The speed controller brakes for 150 ms on a change from reverse to forward; for a variable-pitch
        propeller, the lag of its pitch.

    Examples
    --------
    >>> Imperfections.only("brake").names
    ('brake',)
    """

    gyro_dynamics: bool = False
    ins_bias: bool = True
    ins_noise: bool = True
    gyro_range: bool = True
    ins_update: bool = True
    downlink_delay: bool = True
    dead_zone: bool = True
    saturation: bool = True
    tables: bool = True
    uplink_delay: bool = True
    update_20ms: bool = True
    brake: bool = True

    @classmethod
    def only(cls, *names: str) -> Imperfections:
        """Return only the named imperfections; none without a name.

        Parameters
        ----------
        *names : str
            Keys of :data:`SWITCHES`.

        Raises
        ------
        InputError
            If a name is unknown; the message names the nearest.
        """
        _check(names)
        return cls(**{name: name in names for name in SWITCHES})

    def without(self, *names: str) -> Imperfections:
        """Return these imperfections without the named ones; errors as for :meth:`only`.

        Parameters
        ----------
        *names : str
            Keys of :data:`SWITCHES`.
        """
        _check(names)
        return Imperfections.only(*(name for name in self.names if name not in names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the imperfections that are switched on, in the order of the loop."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name))

    def parameters(self, loop: Block) -> dict[str, float]:
        """Return the parameter values, by key, that give a loop these imperfections without a rebuild.

        Parameters
        ----------
        loop : Block
            Result of :func:`~hovercontrol.control.autopilot.autopilot`. An imperfection that is switched on
            has the size that the loop was built with, which is zero if the loop was built without it.
        """
        known, values = loop.default_parameters, {}
        for name, keys in SWITCHES.items():
            for key in (key for key in keys if key in known):
                there = getattr(self, name)
                switch = loop.parameter(key).modes
                values[key] = (1.0 if switch else known[key]) if there else 0.0
        return values


def _check(names: Iterable[str]) -> None:
    for name in names:
        check_known(name, SWITCHES, f"unknown imperfection {name!r}")
