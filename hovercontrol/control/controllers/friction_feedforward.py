"""Dry friction of states at rest as a known disturbance of a linear-quadratic design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.friction_slopes import Point
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.friction import dry_frictions
from hovercontrol.blocks.functions import array_function
from hovercontrol.blocks.sgn import sgn

#: A state is at rest if its velocity is below this many smoothing widths.
AT_REST = 3.0

#: Width of the feedforward's sgn in smoothing widths of the plant: noise of a velocity does not switch it.
WIDER = 5.0


@dataclass(frozen=True)
class Friction:
    """Dry friction in one state at rest, ``v' = ... + level sgn(v)``.

    Parameters
    ----------
    state : int
        Index of v among the plant's states.
    level : float
        In the unit of v'; negative where friction brakes.
    width : float
        Of the feedforward's sgn, in the unit of v.
    """

    state: int
    level: float
    width: float


def frictions_at_rest(plant: Block, point: Point, states: Sequence[int]) -> list[Friction]:
    """Return the dry frictions of some states that rest at an operating point.

    Where a state moves at the operating point its friction is constant, a part of the trim's inputs.

    Parameters
    ----------
    states : sequence of int
        Indices of the plant's states.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> ahead = Point(0.0, np.array([0, 0, 0, 1.0, 0, 0]), np.array([1.8, 0.0]), {})
    >>> [(plant.states[f.state].name, f.level) for f in frictions_at_rest(plant, ahead, range(6))]
    [('r', -0.83)]
    """
    try:
        found = dry_frictions(plant)
    except InputError:  # friction that does not enter linearly
        return []
    names = [s.name for s in plant.states]
    rest = []
    for friction in found:
        k = names.index(friction.state)
        own = {f for f in plant.derivatives[friction.state].atoms(sgn) if f.args[0] == plant.states[k].symbol}
        width = _value(plant, point, min((f.args[1] for f in own), key=str))
        level = _value(plant, point, friction.b)
        if k in states and level != 0.0 and abs(point.x[k]) < AT_REST * width:
            rest.append(Friction(k, level, WIDER * width))
    return rest


def _value(plant: Block, point: Point, expression: sp.Expr) -> float:
    p = plant.parameter_values(point.params, bounded=False)
    return float(array_function(plant, [expression])(point.t, point.x, point.u, p)[0])


def feedforward(A: Array, B: Array, E: Array, K: Array, P: Array, R: Array, *, sampled: bool) -> Array:
    """Return the optimal command for a constant disturbance d of ``x' = A x + B u + E d``, for each of d.

    The costate of the quadratic cost is ``P x + s`` with ``s' = -(A - B K)' s - P E d``. Where it rests::

        u = -K x + F d      F = R^-1 B' (A - B K)^-T P E

    and of ``x+ = A x + B u + E d``::

        F = -(R + B' P B)^-1 B' (I - (A - B K)')^-1 P E

    Parameters
    ----------
    A, B, E, K, P, R : ndarray
        Shapes (n, n), (n, m), (n, k), (m, n), (n, n), (m, m).
    sampled : bool
        Whether time is discrete.

    Returns
    -------
    ndarray, shape (m, k)

    Examples
    --------
    >>> one = np.eye(1)
    >>> feedforward(0 * one, one, one, one, one, one, sampled=False)
    array([[-1.]])
    """
    closed = (A - B @ K).T
    if sampled:
        s = np.linalg.solve(np.eye(len(A)) - closed, P @ E)
        return np.asarray(-np.linalg.solve(R + B.T @ P @ B, B.T @ s), dtype=float)
    return np.asarray(np.linalg.solve(R, B.T @ np.linalg.solve(closed, P @ E)), dtype=float)
