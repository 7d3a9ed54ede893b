"""From the force that a law commands to the magnitude and angle for the actuators."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.force import force_to_command
from hovercontrol.craft.hardware.actuators.signals import FORCE_ANGLE_COMMAND, THRUST_COMMAND


@checked
def force_command(*, dead_zone: float = 0.05, limit: float = 0.0, name: str = "command") -> Block:
    """Return K06's "Polar Coords" block with its dead zone, and a saturation of the force (section 6.1.1).

    It is :func:`~hovercontrol.control.controllers.k06.force_to_command`; for a force astern the fan reverses.

    Parameters
    ----------
    dead_zone : float, optional
        Components no larger than this [N] count as zero; 0 switches it off.
    limit : float, optional
        Largest force [N], limited at constant angle; 0 (the default) for no limit: K06's tables end at 2 N.
    name : str, optional

    Returns
    -------
    Block
        Without states. Inputs ``force_x, force_y`` [N]; outputs ``thrust_command`` [N], negative astern, and
        ``force_angle_command`` [rad].

    Raises
    ------
    InputError
        If a number is negative.

    Examples
    --------
    >>> block = force_command(limit=2.0)
    >>> block.to_numpy().outputs(0.0, (), [-3.0, 0.04]).tolist()
    [-2.0, 0.0]
    """
    not_negative(f"{name}: limit", limit)
    polar = force_to_command(dead_zone=dead_zone, reversing=True, name=f"{name}_polar")
    ports = {"thrust": "wanted_thrust", "rudder": FORCE_ANGLE_COMMAND.name}
    wanted, most = (
        Signal("wanted_thrust", "N", "before the limit"),
        Signal("limit", "N", "largest force; 0: no limit", start=limit, lower=0.0),
    )
    F, L = wanted.symbol, most.symbol
    kept = Block(
        f"{name}_limit",
        inputs=(wanted,),
        outputs=(THRUST_COMMAND,),
        parameters=(most,),
        output_expressions={"thrust_command": sp.Piecewise((sp.Max(-L, sp.Min(L, F)), L > 0), (F, True))},
    )
    shown = [THRUST_COMMAND.name, FORCE_ANGLE_COMMAND.name]
    return interconnect([rename(polar, ports), kept], name, outputs=shown)
