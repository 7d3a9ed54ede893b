"""The PI regulator of a fan's speed on a discharging battery (K06 4.2.1, 4.3.2.1, 5.2)."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.hardware.actuators.signals import FAN_SPEED, FAN_SPEED_SET, RPM, UPDATE

#: Share of the battery's voltage that the speed controller puts on the motor.
DUTY = Signal("duty", "1", "share of the battery's voltage on the motor", lower=0.0, upper=1.0)

#: K06's fans on a full battery under load [RPM].
FULL_SPEED = 12_000.0


@checked
def speed_regulator(
    *,
    settling: float = 0.2,
    lag: float = 0.1,
    full_speed: float = FULL_SPEED,
    period: float = UPDATE,
    name: str = "speed_regulator",
) -> Block:
    """Return a PI regulator of a fan's speed, thrust or lift.

    K06 "implemented a simple PI controller in firmware and adjusted the gains through experimentation", and
    prints none. Here they cancel the motor's lag, so that the speed follows with the time constant
    `settling`. The integral stops while the duty is at a limit (anti-windup).

    Parameters
    ----------
    settling : float, optional
        Time constant of the regulated fan [s].
    lag : float, optional
        Of the motor alone [s].
    full_speed : float, optional
        Speed at a duty of 1 on a full battery [RPM].
    period : float, optional
        [s]; K06's speed controllers take commands every 20 ms.
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``fan_speed_set`` and ``fan_speed`` [rad/s]; output ``duty``, 0 to 1.

    Raises
    ------
    InputError
        If a time or the speed is not positive.

    Examples
    --------
    >>> speed_regulator().default_parameters["speed_regulator.settling"]
    0.2
    """
    given = (("settling", settling, "s"), ("lag", lag, "s"), ("full_speed", full_speed * RPM, "rad/s"))
    own = {
        key: Signal(key, unit, key.replace("_", " "), start=positive(f"{name}: {key}", value), lower=1e-9)
        for key, value, unit in given
    }
    tick = Signal("tick", "s", "its period", start=positive(f"{name}: period", period), lower=0.0)
    settle, slow, full = (s.symbol for s in own.values())
    gain = slow / (settle * full)
    total = Signal("integral", "1", "the duty's integral part")
    wanted = Signal("wanted_duty", "1", "duty before its limits")
    error = FAN_SPEED_SET.symbol - FAN_SPEED.symbol
    step = gain / slow * tick.symbol * error
    inside = sp.Or(
        sp.And(wanted.symbol < 1, wanted.symbol > 0),
        sp.And(wanted.symbol >= 1, error < 0),
        sp.And(wanted.symbol <= 0, error > 0),
    )
    return Block(
        name,
        states=(total,),
        inputs=(FAN_SPEED_SET, FAN_SPEED),
        outputs=(DUTY,),
        parameters=(*own.values(), tick),
        definitions={wanted.name: total.symbol + gain * error},
        definition_signals=(wanted,),
        derivatives={total.name: total.symbol + sp.Piecewise((step, inside), (0, True))},
        output_expressions={DUTY.name: sp.Min(1, sp.Max(0, wanted.symbol))},
        period=period,
    )


@checked
def battery_fan(
    *, lag: float = 0.1, full_speed: float = FULL_SPEED, sag: float = 0.0, name: str = "battery_fan"
) -> Block:
    """Return a fan on a battery whose voltage falls linearly: "for a constant command the speed decreases".

    Parameters
    ----------
    lag : float, optional
        Of the motor [s].
    full_speed : float, optional
        Speed at a duty of 1 on a full battery [RPM].
    sag : float, optional
        Share of the voltage lost each second [1/s].
    name : str, optional

    Returns
    -------
    Block
        Continuous. Input ``duty``; output ``fan_speed`` [rad/s].

    Raises
    ------
    InputError
        If the lag or the speed is not positive, or the sag negative.

    Examples
    --------
    >>> print(battery_fan().equations())
    fan_speed' = (duty*full_speed*(-sag*t + 1) - fan_speed)/lag
    """
    not_negative(f"{name}: sag", sag)
    parameters = (
        Signal("lag", "s", "time constant", start=positive(f"{name}: lag", lag), lower=1e-9),
        Signal(
            "full_speed",
            "rad/s",
            "speed at a duty of 1",
            start=positive(f"{name}: full_speed", full_speed) * RPM,
        ),
        Signal("sag", "1/s", "share of the voltage lost each second", start=sag, lower=0.0),
    )
    slow, full, fade = (s.symbol for s in parameters)
    slope = (DUTY.symbol * full * (1 - fade * time) - FAN_SPEED.symbol) / slow
    return Block(
        name,
        states=(FAN_SPEED,),
        inputs=(DUTY,),
        outputs=(FAN_SPEED,),
        parameters=parameters,
        derivatives={FAN_SPEED.name: slope},
    )
