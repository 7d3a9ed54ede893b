"""States that start at zero and stay there whatever happens, and a Block without them.

A Kalman-Bucy estimator of coefficients that do not act on one another is the case: of the 66 covariances of
C17's estimator 28 stay exactly zero when they start there. Nothing is lost by not computing them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.expressions import Expressions


@lru_cache(maxsize=64)
def without_resting_states(block: Block) -> tuple[Block, tuple[int, ...]]:
    """Return a Block without the states that rest at zero, and the places of the states it keeps.

    The states that rest are the largest set that starts at zero and whose derivatives vanish identically when
    all of the set is zero: whatever the other states, inputs, parameters and time.

    Parameters
    ----------
    block : Block

    Returns
    -------
    Block
        The Block itself where no state rests. Its other states move as before, to rounding.
    tuple of int
        Places of the kept states among the Block's.

    Examples
    --------
    >>> from hovercontrol.core.signals import Signal
    >>> x, y, k = Signal("x", start=1.0), Signal("y"), Signal("k", "1/s", start=2.0)
    >>> f = {"x": -k.symbol * x.symbol, "y": k.symbol * x.symbol * sp.sin(y.symbol)}
    >>> without_resting_states(Block("two", [x, y], [], [x], [k], f))[1]
    (0,)
    """
    if block.ticks:  # what ticks set is not looked at
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
