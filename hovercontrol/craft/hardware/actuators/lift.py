"""The lift fan: while it is off, the craft stands on its skirt and dry friction holds it."""

from __future__ import annotations

from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

#: Command of the lift fan, K06's "Lift Mode" (K06 figure 5.2).
LIFT = Signal("lift", "1", "lift fan", modes=("off", "on"))

#: Dry friction of the floor on a craft that does not hover, as the plant's effects have it.
FLOOR = (
    Signal("floor_surge", "m/s^2", "dry friction of the floor against surge"),
    Signal("floor_sway", "m/s^2", "dry friction of the floor against sway"),
    Signal("floor_yaw", "rad/s^2", "dry friction of the floor against yaw"),
)


def skirt_on_floor(
    *, friction: float = 0.5, radius: float = 0.15, body: Body = HOVERDEMON_BODY, name: str = "skirt"
) -> Block:
    """Return the dry friction of the floor: zero while the lift fan runs.

    K06 prints no friction of the skirt: coefficient and radius are stand-ins. The thrust, 0.8 m/s^2 at most,
    is far below this friction, so it does not move a craft whose lift is off.

    Parameters
    ----------
    friction : float, optional
        Coefficient of dry friction of the skirt on the floor.
    radius : float, optional
        Mean distance of the skirt from the centre of mass [m].

    Returns
    -------
    Block
        Without states. Input ``lift``; outputs ``floor_surge, floor_sway`` [m/s^2], ``floor_yaw`` [rad/s^2].

    Raises
    ------
    InputError
        If a number is negative.

    Examples
    --------
    >>> skirt_on_floor().to_numpy().outputs(0.0, (), [0.0]).round(1).tolist()
    [4.9, 4.9, 19.9]
    """
    mu = Signal("friction", "1", "of the skirt", start=not_negative(f"{name}: friction", friction), lower=0.0)
    arm = Signal("radius", "m", "of the skirt", start=not_negative(f"{name}: radius", radius), lower=0.0)
    mass = Signal("mass", "kg", "of the craft", start=body.mass, lower=0.0)
    inertia = Signal("inertia", "kg*m^2", "of the craft", start=body.inertia, lower=0.0)
    gravity = Signal("gravity", "m/s^2", "standard gravity", start=9.80665, nominal=10.0)
    held = (1 - LIFT.symbol) * mu.symbol * gravity.symbol
    turning = held * arm.symbol * mass.symbol / inertia.symbol
    return Block(
        name,
        inputs=(LIFT,),
        outputs=FLOOR,
        parameters=(mu, arm, mass, inertia, gravity),
        output_expressions=dict(zip((s.name for s in FLOOR), (held, held, turning), strict=True)),
    )
