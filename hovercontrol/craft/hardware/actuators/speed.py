"""The fan's drive: a reversing speed controller that brakes, and the regulated motor (4.2.1, 6.1.1)."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.signals import (
    FAN_SPEED,
    FAN_SPEED_COMMAND,
    FAN_SPEED_SET,
    TICK,
    UPDATE,
    whole_ticks,
)

MODE = Signal("drive_mode", description="mode of the speed controller", modes=("run", "brake"))


@checked
def speed_controller(
    *,
    brake: float = 0.150,
    update: float = UPDATE,
    period: float = TICK,
    name: str = "speed_controller",
) -> Block:
    """Return the fan's speed controller, which brakes before it turns from reverse to forward [K06 fig 6.6].

    It reads a command every 20 ms. When commands change from negative to positive, directly or over zero, it
    brakes for exactly 150 ms. A negative command ends the braking and acts at once. 150 ms is not a multiple
    of 20 ms, so the Block ticks every millisecond and counts the ticks between two commands.

    Parameters
    ----------
    brake : float, optional
        Braking time [s], a multiple of the period; 0 switches it off. Other values of the parameter ``brake``
        are rounded to the nearest multiple.
    update : float, optional
        Time between two commands [s], a multiple of the period; 0: at every tick.
    period : float, optional
        [s]
    name : str, optional

    Returns
    -------
    Block
        Sampled. Input ``fan_speed_command`` [rad/s]; outputs ``fan_speed_set`` [rad/s], zero while it brakes,
        and ``drive_mode`` (run, brake).

    Raises
    ------
    InputError
        If a time is negative or not a multiple of the period, or the period is not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> drive = Ticking(speed_controller(update=0.0))
    >>> modes = [drive.tick(0.001 * k, {"fan_speed_command": k - 9.5})["drive_mode"] for k in range(200)]
    >>> int(sum(modes))  # milliseconds of braking
    150
    """
    positive(f"{name}: period", period)
    whole_ticks(f"{name}: brake", brake, period)
    every = max(1, whole_ticks(f"{name}: update", update, period))
    length = Signal("brake", "s", "braking time; 0: no braking", start=brake, lower=0.0, nominal=0.1)
    tick = Signal("tick", "s", "its period", start=period, lower=0.0, nominal=TICK)
    held = FAN_SPEED_COMMAND.replace(name="held_command", description="current command")
    last = held.replace(name="last_command", description="command at the last tick")
    wait = Signal("wait", "1", "ticks to the next command", lower=0.0)
    braked = Signal("braked", "1", "ticks since braking began", lower=0.0)
    backward = Signal("backward", "1", "1 if the last command other than zero was negative", lower=0.0)
    now, braking = held.symbol, braked.symbol > 0
    due = wait.symbol < sp.Rational(1, 2)
    left = braked.symbol < length.symbol / tick.symbol - sp.Rational(1, 2)
    begins = sp.And(~braking, now > 0, backward.symbol > 0)
    brakes = sp.Eq(MODE.symbol, MODE.mode("brake"))
    return Block(
        name,
        states=(last, wait, braked, backward),
        inputs=(FAN_SPEED_COMMAND,),
        outputs=(FAN_SPEED_SET, MODE),
        parameters=(length, tick),
        definitions={
            held.name: sp.Piecewise((FAN_SPEED_COMMAND.symbol, due), (last.symbol, True)),
            MODE.name: sp.Piecewise(
                (MODE.mode("brake"), sp.And(now >= 0, left, sp.Or(braking, begins))), (MODE.mode("run"), True)
            ),
        },
        definition_signals=(held, MODE),
        derivatives={
            last.name: now,
            wait.name: sp.Piecewise((every - 1, due), (wait.symbol - 1, True)),
            braked.name: sp.Piecewise((braked.symbol + 1, brakes), (0, True)),
            # Braking is what turns the fan's direction: once it has begun, the next crossing brakes anew
            # only after another negative command.
            backward.name: sp.Piecewise((1, now < 0), (0, sp.Or(now > 0, brakes)), (backward.symbol, True)),
        },
        output_expressions={FAN_SPEED_SET.name: sp.Piecewise((0, brakes), (now, True))},
        period=period,
    )


@checked
def fan_motor(*, lag: float = 0.0, name: str = "fan_motor") -> Block:
    """Return the fan's motor under its speed regulator: a first-order lag.

    K06 regulates the speed by a PI controller with an encoder, against changes of battery and load. It gives
    neither gains nor a settling time, and its simulation has no lag, the default here.

    Parameters
    ----------
    lag : float, optional
        Time constant [s]; 0: no lag.
    name : str, optional

    Returns
    -------
    Block
        Continuous. Input ``fan_speed_set`` [rad/s]; output ``fan_speed`` [rad/s].

    Raises
    ------
    InputError
        If the lag is negative.

    Examples
    --------
    >>> print(fan_motor(lag=0.1).equations())
    fan_speed' = (-fan_speed + fan_speed_set)/lag
    >>> print(fan_motor().equations())
    fan_speed = fan_speed_set
    """
    if not not_negative(f"{name}: lag", lag):
        return Block(
            name,
            inputs=(FAN_SPEED_SET,),
            outputs=(FAN_SPEED,),
            output_expressions={FAN_SPEED.name: FAN_SPEED_SET.symbol},
        )
    seconds = Signal("lag", "s", "time constant", start=lag, lower=1e-9, nominal=0.1)
    slope = (FAN_SPEED_SET.symbol - FAN_SPEED.symbol) / seconds.symbol
    return Block(
        name,
        states=(FAN_SPEED,),
        inputs=(FAN_SPEED_SET,),
        outputs=(FAN_SPEED,),
        parameters=(seconds,),
        derivatives={FAN_SPEED.name: slope},
    )
