"""The two ends of the radio link: the components that run with the law, and those on board.

Both contain K06's tables and ideal ones, with a selector between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.limits import OUTSIDE, actuator_limits, clip_counters
from hovercontrol.control.autopilot.selector import selector
from hovercontrol.control.autopilot.thrusters import STRAIGHT, Thruster
from hovercontrol.control.controllers.k06 import setpoints
from hovercontrol.craft.hardware.actuators import (
    ServoTable,
    force_command,
    ideal_servo,
    rudder_lookup,
    rudder_servo,
)
from hovercontrol.craft.hardware.actuators.signals import SERVO_COMMAND
from hovercontrol.craft.models.motion import MOTION, RUDDER, THRUST


def sent_commands(thruster: Thruster) -> tuple[Signal, Signal]:
    """Return the commands that are sent over the link to the craft."""
    return SERVO_COMMAND, thruster.command


def pilot_side(
    law: Block,
    guidance: Block | None,
    references: Mapping[str, float] | None,
    period: float,
    thruster: Thruster,
    servo: ServoTable,
) -> Block:
    """Return the ground side of the loop: guidance, law, dead zone, saturation, lookup tables.

    Parameters
    ----------
    law, guidance, references, period
        As for :func:`~hovercontrol.control.autopilot.autopilot`.

    Returns
    -------
    Block
        Inputs: the motion as received by the law, ``u_seen`` .... Outputs: those of guidance and law, the
        commands, and the number of ticks at which these were clipped.
    """
    own = [law] if guidance is None else [guidance, law]
    reference = setpoints(own, references)
    own = [*([reference] if reference.outputs else []), *own]
    wanted = {"thrust_command": "thrust_wanted", "force_angle_command": "force_angle_wanted"}
    commands = sent_commands(thruster)
    lookups = []
    for (suffix, own_servo, straight), thrust in zip(_servos(servo), thruster.lookups, strict=True):
        ports = {s.name: f"{s.name}_by_table{suffix}" for s in (*commands, *OUTSIDE)}
        ports["rudder_angle_command"] = f"rudder_angle_command{suffix}"
        rudder = rudder_lookup(table=own_servo, period=0.0, name=f"rudder_lookup{suffix}", **straight)
        lookups += [_renamed(rudder, ports), _renamed(thrust, ports)]
    counters = clip_counters(next((block.period for block in own if block.period), period))
    parts = [
        *own,
        rename(force_command(), wanted),
        actuator_limits(thruster.ends, servo=servo),
        *lookups,
        selector(
            "tables",
            "lookup tables of servo and fan",
            {s: (f"{s.name}_by_table", f"{s.name}_by_table_ideal") for s in (*commands, *OUTSIDE)},
        ),
        counters,
    ]
    outputs = [s.name for block in own for s in block.outputs]
    outputs += [s.name for s in (*commands, *counters.outputs)]
    whole = interconnect(parts, "pilot", outputs=outputs)
    moving = {s.name for s in MOTION}
    return rename(whole, {s.name: f"{s.name}_seen" for s in whole.inputs if s.name in moving})


def board_side(period: float, thruster: Thruster, servo: ServoTable) -> Block:
    """Return the onboard side of the loop: the servo, the thruster's drive, and the resulting force.

    Parameters
    ----------
    period : float
        Base tick [s].

    Returns
    -------
    Block
        Inputs: the commands as sent, and as held for 20 ms. Outputs: ``thrust`` [N], ``rudder`` [rad], and
        those of the drive: ``fan_speed_set`` [rad/s] and ``drive_mode`` for the fan, else ``blade_pitch``
        [rad].
    """
    servos = []
    forces = []
    for (suffix, own_servo, _), force in zip(_servos(servo), thruster.forces, strict=True):
        ports = {
            "servo_command": "servo_command_taken",
            "rudder_angle": f"rudder_angle{suffix}",
            "fan_speed": "fan_speed_set",
            "thrust": f"thrust_by_table{suffix}",
            "rudder": f"rudder_by_table{suffix}",
        }
        follows = rudder_servo(table=own_servo, period=period, name=f"rudder_servo{suffix}")
        servos.append(_renamed(follows, ports))
        forces.append(_renamed(force, ports))
    commands = sent_commands(thruster)
    taken = [stage_signal(s, "taken") for s in commands]
    parts = [
        selector(
            "update_20ms",
            "commands are taken every 20 ms",
            {t: (f"{s.name}_held", f"{s.name}_sent") for t, s in zip(taken, commands, strict=True)},
        ),
        *servos,
        rename(thruster.drive, {thruster.command.name: f"{thruster.command.name}_taken"}),
        *forces,
        selector(
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
    drive = [s.name for s in reversed(thruster.drive.outputs)]
    return interconnect(parts, "board", outputs=[*drive, "thrust", "rudder"])


def held_side(period: float, commands: Sequence[Signal]) -> Block:
    """Return a Block that samples the received commands every `period` (20 ms) and holds them."""
    return Block(
        "update",
        inputs=tuple(stage_signal(s, "sent") for s in commands),
        outputs=tuple(stage_signal(s, "held") for s in commands),
        output_expressions={f"{s.name}_held": stage_signal(s, "sent").symbol for s in commands},
        period=period,
    )


def _servos(servo: ServoTable) -> tuple[tuple[str, ServoTable, dict[str, float]], ...]:
    """Return the given and an ideal servo: suffix, table, and slope and offset of (4.3)."""
    return ("", servo, {}), ("_ideal", ideal_servo(), STRAIGHT)


def stage_signal(signal: Signal, end: str) -> Signal:
    """Return a signal renamed with the suffix of its stage in the loop."""
    return signal.replace(name=f"{signal.name}_{end}")


def _renamed(block: Block, ports: Mapping[str, str]) -> Block:
    own = {s.name for s in (*block.inputs, *block.outputs)}
    return rename(block, {old: new for old, new in ports.items() if old in own})
