"""K06's aided inertial navigation: the IMU integration and the two error filters as one Block."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.observers.ins.heading import heading_filter
from hovercontrol.control.observers.ins.imu import IMU, IMU_PERIOD
from hovercontrol.control.observers.ins.mechanisation import ins_mechanisation
from hovercontrol.control.observers.ins.noise import K06_NOISE, InsNoise
from hovercontrol.control.observers.ins.velocity_position import velocity_position_filter


@checked
def aided_ins(
    *,
    noise: InsNoise = K06_NOISE,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0),
    period: float = IMU_PERIOD,
    name: str = "ins",
) -> Block:
    """Return K06's aided inertial navigation (sections 3.3 and 5.4.5).

    Parameters
    ----------
    noise : InsNoise, optional
    pose : sequence of 3 float, optional
        Initial x, y [m] and psi [rad].
    velocity : sequence of 2 float, optional
        Initial velocity along x and y [m/s].
    period : float, optional
        Period of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``acceleration_x``, ``acceleration_y``, ``yaw_rate``, ``heading_aid``,
        ``heading_aid_valid``, ``fix_x``, ``fix_y``, ``fix_valid``; outputs those of
        :func:`ins_mechanisation`, :func:`heading_filter` and :func:`velocity_position_filter`.

    Raises
    ------
    InputError
        If the period is not positive, or pose or velocity are not finite numbers.

    Examples
    --------
    >>> [s.name for s in aided_ins().inputs if s.name.endswith("valid")]
    ['heading_aid_valid', 'fix_valid']
    """
    parts = [
        ins_mechanisation(aided=True, pose=pose, velocity=velocity, period=period),
        heading_filter(noise=noise, period=period, name="heading"),
        velocity_position_filter(noise=noise, period=period, name="motion"),
    ]
    aids = [s.name for part in parts[1:] for s in part.inputs if s.name.startswith(("heading_aid", "fix"))]
    return interconnect(parts, name, inputs=[*(s.name for s in IMU), *aids])
