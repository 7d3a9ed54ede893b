"""Conversion of a law's force to the commands of a craft with a propeller and a rudder."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.signals import FORCE_X, FORCE_Y
from hovercontrol.craft.models.motion import RUDDER, THRUST


@checked
def force_to_command(*, dead_zone: float = 0.0, reversing: bool = False, name: str = "actuation") -> Block:
    """Return K06's conversion of a force vector to thrust and rudder ("Polar Coords", section 6.1.1).

    Parameters
    ----------
    dead_zone : float, optional
        Components no larger than this [N] count as zero, so that the fan does not chatter; K06's is 0.05.
    reversing : bool, optional
        Push backwards by reversing the fan, the rudder within +-90 degrees; else the rudder turns all round
        and the thrust is never negative, which is the exact inverse for an ideal craft.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``force_x, force_y`` [N]; outputs ``thrust`` [N], ``rudder`` [rad].

    Raises
    ------
    InputError
        If the dead zone is negative.

    Examples
    --------
    >>> f = force_to_command().to_numpy()
    >>> f.outputs(0.0, (), [0.0, 2.0]).round(4).tolist()
    [2.0, 1.5708]
    """
    not_negative("actuation: dead_zone", dead_zone)
    x, y = FORCE_X.symbol, FORCE_Y.symbol
    parameters: tuple[Signal, ...] = ()
    if dead_zone:
        zone = Signal("dead_zone", "N", "smaller components count as zero", start=dead_zone, lower=0.0)
        parameters = (zone,)
        x, y = (sp.Piecewise((f, sp.Abs(f) > zone.symbol), (0, True)) for f in (x, y))
    thrust: sp.Expr = sp.sqrt(x**2 + y**2)
    rudder: sp.Expr = sp.atan2(y, x)
    if reversing:
        backwards = x < 0
        thrust = sp.Piecewise((-thrust, backwards), (thrust, True))
        rudder = sp.Piecewise((sp.atan2(-y, -x), backwards), (rudder, True))
    return Block(
        name,
        inputs=(FORCE_X, FORCE_Y),
        outputs=(THRUST.replace(unit="N", description="force of the propeller"), RUDDER),
        parameters=parameters,
        output_expressions={"thrust": thrust, "rudder": rudder},
    )


@checked
def force_driven(plant: Block) -> Block:
    """Return a rudder craft's plant with the force vector as its input [K06 eq 2.10, 2.11].

    It is the plant behind :func:`force_to_command` in one Block: polar coordinates, which have no
    direction at zero force, cancel, so that loops can be linearised at rest.

    Parameters
    ----------
    plant : Block
        Of a model in which thrust and rudder act as ``T cos(theta)`` and ``T sin(theta)`` only.

    Returns
    -------
    Block
        The plant with inputs ``force_x, force_y`` [N] in place of ``thrust, rudder``.

    Raises
    ------
    InputError
        If an effect needs thrust or rudder otherwise, or the plant has no such inputs.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> print(force_driven(vehicle("hoverdemon").plant()).equations().splitlines()[5])
    r' = -force_y*plant.rudder_torque
    """
    missing = {"thrust", "rudder"} - {s.name for s in plant.inputs}
    if missing:
        raise InputError(
            f"block {plant.name!r}: expected the inputs thrust and rudder, none is {missing.pop()!r}"
        )
    joined = interconnect([plant, force_to_command()])
    own = {joined.signal(f"{plant.name}.{s.name}").symbol: s.symbol for s in plant.states}
    slopes = {
        s.name: joined.expand(joined.derivatives[f"{plant.name}.{s.name}"]).xreplace(own)
        for s in plant.states
    }
    length = sp.sqrt(FORCE_X.symbol**2 + FORCE_Y.symbol**2)
    if any(e.has(length, sp.atan2) for e in slopes.values()):
        raise InputError(f"block {plant.name!r}: expected thrust and rudder to act only as a force vector")
    kept = tuple(s for s in plant.outputs if s.name in {state.name for state in plant.states})
    return Block(plant.name, plant.states, (FORCE_X, FORCE_Y), kept, plant.parameters, slopes)
