"""The linear discrete-time system of a hybrid Block whose parts all have the same period h.

At a tick the states z = (x, s), x continuous and s sampled, jump. Until the next tick they flow with held
inputs w:

    s+ = T(z, w),                     x' = f(x, s+, w),    z(k + 1) = (x(t_k + h), s+).

With A, B the Jacobians of f, and Z the Jacobian of z after the tick by (z, w) before it,

    z(k + 1) = exp(h [A B; 0 0]) (Z (z, w); w),    y(k) = C Z (z, w) + D w,

because the outputs of a tick are those after it [Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed.,
section 2.3].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.friction_slopes import Point, Slope, linear_matrices
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions


def common_period(block: Block) -> float:
    """Return the common period of the sampled parts of a hybrid Block [s].

    Raises
    ------
    InputError
        If their periods differ.
    """
    periods = sorted({tick.period for tick in block.ticks})
    if len(periods) > 1:
        text = ", ".join(f"{p:g} s" for p in periods)
        raise InputError(block.where(f"its parts tick every {text}: a linear system needs one period"))
    return periods[0]


def without_ticks(block: Block) -> Block:
    """Return a hybrid Block between its ticks, with constant sampled states."""
    return block.unchecked(ticks=())


def hybrid_matrices(
    block: Block, point: Point, friction: Slope = "smooth", amplitude: Mapping[str, float] | None = None
) -> list[Array]:
    """Return A, B, C, D of a hybrid Block from tick to tick; the states are those before a tick.

    Parameters
    ----------
    block : Block
        Hybrid, with one common period.
    point : Point
        State before a tick.
    friction, amplitude
        As for :meth:`hovercontrol.Block.linearize`.

    Raises
    ------
    InputError
        If the parts have different periods, or as for :func:`.linear_matrices`.

    Examples
    --------
    >>> from hovercontrol import Signal, interconnect
    >>> v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = {"a": -k.symbol * v.symbol}
    >>> loop = interconnect([cart, Block("law", [], [v], [a], [k], {}, law, period=0.25)])
    >>> A, *_ = hybrid_matrices(loop, Point(0.0, np.zeros(2), np.zeros(0), {}))
    >>> A.tolist()  # v(k + 1) = (1 - h k) v(k), held a = -k v
    [[0.5, 0.0], [-2.0, 0.0]]
    """
    period, plain = common_period(block), without_ticks(block)
    names = [s.name for s in block.states]
    n, m = len(names), len(block.inputs)
    A, B, C, D = linear_matrices(plain, point, friction, amplitude)
    inputs = np.eye(n + m)[n:]
    after = np.eye(n, n + m)  # Z
    # rows of Z for the states that a tick sets: dT/dz Z + dT/dw [0 I], with the Z that earlier ticks left
    for tick in block.ticks:
        told = plain.unchecked(
            outputs=tuple(block.signal(name) for name in tick.updates),
            output_expressions=Expressions(tick.updates),
        )
        _, _, by_state, by_input = linear_matrices(told, point, friction, amplitude)
        jumped = by_state @ after + by_input @ inputs
        after = after.copy()
        after[[names.index(name) for name in tick.updates]] = jumped
    flow = scipy.linalg.expm(period * np.vstack([np.hstack([A, B]), np.zeros((m, n + m))]))[:n]
    whole = flow @ np.vstack([after, inputs])
    shown = C @ after + D @ inputs
    return [whole[:, :n], whole[:, n:], shown[:, :n], shown[:, n:]]
