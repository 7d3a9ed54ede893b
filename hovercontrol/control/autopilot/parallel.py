"""The real loop and the ideal one in parallel, as K06 compares them (figure 6.1)."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, prefix
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

_MOVING = MOTION[3:]

#: Differences between the real and the ideal craft: in each velocity, and in all together.
GAPS = (
    *(Signal(f"gap_{s.name}", s.unit, f"{s.description}, real minus ideal") for s in _MOVING),
    Signal("gap", "m/s", "speed with the kinetic energy of the difference in motion"),
)


@checked
def beside_ideal(real: Block, ideal: Block, *, body: Body = HOVERDEMON_BODY, name: str = "both") -> Block:
    """Return two loops in parallel, with the differences of their motions.

    Parameters
    ----------
    real, ideal : Block
        Loops without inputs, with outputs ``x ... r``.
    body : Body, optional
        Its inertia J and mass m weight the yaw rate against the velocities.
    name : str, optional

    Returns
    -------
    Block
        Outputs: those of the real loop, those of the ideal one with the prefix ``ideal_``, ``gap_u, gap_v``
        [m/s], ``gap_r`` [rad/s] and ``gap`` [m/s]: ``sqrt(gap_u^2 + gap_v^2 + J/m gap_r^2)``. Parameters of
        the ideal loop have the prefix ``ideal.``.

    Examples
    --------
    >>> from hovercontrol.control.autopilot import autopilot
    >>> from hovercontrol.control.controllers.k06 import force_to_command, stop
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> law = stop(k1=1.0, k2=2.5)
    >>> both = beside_ideal(autopilot(law), interconnect([hoverdemon().plant(), law, force_to_command()]))
    >>> [s.name for s in both.outputs][-4:]
    ['gap_u', 'gap_v', 'gap_r', 'gap']
    """
    mass = Signal("mass", "kg", "of the craft", start=body.mass, lower=0.0)
    inertia = Signal("inertia", "kg*m^2", "of the craft", start=body.inertia, lower=0.0)
    other = [s.replace(name=f"ideal_{s.name}") for s in _MOVING]
    apart = [s.symbol - o.symbol for s, o in zip(_MOVING, other, strict=True)]
    square = apart[0] ** 2 + apart[1] ** 2 + inertia.symbol / mass.symbol * apart[2] ** 2
    difference = Block(
        "difference",
        inputs=(*_MOVING, *other),
        outputs=GAPS,
        parameters=(mass, inertia),
        output_expressions={g.name: e for g, e in zip(GAPS, (*apart, sp.sqrt(square)), strict=True)},
    )
    return interconnect([real, prefix(ideal, "ideal"), difference], name)
