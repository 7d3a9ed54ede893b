"""A Block that assumes constant velocities: the baseline that a model must beat."""

from __future__ import annotations

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions


def coasting(block: Block) -> Block:
    """Return the Block with all states constant except those that follow from others by kinematics alone.

    A state is kinematic if its derivative contains neither a parameter nor an input: a pose moves on with
    constant velocities.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> print(coasting(hoverdemon().plant()).equations())
    x' = u*cos(psi) - v*sin(psi)
    y' = u*sin(psi) + v*cos(psi)
    psi' = r
    u' = 0
    v' = 0
    r' = 0
    """
    driven = {s.symbol for s in (*block.parameters, *block.inputs)}
    return block.unchecked(
        derivatives=Expressions(
            (name, sp.Integer(0) if block.expand(e).free_symbols & driven else e)
            for name, e in block.derivatives.items()
        )
    )
