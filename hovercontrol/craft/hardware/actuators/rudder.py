"""The rudder: the angle that a force needs, the pulse that the angle needs, and the servo (4.2.2, 4.3.1)."""

from __future__ import annotations

import numpy as np
import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.lookup import linear
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.k06 import (
    RUDDER_OFFSET,
    RUDDER_SLOPE,
    rudder_of_force_angle,
    servo_table,
)
from hovercontrol.craft.hardware.actuators.signals import (
    DEGREE,
    FORCE_ANGLE_COMMAND,
    MILLISECOND,
    RUDDER_ANGLE,
    RUDDER_ANGLE_COMMAND,
    SERVO_COMMAND,
    TICK,
    UPDATE,
)
from hovercontrol.craft.hardware.actuators.tables import ServoTable

#: The unit of the servo's table, as a parameter: pulses stretched by a wrong clock.
_UNIT = Signal("pulse_unit", "s", "one millisecond of the table", start=MILLISECOND, nominal=MILLISECOND)


def regression_signals(slope: float, offset: float, name: str) -> tuple[Signal, Signal]:
    """Return slope and offset [rad] of (4.3) as parameters of a Block; the slope must not be zero."""
    positive(f"{name}: size of the slope", abs(number(f"{name}: slope", slope)))
    return (
        Signal("slope", "1", "slope of (4.3): rudder angle over hovercraft angle", start=slope),
        Signal("offset", "rad", "offset of (4.3): rudder angle of a force straight ahead", start=offset),
    )


def clipped(outside: sp.Basic, name: str) -> tuple[Signal, sp.Expr]:
    """Return an output that is 1 where a lookup is clipped, and its expression."""
    told = Signal(f"{name}_outside", "1", "1 outside the table, where the border value is used", lower=0.0)
    return told, sp.Piecewise((1, outside), (0, True))


def counted(outside: sp.Basic, name: str) -> tuple[Signal, Signal, dict[str, sp.Expr]]:
    """Return a state, an output and its definition that count the ticks at which a lookup was clipped."""
    last = Signal("last_clipped", "1", "clipped ticks before this one", lower=0.0)
    count = Signal(f"{name}_clipped", "1", "clipped ticks, with values outside the table", lower=0.0)
    return last, count, {count.name: last.symbol + sp.Piecewise((1, outside), (0, True))}


@checked
def rudder_lookup(
    *,
    table: ServoTable | None = None,
    slope: float = RUDDER_SLOPE,
    offset: float = RUDDER_OFFSET,
    period: float = TICK,
    name: str = "rudder_lookup",
) -> Block:
    """Return the lookup of the servo's pulse: rudder angle by (4.3), then the servo's table backwards.

    Parameters
    ----------
    table : ServoTable, optional
        Default: :func:`~hovercontrol.craft.hardware.actuators.k06.servo_table`, a stand-in.
    slope, offset : float, optional
        Of (4.3); the offset in rad. An ideal rudder has -1 and 0.
    period : float, optional
        [s]; 0 for a Block without states, to be joined with others.
    name : str, optional

    Returns
    -------
    Block
        Input ``force_angle_command`` [rad]; outputs ``rudder_angle_command`` [rad], as (4.3) has it,
        ``servo_command`` [s], limited to the table, and ``rudder_clipped``, the number of ticks at which it
        was limited (without period ``rudder_outside``, 1 where it is limited).

    Raises
    ------
    InputError
        If the period is negative or the slope zero.

    Examples
    --------
    >>> block = rudder_lookup(period=0.0)
    >>> block.to_numpy().outputs(0.0, (), [0.0]).round(6).tolist()  # 0.566 degrees: 1.506 ms
    [0.009879, 0.001506, 0.0]
    """
    not_negative(f"{name}: period", period)
    known = servo_table() if table is None else table
    parameters = (*regression_signals(slope, offset, name), _UNIT)
    K, b, ms = (p.symbol for p in parameters)
    wanted = RUDDER_ANGLE_COMMAND.symbol
    angles, pulses = known.angle, known.pulse
    if angles[-1] < angles[0]:
        angles, pulses = angles[::-1], pulses[::-1]
    definitions = {RUDDER_ANGLE_COMMAND.name: rudder_of_force_angle(FORCE_ANGLE_COMMAND.symbol, K, b)}
    states: tuple[Signal, ...] = ()
    outputs: tuple[Signal, ...] = (RUDDER_ANGLE_COMMAND, SERVO_COMMAND)
    margin = 1e-9  # an angle at the border, converted twice, is not outside
    outside = sp.Or(wanted / DEGREE < angles[0] - margin, wanted / DEGREE > angles[-1] + margin)
    told = {SERVO_COMMAND.name: ms * linear(wanted / DEGREE, angles, pulses)}
    if period:
        last, count, defined = counted(outside, "rudder")
        states, outputs, definitions = (last,), (*outputs, count), definitions | defined
    else:
        flag, told["rudder_outside"] = clipped(outside, "rudder")
        outputs = (*outputs, flag)
    return Block(
        name,
        states=states,
        inputs=(FORCE_ANGLE_COMMAND,),
        outputs=outputs,
        parameters=parameters,
        definitions=definitions,
        definition_signals=(RUDDER_ANGLE_COMMAND, *(outputs[2:] if period else ())),
        derivatives={s.name: outputs[2].symbol for s in states},
        output_expressions=told,
        period=period,
    )


@checked
def rudder_servo(
    *,
    table: ServoTable | None = None,
    slew: float = 0.0,
    period: float = UPDATE,
    name: str = "rudder_servo",
) -> Block:
    """Return the rudder's servo: it reads a pulse every 20 ms and moves to the table's angle.

    Pulses beyond the table give the angle at its end, K06's actuator limit.

    Parameters
    ----------
    table : ServoTable, optional
        Default: :func:`~hovercontrol.craft.hardware.actuators.k06.servo_table`, a stand-in.
    slew : float, optional
        Largest rate of the rudder [rad/s]; 0 (the default) for no limit: K06 gives none. Hobby servos do
        about 6 rad/s.
    period : float, optional
        [s]
    name : str, optional

    Returns
    -------
    Block
        Sampled. Input ``servo_command`` [s]; output ``rudder_angle`` [rad].

    Raises
    ------
    InputError
        If the period is not positive or the slew negative.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> servo = Ticking(rudder_servo(slew=1.0))
    >>> [round(servo.tick(0.02 * k, {"servo_command": 2e-3})["rudder_angle"], 3) for k in range(3)]
    [0.02, 0.04, 0.06]
    """
    positive(f"{name}: period", period)
    known = servo_table() if table is None else table
    rate = Signal(
        "slew",
        "rad/s",
        "largest rate of the rudder; 0: no limit",
        start=not_negative(f"{name}: slew", slew),
        lower=0.0,
    )
    step = Signal("update", "s", "time between two pulses", start=period, lower=0.0)
    neutral = float(np.interp(SERVO_COMMAND.start / MILLISECOND, known.pulse, known.angle)) * DEGREE
    last = RUDDER_ANGLE.replace(
        name="last_rudder_angle", description="rudder angle at the last tick", start=neutral
    )
    aim = Signal("aim", "rad", "angle of the pulse")
    most = rate.symbol * step.symbol
    turned = last.symbol + sp.Max(-most, sp.Min(most, aim.symbol - last.symbol))
    return Block(
        name,
        states=(last,),
        inputs=(SERVO_COMMAND,),
        outputs=(RUDDER_ANGLE,),
        parameters=(_UNIT, rate, step),
        definitions={
            "aim": DEGREE * linear(SERVO_COMMAND.symbol / _UNIT.symbol, known.pulse, known.angle),
            RUDDER_ANGLE.name: sp.Piecewise((turned, rate.symbol > 0), (aim.symbol, True)),
        },
        definition_signals=(aim, RUDDER_ANGLE),
        derivatives={last.name: RUDDER_ANGLE.symbol},
        period=period,
    )
