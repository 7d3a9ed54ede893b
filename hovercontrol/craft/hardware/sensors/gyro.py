"""Dynamics of K06's gyro [K06 eq 6.2] and its compensation: one equation, solved for output or input."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import IMU_TICK, switch, tick

# K06 (6.2): y = 0.3236 z^2 / (z^2 - 0.9805 z + 0.2898) u, fitted at 6.5536 ms.
_COEFFICIENTS = (
    Signal("b0", "1", "gain of the rate", start=0.3236),
    Signal("a1", "1", "weight of the last reading", start=-0.9805),
    Signal("a2", "1", "weight of the reading before", start=0.2898),
)
_LAST = Signal("last", "rad/s", "last reading of the gyro")
_BEFORE = Signal("before", "rad/s", "last reading but one of the gyro")


def _balance(rate: sp.Expr, reading: sp.Expr) -> sp.Expr:
    """Return (6.2) as an expression that is zero: ``b0 u[k] - y[k] - a1 y[k-1] - a2 y[k-2]``."""
    b0, a1, a2 = (s.symbol for s in _COEFFICIENTS)
    return b0 * rate - reading - a1 * _LAST.symbol - a2 * _BEFORE.symbol


@checked
def gyro_dynamics(
    *, rate: str = "r", output: str = "gyro_rate", period: float = IMU_TICK, name: str = "gyro_dynamics"
) -> Block:
    """Return the dynamics of K06's gyro, (6.2).

    Parameters
    ----------
    rate : str, optional
        Name of the input, the true yaw rate [rad/s].
    output : str, optional
        Name of the output [rad/s].
    period : float, optional
        [s]; the fit is of 6.5536 ms. K06's pure delay of two samples is not part of it.
    name : str, optional

    Returns
    -------
    Block
        The fitted static gain is 1.046; the parameter ``dynamics`` switches the dynamics off.

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> gyro = Ticking(gyro_dynamics())
    >>> [round(gyro.tick(0.0, {"r": 1.0})["gyro_rate"], 4) for k in range(3)]
    [0.3236, 0.6409, 0.8582]
    """
    u, y = Signal(rate, "rad/s", "yaw rate"), Signal(output, "rad/s", "yaw rate behind the gyro's dynamics")
    return _block(name, period, u, y, solve_for=y)


@checked
def gyro_compensation(
    *,
    reading: str = "yaw_rate",
    output: str = "yaw_rate_compensated",
    period: float = IMU_TICK,
    name: str = "gyro_compensation",
) -> Block:
    """Return the inverse of :func:`gyro_dynamics`: less lag, more noise (K06 section 6.2.1.3).

    Parameters
    ----------
    reading : str, optional
        Name of the input, the gyro's reading [rad/s].
    output : str, optional
        Name of the output [rad/s].
    period : float, optional
        [s]
    name : str, optional

    Returns
    -------
    Block
        The parameter ``dynamics`` switches it off.

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> undo = Ticking(gyro_compensation())
    >>> [round(undo.tick(0.0, {"yaw_rate": y})["yaw_rate_compensated"], 9) for y in (0.3236, 0.6408898)]
    [1.0, 1.0]
    """
    u, y = (
        Signal(output, "rad/s", "yaw rate, corrected for the gyro's dynamics"),
        Signal(reading, "rad/s", "yaw rate"),
    )
    return _block(name, period, u, y, solve_for=u)


def _block(name: str, period: float, rate: Signal, reading: Signal, *, solve_for: Signal) -> Block:
    seconds = tick(name, period).start
    (solved,) = sp.solve(_balance(rate.symbol, reading.symbol), solve_for.symbol)
    given = rate if solve_for is reading else reading
    on = switch("dynamics", "dynamics of the gyro")
    told = sp.Piecewise((solved, on.symbol > 0), (given.symbol, True))
    return Block(
        name,
        states=(_LAST, _BEFORE),
        inputs=(given,),
        outputs=(solve_for,),
        parameters=(*_COEFFICIENTS, on),
        definitions={solve_for.name: told},
        definition_signals=(solve_for,),
        derivatives={"last": reading.symbol, "before": _LAST.symbol},
        period=seconds,
    )
