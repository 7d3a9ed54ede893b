"""Times at which a Block's equations switch: a waypoint passed, a pulse, a step at a set time.

A solver takes steps of seconds while nothing moves, and so can skip a whole manoeuvre.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise

import sympy as sp
from sympy.core.relational import Relational

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import time


def switching_times(block: Block, params: Mapping[str, float] | None = None) -> tuple[float, ...]:
    """Return the times [s] at which conditions on time change, sorted.

    Only conditions (``Piecewise``, ``Heaviside``) that are linear in time and otherwise depend on parameters
    are found, not those that depend on states or inputs.

    Parameters
    ----------
    params : mapping, optional
        Parameter values by key; others have their defaults.

    Examples
    --------
    >>> from hovercontrol.control.controllers.references import waypoints
    >>> switching_times(waypoints([[0, 0], [1, 0], [1, 1]], [50.0, 51.0, 53.0]))
    (50.0, 51.0, 53.0)
    """
    if not switching_conditions(block):
        return ()
    values = {
        p.symbol: v
        for p, v in zip(block.parameters, block.parameter_values(params, bounded=False), strict=True)
    }
    # condition c_0 + c_1 t changes at t = -c_0/c_1
    found = set()
    for offset, slope in switching_conditions(block):
        rate = float(slope.subs(values))
        if rate != 0.0:
            found.add(round(-float(offset.subs(values)) / rate, 12))
    return tuple(sorted(found))


def longest_step(block: Block, params: Mapping[str, float] | None, begin: float, end: float) -> float:
    """Return the longest safe solver step [s]: half the shortest time between two switching times."""
    inside = [t for t in switching_times(block, params) if begin <= t <= end]
    gaps = [b - a for a, b in pairwise(inside)]
    return 0.5 * min(gaps, default=math.inf)


@lru_cache(maxsize=64)
def switching_conditions(block: Block) -> tuple[tuple[sp.Expr, sp.Expr], ...]:
    """Return c_0 and c_1 of each condition on time; the condition changes where c_0 + c_1 t = 0."""
    known = {time, *(p.symbol for p in block.parameters)}
    expressions = [
        *block.definitions.values(),
        *block.derivatives.values(),
        *block.output_expressions.values(),
    ]  # a tick evaluates its conditions only when it is due
    curves = {r.lhs - r.rhs for e in expressions for r in e.atoms(Relational)}
    curves |= {h.args[0] for e in expressions for h in e.atoms(sp.Heaviside)}
    found = []
    for curve in sorted(curves, key=str):
        slope = sp.diff(curve, time)
        if slope != 0 and curve.free_symbols <= known and time not in slope.free_symbols:
            found.append((curve.subs(time, 0), slope))
    return tuple(found)
