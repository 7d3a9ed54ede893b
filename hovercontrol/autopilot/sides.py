"""The two ends of the radio link: what ticks with the law, and what ticks on board.

Both have K06's tables and ideal ones, with a choice between them.
"""

from __future__ import annotations

from collections.abc import Mapping

from hovercontrol.autopilot.choice import choice
from hovercontrol.autopilot.limits import OUTSIDE, actuator_limits, clip_counters
from hovercontrol.controllers.k06 import setpoints
from hovercontrol.core.block import Block
from hovercontrol.core.interconnect import interconnect, rename
from hovercontrol.core.signals import Signal
from hovercontrol.hardware.actuators import (
    FanTable,
    ServoTable,
    force_command,
    ideal_fan,
    ideal_servo,
    rudder_lookup,
    rudder_servo,
    speed_controller,
    thrust_force,
    thrust_lookup,
)
from hovercontrol.hardware.actuators.signals import FAN_SPEED_COMMAND, FAN_SPEED_SET, SERVO_COMMAND
from hovercontrol.models.model import MOTION, RUDDER, THRUST

#: What goes over the link to the craft.
COMMANDS = (SERVO_COMMAND, FAN_SPEED_COMMAND)


def pilot_side(
    law: Block,
    guidance: Block | None,
    references: Mapping[str, float] | None,
    period: float,
    tables: tuple[FanTable, FanTable],
    servo: ServoTable,
) -> Block:
    """Return all that ticks with the law: guidance, law, dead zone, saturation, lookup tables.

    Parameters
    ----------
    law, guidance, references, period
        As for :func:`~hovercontrol.autopilot.autopilot`.
    tables : tuple of two FanTable
        Speeds over forces, forces over speeds.
    servo : ServoTable

    Returns
    -------
    Block
        Inputs the motion as the law sees it, ``u_seen`` ...; outputs those of guidance and law, the commands,
        and how often these were clipped.
    """
    own = [law] if guidance is None else [guidance, law]
    reference = setpoints(own, references)
    own = [*([reference] if reference.outputs else []), *own]
    wanted = {"thrust_command": "thrust_wanted", "force_angle_command": "force_angle_wanted"}
    lookups = []
    for suffix, fan, own_servo, straight in _sets(tables[0], servo, 0):
        ports = {s.name: f"{s.name}_by_table{suffix}" for s in (*COMMANDS, *OUTSIDE)}
        ports["rudder_angle_command"] = f"rudder_angle_command{suffix}"
        rudder = rudder_lookup(table=own_servo, period=0.0, name=f"rudder_lookup{suffix}", **straight)
        thrust = thrust_lookup(table=fan, period=0.0, name=f"thrust_lookup{suffix}")
        lookups += [_renamed(rudder, ports), _renamed(thrust, ports)]
    counters = clip_counters(next((block.period for block in own if block.period), period))
    parts = [
        *own,
        rename(force_command(), wanted),
        actuator_limits(tables=tables, servo=servo),
        *lookups,
        choice(
            "tables",
            "lookup tables of servo and fan",
            {s: (f"{s.name}_by_table", f"{s.name}_by_table_ideal") for s in (*COMMANDS, *OUTSIDE)},
        ),
        counters,
    ]
    outputs = [s.name for block in own for s in block.outputs]
    outputs += [s.name for s in (*COMMANDS, *counters.outputs)]
    whole = interconnect(parts, "pilot", outputs=outputs)
    moving = {s.name for s in MOTION}
    return rename(whole, {s.name: f"{s.name}_seen" for s in whole.inputs if s.name in moving})


def board_side(period: float, table: FanTable, servo: ServoTable) -> Block:
    """Return all that ticks on board: the servo, the speed controller, and the force that they make.

    Parameters
    ----------
    period : float
        [s]
    table : FanTable
        Forces over speeds.
    servo : ServoTable

    Returns
    -------
    Block
        Inputs the commands as sent and as held for 20 ms; outputs ``thrust`` [N], ``rudder`` [rad],
        ``fan_speed_set`` [rad/s] and ``drive_mode``.
    """
    servos = []
    forces = []
    for suffix, fan, own_servo, straight in _sets(table, servo, 1):
        ports = {
            "servo_command": "servo_command_taken",
            "rudder_angle": f"rudder_angle{suffix}",
            "fan_speed": "fan_speed_set",
            "thrust": f"thrust_by_table{suffix}",
            "rudder": f"rudder_by_table{suffix}",
        }
        follows = rudder_servo(table=own_servo, period=period, name=f"rudder_servo{suffix}")
        servos.append(_renamed(follows, ports))
        forces.append(_renamed(thrust_force(table=fan, name=f"thrust_force{suffix}", **straight), ports))
    taken = [after(s, "taken") for s in COMMANDS]
    parts = [
        choice(
            "update_20ms",
            "commands are taken every 20 ms",
            {t: (f"{s.name}_held", f"{s.name}_sent") for t, s in zip(taken, COMMANDS, strict=True)},
        ),
        *servos,
        rename(
            speed_controller(update=0.0, period=period), {FAN_SPEED_COMMAND.name: "fan_speed_command_taken"}
        ),
        *forces,
        choice(
            "calibration",
            "force of servo and fan by their tables",
            {
                THRUST.replace(unit="N", description="force of the propeller"): (
                    "thrust_by_table",
                    "thrust_by_table_ideal",
                ),
                RUDDER.replace(description="angle of the force from the bow"): (
                    "rudder_by_table",
                    "rudder_by_table_ideal",
                ),
            },
        ),
    ]
    return interconnect(parts, "board", outputs=["drive_mode", FAN_SPEED_SET.name, "thrust", "rudder"])


def held_side(period: float) -> Block:
    """Return what takes the commands that have come over the link every 20 ms."""
    return Block(
        "update",
        inputs=tuple(after(s, "sent") for s in COMMANDS),
        outputs=tuple(after(s, "held") for s in COMMANDS),
        output_expressions={f"{s.name}_held": after(s, "sent").symbol for s in COMMANDS},
        period=period,
    )


def _sets(
    table: FanTable, servo: ServoTable, which: int
) -> tuple[tuple[str, FanTable, ServoTable, dict[str, float]], ...]:
    """Return K06's and ideal tables of one kind: suffix, fan, servo, and slope and offset of (4.3)."""
    return (
        ("", table, servo, {}),
        ("_ideal", ideal_fan()[which], ideal_servo(), {"slope": -1.0, "offset": 0.0}),
    )


def after(signal: Signal, end: str) -> Signal:
    """Return a signal as it is called behind a part of the loop."""
    return signal.replace(name=f"{signal.name}_{end}")


def _renamed(block: Block, ports: Mapping[str, str]) -> Block:
    own = {s.name for s in (*block.inputs, *block.outputs)}
    return rename(block, {old: new for old, new in ports.items() if old in own})
