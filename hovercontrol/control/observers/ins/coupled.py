"""One extended Kalman filter on position fixes, with or without a heading aid."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import FIX_X, FIX_Y, IMU_PERIOD, to_navigation, valid
from hovercontrol.control.observers.ins.kalman import variance_parameters
from hovercontrol.control.observers.ins.mechanisation import finite
from hovercontrol.control.observers.ins.navigation import POSITION, PSI, Aid, heading_aid, navigation_filter
from hovercontrol.control.observers.ins.noise import InsNoise, noise_from_sensors


@checked
def coupled_filter(
    *,
    heading: bool = False,
    arm: Sequence[float] = (0.0, 0.0),
    noise: InsNoise | None = None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0),
    excitation: float = 0.1,
    period: float = IMU_PERIOD,
    name: str = "ins",
) -> Block:
    """Return one filter for heading, velocity, position and all biases (K06 section 3.3.3.6).

    Without a heading aid the heading is observable only while the craft accelerates.

    Parameters
    ----------
    heading : bool, optional
        Whether a heading aid is available too.
    arm : sequence of 2 float, optional
        Position on the craft at which the fix is measured, forward and sideways of the IMU [m].
    noise : InsNoise, optional
        Default: :func:`noise_from_sensors`.
    pose : sequence of 3 float, optional
        Initial x, y [m] and psi [rad].
    velocity : sequence of 2 float, optional
        Initial velocity along x and y [m/s].
    excitation : float, optional
        Threshold [m/s^2] on the specific force, averaged over about one second. Below it, fixes do not
        correct the heading and the gyro bias; the uncertainty of these two still enters all other updates.
        With 0, fixes always correct them, as in the plain extended Kalman filter. That filter takes the
        accelerometers' noise for motion and reduces its heading variance at rest although nothing was
        learned.
    period : float, optional
        Period of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``acceleration_x``, ``acceleration_y``, ``yaw_rate``, ``fix_x``, ``fix_y``,
        ``fix_valid`` (and ``heading_aid``, ``heading_aid_valid``). Outputs as those of :func:`aided_ins`
        where it has them, and ``P[i,j]``, i <= j: the covariance of psi, v_x, v_y, x, y and the biases of
        gyro and accelerometers.

    Raises
    ------
    InputError
        If the period is not positive, or pose, velocity or arm are not finite numbers.

    Examples
    --------
    >>> [s.name for s in coupled_filter().outputs[:5]]
    ['psi_hat', 'r_hat', 'gyro_bias_hat', 'x_hat', 'y_hat']
    """
    noise = noise or noise_from_sensors(period=positive(f"{name}: period", period))
    place = arm_signals("fix_arm", finite(f"{name}: arm", arm, 2))
    at = placed([s.symbol for s in place])
    R = variance_parameters("R2", ["m", "m"], noise.R2)
    use = valid("fix")
    aids = [Aid(FIX_X, use, at[0], R[0]), Aid(FIX_Y, use, at[1], R[1])]
    if heading:
        aids.insert(0, heading_aid(noise))
    return navigation_filter(
        name, aids, place, noise=noise, pose=pose, velocity=velocity, period=period, excitation=excitation
    )


def arm_signals(name: str, arm: Sequence[float]) -> tuple[Signal, Signal]:
    """Return a sensor's position on the craft as two parameters."""
    forward, sideways = (
        Signal(f"{name}_{axis}", "m", "of the sensor's place on the craft", start=v)
        for axis, v in zip("xy", arm, strict=True)
    )
    return forward, sideways


def placed(arm: Sequence[sp.Symbol]) -> sp.Matrix:
    """Return the position of a sensor with a lever arm: ``p + B(psi) arm``."""
    return POSITION + to_navigation(PSI, sp.Matrix(arm))
