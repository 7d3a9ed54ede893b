"""All actuators of K06's craft for one loop: beside the law, on board, and in the plant."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.craft.hardware.actuators.command import force_command
from hovercontrol.craft.hardware.actuators.k06 import RUDDER_OFFSET, RUDDER_SLOPE, ideal_fan, ideal_servo
from hovercontrol.craft.hardware.actuators.rudder import rudder_lookup, rudder_servo
from hovercontrol.craft.hardware.actuators.signals import TICK, UPDATE
from hovercontrol.craft.hardware.actuators.speed import fan_motor, speed_controller
from hovercontrol.craft.hardware.actuators.tables import FanTable, ServoTable
from hovercontrol.craft.hardware.actuators.thrust import thrust_force, thrust_lookup


@checked
@dataclass(frozen=True)
class Actuators:
    """The actuators of one loop, by where they run.

    Attributes
    ----------
    pilot : tuple of Block
        Dead zone and lookups, which tick with the control law; a radio link follows them. Inputs ``force_x,
        force_y``, outputs ``servo_command``, ``fan_speed_command``.
    board : tuple of Block
        The servo and the speed controller; outputs ``rudder_angle``, ``fan_speed_set``.
    body : Block
        Motor and force; outputs ``thrust``, ``rudder``, which the plant takes.

    Examples
    --------
    >>> [block.name for block in actuators().board]
    ['rudder_servo', 'speed_controller']
    """

    pilot: tuple[Block, ...]
    board: tuple[Block, ...]
    body: Block

    __repr__ = short_repr

    @property
    def sampled(self) -> tuple[Block, ...]:
        """The sampled Blocks after a law, in order."""
        return (*self.pilot, *self.board)

    def moving(self, plant: Block) -> Block:
        """Return the plant with motor and force; its inputs are the outputs of the actuators on board."""
        return interconnect([plant, self.body], plant.name)


@checked
def actuators(
    *,
    tables: tuple[FanTable, FanTable] | None = None,
    servo: ServoTable | None = None,
    dead_zone: float = 0.05,
    limit: float = 0.0,
    slew: float = 0.0,
    brake: float = 0.150,
    lag: float = 0.0,
    update: float = UPDATE,
    period: float = TICK,
    ideal: bool = False,
) -> Actuators:
    """Return all actuators of K06's craft, each imperfection with a switch.

    Parameters
    ----------
    tables : tuple of two FanTable, optional
        Speeds over forces, forces over speeds. Default: K06's stand-ins.
    servo : ServoTable, optional
        Default: K06's stand-in.
    dead_zone, limit : float, optional
        [N], see :func:`force_command`.
    slew : float, optional
        [rad/s], see :func:`rudder_servo`.
    brake : float, optional
        [s], see :func:`speed_controller`.
    lag : float, optional
        [s], see :func:`fan_motor`.
    update : float, optional
        Time between two commands to servo and speed controller [s].
    period : float, optional
        Base tick [s], the law's.
    ideal : bool, optional
        Switch all imperfections off: the plant gets the commanded force, within rounding. Then only the
        period may be given as well.

    Returns
    -------
    Actuators

    Raises
    ------
    InputError
        If a number is negative, or another argument than the period is given with ``ideal``.

    Examples
    --------
    >>> [block.name for block in actuators().sampled]
    ['command', 'rudder_lookup', 'thrust_lookup', 'rudder_servo', 'speed_controller']
    """
    defaults = (None, None, 0.05, 0.0, 0.0, 0.150, 0.0, UPDATE)
    slope, offset = RUDDER_SLOPE, RUDDER_OFFSET
    if ideal:
        if (tables, servo, dead_zone, limit, slew, brake, lag, update) != defaults:
            raise InputError("actuators: with ideal=True, expected no other argument than period")
        tables, servo, dead_zone, brake, update = ideal_fan(), ideal_servo(), 0.0, 0.0, period
        slope, offset = -1.0, 0.0
    lookup, force = tables or (None, None)
    return Actuators(
        (
            _ticking(force_command(dead_zone=dead_zone, limit=limit), period),
            rudder_lookup(table=servo, period=period, slope=slope, offset=offset),
            thrust_lookup(table=lookup, period=period),
        ),
        (
            rudder_servo(table=servo, slew=slew, period=update),
            speed_controller(brake=brake, update=update, period=period),
        ),
        interconnect(
            [fan_motor(lag=lag), thrust_force(table=force, slope=slope, offset=offset)], "actuators"
        ),
    )


def _ticking(block: Block, period: float) -> Block:
    """Return a Block without states as a sampled one: its outputs are held between ticks."""
    return replace(block, period=period)
