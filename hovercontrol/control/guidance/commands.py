"""The pilot's commands, surge velocity and yaw rate, made smooth enough to be followed."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.laws import SURGE_REF, YAW_RATE_REF

#: What the steering law follows: desired velocities and their derivatives.
DESIRED = (
    Signal("surge_desired", "m/s", "desired surge velocity"),
    Signal("surge_acceleration_desired", "m/s^2", "its derivative"),
    Signal("yaw_rate_desired", "rad/s", "desired yaw rate"),
    Signal("yaw_acceleration_desired", "rad/s^2", "its derivative"),
)


@checked
def command_filter(*, lag: float = 0.5, period: float = 0.0, name: str = "filter") -> Block:
    """Return a first-order filter of the commands, so that desired accelerations exist.

    ``lag u_d' = surge_ref - u_d`` and the same for the yaw rate (a reference model of first order; Fossen,
    Handbook of Marine Craft Hydrodynamics and Motion Control, 2011, section 10.2).

    Parameters
    ----------
    lag : float, optional
        Time constant [s].
    period : float, optional
        Of a sampled filter [s], exact for commands that hold from tick to tick; 0: continuous.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``surge_ref`` [m/s], ``yaw_rate_ref`` [rad/s]; outputs ``surge_desired`` [m/s],
        ``surge_acceleration_desired`` [m/s^2], ``yaw_rate_desired`` [rad/s], ``yaw_acceleration_desired``
        [rad/s^2].

    Raises
    ------
    InputError
        If the lag is not positive or the period negative.

    Examples
    --------
    >>> print(command_filter().equations().splitlines()[0])
    surge_desired' = (-surge_desired + surge_ref)/lag
    """
    tau = Signal("lag", "s", "time constant", start=positive(f"{name}: lag", lag), lower=1e-6)
    not_negative(f"{name}: period", period)
    speed, speed_slope, rate, rate_slope = (s.symbol for s in DESIRED)
    pairs = ((speed, speed_slope, SURGE_REF.symbol), (rate, rate_slope, YAW_RATE_REF.symbol))
    slopes = {str(slope): (told - now) / tau.symbol for now, slope, told in pairs}
    # Sampled: x(t + h) = r + (x - r) exp(-h/lag) for a command r held over the period h.
    tick = Signal("period", "s", "of the ticks, fixed", start=period, lower=period, upper=period)
    left = sp.exp(-tick.symbol / tau.symbol)
    return Block(
        name,
        states=(DESIRED[0], DESIRED[2]),
        inputs=(SURGE_REF, YAW_RATE_REF),
        outputs=DESIRED,
        parameters=(tau, tick) if period else (tau,),
        derivatives={
            str(now): told + (now - told) * left if period else slopes[str(slope)]
            for now, slope, told in pairs
        },
        output_expressions=slopes,
        period=period,
    )
