"""Thrusters of the real loop: K06's reversing fan, or a variable-pitch propeller in its place."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.limits import fan_ends
from hovercontrol.craft.hardware.actuators import (
    FanTable,
    ideal_fan,
    speed_controller,
    thrust_force,
    thrust_lookup,
)
from hovercontrol.craft.hardware.actuators.pitch import (
    PITCH_COMMAND,
    VariablePitch,
    pitch_lookup,
    pitch_servo,
    pitch_thrust,
)
from hovercontrol.craft.hardware.actuators.signals import FAN_SPEED_COMMAND

#: Slope and offset of (4.3) for an ideal rudder.
STRAIGHT = {"slope": -1.0, "offset": 0.0}


@dataclass(frozen=True)
class Thruster:
    """The parts of a thruster on both sides of the link, each map in a real and an ideal version.

    Attributes
    ----------
    command : Signal
        The command sent over the link.
    ends : tuple of 2 float
        Smallest and largest force that may be requested [N].
    lookups : tuple of 2 Block
        Maps from force to command, real and ideal; without states.
    drive : Block
        The onboard drive, which follows the command; sampled.
    forces : tuple of 2 Block
        Maps from the drive's output to the force, real and ideal; without states.
    """

    command: Signal
    ends: tuple[float, float]
    lookups: tuple[Block, Block]
    drive: Block
    forces: tuple[Block, Block]


def reversing_fan(tables: tuple[FanTable, FanTable], period: float) -> Thruster:
    """Return K06's reversing fan: its tables, and the speed controller with its brake.

    Parameters
    ----------
    tables : tuple of two FanTable
        Speeds over forces, forces over speeds.
    period : float
        Base tick [s].
    """
    lookup, reverse = tables
    ideal = ideal_fan()
    return Thruster(
        FAN_SPEED_COMMAND,
        fan_ends(tables),
        (
            thrust_lookup(table=lookup, period=0.0),
            thrust_lookup(table=ideal[0], period=0.0, name="thrust_lookup_ideal"),
        ),
        speed_controller(update=0.0, period=period),
        (thrust_force(table=reverse), thrust_force(table=ideal[1], name="thrust_force_ideal", **STRAIGHT)),
    )


def variable_pitch(propeller: VariablePitch, period: float) -> Thruster:
    """Return a variable-pitch propeller.

    Parameters
    ----------
    period : float
        Base tick [s].
    """
    ideal = replace(propeller, thrust=20.0, inflow=0.0, rudder_loss=0.0, ideal=True)
    return Thruster(
        PITCH_COMMAND,
        (-propeller.thrust, propeller.thrust),
        (pitch_lookup(propeller), pitch_lookup(ideal, name="pitch_lookup_ideal")),
        pitch_servo(lag=propeller.lag, period=period),
        (pitch_thrust(propeller), pitch_thrust(ideal, name="pitch_thrust_ideal", **STRAIGHT)),
    )
