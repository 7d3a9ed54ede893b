"""Find the states that start at zero and always stay there, and return a Block without them.

Such states occur in a Kalman-Bucy estimator of independent coefficients: of the 66 covariances of C17's
estimator, 28 stay exactly zero if they start at zero. They need not be computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions


@lru_cache(maxsize=64)
def without_resting_states(block: Block) -> tuple[Block, tuple[int, ...]]:
    """Return a Block without the states that rest at zero, and the indices of the kept states.

    The resting states are the largest set R of states that start at zero and whose derivatives vanish
    identically while the set is zero: f_i(t, x, u, p) = 0 for all i in R if x_j = 0 for all j in R, for all
    other states, inputs, parameters and times.

    Returns
    -------
    Block
        The Block without the resting states, or the Block itself if there are none. The other states are
        unchanged to rounding.
    tuple of int
        Indices of the kept states among the Block's states.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> x, y, k = Signal("x", start=1.0), Signal("y"), Signal("k", "1/s", start=2.0)
    >>> f = {"x": -k.symbol * x.symbol, "y": k.symbol * x.symbol * sp.sin(y.symbol)}
    >>> without_resting_states(Block("two", [x, y], [], [x], [k], f))[1]
    (0,)
    """
    if block.ticks:  # states that ticks set are not examined
        return block, tuple(range(len(block.states)))
    rest = {s.symbol for s in block.states if s.start == 0.0}
    while True:
        zeros = dict.fromkeys(rest, sp.S.Zero)
        for name, e in block.definitions.items():
            if e.xreplace(zeros) == 0:
                zeros[sp.Symbol(name, real=True)] = sp.S.Zero
        still = {s for s in rest if block.derivatives[s.name].xreplace(zeros) == 0}
        if still == rest:
            break
        rest = still
    states = tuple(s for s in block.states if s.symbol not in rest)

    def reduced(expressions: Mapping[str, sp.Expr]) -> Expressions:
        return Expressions((name, e.xreplace(zeros)) for name, e in expressions.items())

    smaller = block.unchecked(
        states=states,
        derivatives=reduced({s.name: block.derivatives[s.name] for s in states}),
        definitions=reduced(block.definitions),
        output_expressions=reduced(block.output_expressions),
    )
    every = (smaller.derivatives, smaller.definitions, smaller.output_expressions)
    undefined = any(e.has(sp.nan, sp.zoo) for group in every for e in group.values())
    if undefined or len(states) in (0, len(block.states)):
        return block, tuple(range(len(block.states)))
    return smaller, tuple(k for k, s in enumerate(block.states) if s.symbol not in rest)
