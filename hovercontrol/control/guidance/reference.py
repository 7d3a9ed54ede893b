"""The stick as a reference for C17's tracking controller: the path of a virtual craft that obeys it."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.references import OUTPUTS as REFERENCE
from hovercontrol.control.guidance.commands import DESIRED
from hovercontrol.control.guidance.steering import inverse_dynamics
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION, motion_symbols


@checked
def steering_reference(
    model: Model,
    *,
    control_point: float = 0.2,
    start: Mapping[str, float] | None = None,
    name: str = "reference",
) -> Block:
    """Return the reference of a virtual craft that has the desired surge velocity and yaw rate.

    The virtual craft obeys the model's equations with the thrust that gives it u_d' and r_d'; its sway
    velocity follows from them. The reference is the path of its control point,

    ``p_d = p + R delta``, ``p_d' = R [u, v + dx r]``, ``p_d'' = R [u' - r (v + dx r), v' + dx r' + r u]``,

    so that the surge velocity of a craft that tracks it is the desired one and not its part of the speed.

    Parameters
    ----------
    model : Model
        The craft; without sway drag the virtual craft's sway velocity grows while it turns.
    control_point : float, optional
        delta_x [m]; that of :func:`~hovercontrol.control.controllers.tracking_controller`.
    start : mapping, optional
        Where the virtual craft begins, by ``x, y`` [m], ``psi`` [rad], ``v`` [m/s]; default all zero.
    name : str, optional

    Returns
    -------
    Block
        Inputs the four desired values of :func:`~hovercontrol.control.guidance.command_filter`; outputs
        ``x_ref`` ...
        ``ay_ref`` and ``psi_ref`` [rad], the heading of the virtual craft. States ``craft_x, craft_y,
        craft_psi, craft_v``.

    Raises
    ------
    InputError
        If a start value has an unknown name, or the model cannot be driven and turned.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> [s.name for s in steering_reference(c17_simulation()).states]
    ['craft_x', 'craft_y', 'craft_psi', 'craft_v']
    """
    finite(f"{name}: control_point", control_point)
    known = {s.name: s for s in MOTION if s.name in ("x", "y", "psi", "v")}
    begin = dict(start or {})
    if unknown := set(begin) - set(known):
        raise InputError(f"{name}: start has x, y, psi and v, found {sorted(unknown)[0]!r}")
    states = {
        key: s.replace(
            name=f"craft_{key}",
            description=f"{s.description} of the virtual craft",
            start=finite(f"{name}: start {key}", begin.get(key, 0.0)),
        )
        for key, s in known.items()
    }
    dx = Signal("control_point", "m", "delta_x: tracking point ahead of the centre", start=control_point)
    x, y, psi, v = (states[key].symbol for key in ("x", "y", "psi", "v"))
    u, u_slope, r, r_slope = (d.symbol for d in DESIRED)
    s = motion_symbols(model.fans)
    _, slope = inverse_dynamics(model, name, u_slope, r_slope)
    slope = slope.xreplace({s.x: x, s.y: y, s.psi: psi, s.u: u, s.v: v, s.r: r})
    v_slope, d = sp.Symbol("craft_v_slope", real=True), dx.symbol
    cos, sin = sp.cos(psi), sp.sin(psi)

    def earth(ahead: sp.Expr, left: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        return cos * ahead - sin * left, sin * ahead + cos * left

    values = (
        x + d * cos,
        y + d * sin,
        *earth(u, v + d * r),
        *earth(u_slope - r * (v + d * r), v_slope + d * r_slope + r * u),
    )
    heading = Signal("psi_ref", "rad", "heading of the virtual craft")
    moving = dict(zip(("craft_x", "craft_y"), earth(u, v), strict=True))
    return Block(
        name,
        states=tuple(states.values()),
        inputs=DESIRED,
        outputs=(*REFERENCE, heading),
        parameters=(dx, *(p for p in model.parameters(name) if p.symbol in slope.free_symbols)),
        definitions={"craft_v_slope": slope},
        derivatives={**moving, "craft_psi": r, "craft_v": v_slope},
        output_expressions={q.name: e for q, e in zip(REFERENCE, values, strict=True)} | {"psi_ref": psi},
    )
