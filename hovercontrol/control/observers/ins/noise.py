"""Noise covariances of the filters: K06's printed matrices, and covariances derived from sensor errors.

K06's section 3.3.3.6 calls the printed Q1 and Q2 [K06 eq 5.4, 5.5] variances of the sensors' samples:
sqrt(4.9e-4) rad/s = 1.27 deg/s. K06's discrete model (5.4.5) adds that noise to the heading *itself* at each
tick, which requires the variance times dt^2. As printed, the heading's random walk is 1.27 deg per tick, or
15.7 deg in a second: 1/dt^2 = 23 283 times the variance that such a gyro causes. The velocity's random walk
is 2.3 m/s in a second. The gyro bias walks 1.28 deg/s per tick. The biases' initial standard deviations are
57 deg/s and 1 m/s^2, but K06's simulation has biases of 1 deg/s and 2.5 cm/s^2 and a gyro noise of 0.5 deg/s.
With the printed matrices the filters therefore follow their aids almost exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import number, positive
from hovercontrol.control.observers.diagonal import diagonal
from hovercontrol.control.observers.ins.imu import IMU_PERIOD

_SIZES = {"Q1": 2, "R1": 1, "P1": 2, "Q2": 4, "R2": 2, "P2": 6}
_MAY_BE_ZERO = ("gyro_noise", "gyro_walk", "acceleration_walk")


@checked
@dataclass(frozen=True)
class InsNoise:
    """Diagonals of both filters' covariances; the defaults are K06's (section 5.4.5).

    Parameters
    ----------
    Q1 : sequence of 2 float, optional
        Process noise per tick: heading error [rad^2] and gyro bias [rad^2/s^2].
    R1 : float, optional
        Measurement noise of the heading aid [rad^2].
    P1 : sequence of 2 float, optional
        Initial variances: heading error [rad^2], gyro bias [rad^2/s^2] [K06 eq 3.45, 3.46].
    Q2 : sequence of 4 float, optional
        Process noise per tick: velocity error, forward and sideways [m^2/s^2], and accelerometer biases
        [m^2/s^4].
    R2 : sequence of 2 float, optional
        Measurement noise of the fix, x and y [m^2].
    P2 : sequence of 6 float, optional
        Initial variances: velocity error x, y [m^2/s^2], position error x, y [m^2], biases x, y [m^2/s^4]
        [K06 eq 3.47].

    Raises
    ------
    InputError
        If the number of values is wrong, a variance is negative, or one of R1, R2, P1, P2 is zero.

    Examples
    --------
    >>> InsNoise(Q1=(1e-6, 1e-9)).Q1
    (1e-06, 1e-09)
    """

    Q1: tuple[float, ...] = (4.9e-4, 5e-4)
    R1: float = 1.6e-4
    P1: tuple[float, ...] = (1.6e-4, 1.0)
    Q2: tuple[float, ...] = (3.4e-2, 2.7e-2, 5e-4, 5e-4)
    R2: tuple[float, ...] = (5.6e-4, 5.6e-4)
    P2: tuple[float, ...] = (1.0, 1.0, 5.6e-4, 5.6e-4, 1.0, 1.0)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, size in _SIZES.items():
            values = diagonal(name, getattr(self, name), size, positive=name[0] in "RP")
            object.__setattr__(self, name, values[0] if name == "R1" else tuple(values))


#: K06's matrices as printed.
K06_NOISE = InsNoise()


@checked
@dataclass(frozen=True)
class SensorErrors:
    """Standard deviations of sensor errors.

    Parameters
    ----------
    gyro_noise, gyro_bias : float, optional
        One sample, and the bias at switch-on [rad/s]. K06's simulation: 0.5 and 1 deg/s.
    acceleration_noise : tuple of 2 float, optional
        One sample, forward and sideways [m/s^2]: the square roots of K06's Q2, measured on a sensor at rest.
    acceleration_bias : float, optional
        Bias at switch-on [m/s^2]. K06's simulation: 2.5 cm/s^2.
    gyro_walk, acceleration_walk : float, optional
        Random walk of the biases in one second [rad/s, m/s^2]; K06 tuned these in simulation.
    heading_aid, fix : float, optional
        One measurement [rad], [m]: the square roots of K06's R1 and R2.
    heading, velocity, position : float, optional
        Initial values given to the filter [rad, m/s, m].

    Raises
    ------
    InputError
        If one is negative, or zero where a filter needs it positive.

    Examples
    --------
    >>> SensorErrors(fix=0.05).fix
    0.05
    """

    gyro_noise: float = math.radians(0.5)
    gyro_bias: float = math.radians(1.0)
    acceleration_noise: tuple[float, float] = (math.sqrt(3.4e-2), math.sqrt(2.7e-2))
    acceleration_bias: float = 0.025
    gyro_walk: float = 1e-4
    acceleration_walk: float = 1e-3
    heading_aid: float = math.sqrt(1.6e-4)
    fix: float = math.sqrt(5.6e-4)
    heading: float = math.sqrt(1.6e-4)
    velocity: float = 0.1
    position: float = math.sqrt(5.6e-4)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            given = getattr(self, name)
            if name == "acceleration_noise":
                diagonal("SensorErrors: acceleration_noise", given, 2)
            elif name not in _MAY_BE_ZERO:
                positive(f"SensorErrors: {name}", given)
            elif not 0 <= number(f"SensorErrors: {name}", given) < math.inf:
                raise InputError(f"SensorErrors: {name} must not be negative, found {given!r}")


@checked
def noise_from_sensors(sensors: SensorErrors | None = None, *, period: float = IMU_PERIOD) -> InsNoise:
    """Return covariances that agree with the errors of the sensors.

    At each tick a sample of standard deviation s adds an error of standard deviation ``s * period`` to its
    integral. A bias with a random walk of s in one second changes by ``s * sqrt(period)`` per tick.

    Parameters
    ----------
    sensors : SensorErrors, optional
    period : float, optional
        Period of the IMU [s].

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> round(K06_NOISE.Q1[0] / noise_from_sensors(SensorErrors(gyro_noise=4.9e-4**0.5)).Q1[0])
    23283
    """
    s, dt = sensors or SensorErrors(), positive("noise_from_sensors: period", period)
    forward, sideways = diagonal("acceleration_noise", s.acceleration_noise, 2)
    walk = s.acceleration_walk**2 * dt
    return InsNoise(
        Q1=((s.gyro_noise * dt) ** 2, s.gyro_walk**2 * dt),
        R1=s.heading_aid**2,
        P1=(s.heading**2, s.gyro_bias**2),
        Q2=((forward * dt) ** 2, (sideways * dt) ** 2, walk, walk),
        R2=(s.fix**2, s.fix**2),
        P2=(*[s.velocity**2] * 2, *[s.position**2] * 2, *[s.acceleration_bias**2] * 2),
    )
