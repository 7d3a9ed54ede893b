"""Wrapped headings for guidance: released at 6.4 rad/s, the craft turns several times before it stops."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.control.controllers.k06.heading import HEADING_REF
from hovercontrol.craft.models.motion import MOTION


@checked
def nearest_heading(guidance: Block) -> Block:
    """Return guidance whose heading input is shifted by whole turns to within pi of the goal.

    K06 draws the headings of figure 6.11 within 0 ... 7 rad although the craft turns several times, so whole
    turns are ignored. Goals of 5 and -1.28 rad are then the same.

    Parameters
    ----------
    guidance : Block
        Sampled, with inputs ``psi`` and ``heading_ref``; other guidance is returned unchanged.

    Examples
    --------
    >>> from hovercontrol.control.controllers.k06 import bang_bang_heading
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> calm = {"psi": 7.0, "u": 0.0, "v": 0.0, "r": 0.0, "heading_ref": 0.5}
    >>> round(Ticking(nearest_heading(bang_bang_heading())).tick(0.0, calm)["heading_error"], 4)
    0.2168
    """
    if HEADING_REF.name not in {s.name for s in guidance.inputs}:
        return guidance
    # psi_nearest = psi_ref + atan2(sin(psi - psi_ref), cos(psi - psi_ref)).
    psi = MOTION[2]
    off = psi.symbol - HEADING_REF.symbol
    told = psi.replace(name="psi_nearest", description="heading, whole turns removed")
    turns = Block(
        "whole_turns",
        inputs=(psi, HEADING_REF),
        outputs=(told,),
        output_expressions={told.name: HEADING_REF.symbol + sp.atan2(sp.sin(off), sp.cos(off))},
    )
    outputs = [s.name for s in guidance.outputs]
    return interconnect([turns, rename(guidance, {psi.name: told.name})], guidance.name, outputs=outputs)
