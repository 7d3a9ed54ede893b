"""What the real loop has that the ideal one has not: each imperfection by name, with its switch."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError, did_you_mean

#: Of each imperfection the parameters of the loop that are zero without it; those that a loop has not do not
#: matter.
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
        The gyro's lag (6.2), uncompensated. K06's simulation has none, its autopilot compensates it.
    ins_bias : bool, optional
        What is left of the inertial sensors' biases.
    ins_noise : bool, optional
        Noise of the gyro and of what aids the navigation.
    gyro_range : bool, optional
        The inertial sensors' full scale: 300 deg/s, less than the 6.4 rad/s of the stop trial's start.
    ins_update : bool, optional
        Navigation tells the motion at the IMU's ticks; without it the law sees the motion of its own ticks,
        plus the errors of the navigation.
    downlink_delay : bool, optional
        6 times 6 ms from the craft to the law.
    dead_zone : bool, optional
        Forces of 0.05 N or less count as zero.
    saturation : bool, optional
        Force and its angle end where fan and rudder do.
    tables : bool, optional
        Commands come from lookup tables and act by them; they end where they end, whether or not there is
        the saturation.
    uplink_delay : bool, optional
        2 times 20 ms from the law to the craft; without it one base tick remains.
    update_20ms : bool, optional
        Servo and speed controller take commands every 20 ms.
    brake : bool, optional
        The speed controller brakes for 150 ms from reverse to forward; of a variable-pitch propeller, the lag
        of its pitch.

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
        """Return those named and no other; without a name none.

        Parameters
        ----------
        *names : str
            Of :data:`SWITCHES`.

        Raises
        ------
        InputError
            If there is none of a name; the nearest is in the text.
        """
        _check(names)
        return cls(**{name: name in names for name in SWITCHES})

    def without(self, *names: str) -> Imperfections:
        """Return the same without those named; errors as for :meth:`only`.

        Parameters
        ----------
        *names : str
            Of :data:`SWITCHES`.
        """
        _check(names)
        return Imperfections.only(*(name for name in self.names if name not in names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of those that are there, in the order of the loop."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name))

    def parameters(self, loop: Block) -> dict[str, float]:
        """Return the values of a loop's parameters that make it so, by key, for runs of one built loop.

        Parameters
        ----------
        loop : Block
            By :func:`~hovercontrol.autopilot.autopilot`. An imperfection that is there has the size that the
            loop was built with, none if it was built without.
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
        if name not in SWITCHES:
            raise InputError(f"unknown imperfection {name!r}{did_you_mean(name, SWITCHES)}")
