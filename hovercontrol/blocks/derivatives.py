"""Exact partial derivatives of a Block, by the chain rule through its definitions.

Each definition is differentiated once and its derivatives are reused, so that the cost does not grow with the
number of its uses: even the C17 loop with its estimator, with 83 states, is differentiated at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import sympy as sp

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block


def partial_derivatives(
    block: Block, rows: Literal["derivatives", "outputs"], names: Sequence[str]
) -> dict[tuple[int, int], sp.Expr]:
    """Return the nonzero entries of a Jacobian; expressions may use the Block's definitions.

    Parameters
    ----------
    rows : {"derivatives", "outputs"}
    names : sequence of str
        Signals z_j with respect to which to differentiate: states, inputs or parameters.

    Returns
    -------
    dict of (int, int) to sympy.Expr
        Row and column of each entry that is not identically zero.
    """
    columns = {sp.Symbol(name, real=True): j for j, name in enumerate(names)}
    through: dict[sp.Symbol, dict[int, sp.Expr]] = {}

    # chain rule: de/dz_j = sum_s (partial e / partial s) ds/dz_j over the symbols s of e; ds/dz_j is 1 for
    # s = z_j, known for a definition s, and 0 otherwise
    def gradient(expression: sp.Expr) -> dict[int, sp.Expr]:
        total: dict[int, sp.Expr] = {}
        for symbol in sorted(expression.free_symbols, key=str):
            parts = {columns[symbol]: sp.S.One} if symbol in columns else through.get(symbol, {})
            if parts:
                local = _almost_everywhere(_slope(expression, symbol))
                for j, inner in parts.items():
                    total[j] = total.get(j, sp.S.Zero) + local * inner
        return {j: value for j, value in total.items() if value != 0}

    expressions = block.derivatives if rows == "derivatives" else block.output_expressions
    for name in needed_definitions(block, expressions.values()):  # other definitions may occur only in ticks
        through[sp.Symbol(name, real=True)] = gradient(block.definitions[name])
    return {
        (i, j): value
        for i, expression in enumerate(expressions.values())
        for j, value in gradient(expression).items()
    }


def needed_definitions(block: Block, wanted: Iterable[sp.Expr]) -> list[str]:
    """Return the definitions that some expressions use, directly or through others, in their order."""
    symbols: set[sp.Symbol] = set().union(*(e.free_symbols for e in wanted))
    needed = []
    for name, e in reversed(list(block.definitions.items())):
        if sp.Symbol(name, real=True) in symbols:
            needed.append(name)
            symbols |= e.free_symbols
    return needed[::-1]


def _slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return a derivative; signs that do not depend on the symbol are constants.

    SymPy 1.14 may recurse without end where it differentiates ``p + sign(Max(..) - Max(..)) q`` by q.
    """
    kept = {f: sp.Dummy(real=True) for f in expression.atoms(sp.sign) if symbol not in f.free_symbols}
    slope = sp.diff(expression.xreplace(kept), symbol)
    return slope.xreplace({dummy: f for f, dummy in kept.items()})


def _almost_everywhere(derivative: sp.Expr) -> sp.Expr:
    """Remove the impulses at jumps (of sign, Heaviside, floor); between jumps the derivative is zero."""
    if derivative.has(sp.DiracDelta):
        derivative = derivative.replace(sp.DiracDelta, lambda *_: sp.S.Zero)
    if derivative.has(sp.Derivative):
        derivative = derivative.replace(sp.Subs, lambda *_: sp.S.Zero).replace(
            sp.Derivative, lambda *_: sp.S.Zero
        )
    return derivative


@lru_cache(maxsize=256)
def nonzero_parameters(block: Block) -> frozenset[str]:
    """Return parameters that keep their sign: at zero the equations or their derivatives are not defined.

    Examples
    --------
    >>> from hovercontrol.blocks.block import Block
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, F, m, c = Signal("v", "m/s"), Signal("F", "N"), Signal("m", "kg", start=2.0), Signal("c", "1/s")
    >>> slope = F.symbol / m.symbol - c.symbol * v.symbol
    >>> sorted(nonzero_parameters(Block("cart", [v], [F], [v], [m, c], {"v": slope})))
    ['m']
    """
    names = [p.name for p in block.parameters]
    found: set[str] = set()
    for rows in ("derivatives", "outputs"):
        laws = block.derivatives if rows == "derivatives" else block.output_expressions
        values = [block.expand(e) for e in laws.values()]
        for (i, j), e in partial_derivatives(block, rows, names).items():
            slope, own = block.expand(e), sp.Symbol(names[j], real=True)
            if names[j] in found or own not in slope.free_symbols:  # linear: defined everywhere
                continue
            if any(f.subs(own, 0).has(*_UNDEFINED) for f in (values[i], slope)):
                found.add(names[j])
    return frozenset(found)


#: What an expression has where it is not defined.
_UNDEFINED = (sp.zoo, sp.nan, sp.oo, sp.S.NegativeInfinity)


@lru_cache(maxsize=256)
def linear_parameters(block: Block) -> tuple[str, ...]:
    """Return parameters in which all derivatives are jointly linear, chosen greedily in their order."""
    names = [p.name for p in block.parameters]
    entries = {k: block.expand(e) for k, e in partial_derivatives(block, "derivatives", names).items()}
    # jointly linear: partial^2 f / (partial p_i partial p_j) = 0 for all chosen p_i, p_j
    chosen: list[str] = []
    for j, name in enumerate(names):
        column = [e for (_, k), e in entries.items() if k == j]
        taken = {sp.Symbol(n, real=True) for n in (*chosen, name)}
        before = [e for (_, k), e in entries.items() if names[k] in chosen]
        own = sp.Symbol(name, real=True)
        if (
            column
            and not any(e.free_symbols & taken for e in column)
            and not any(own in e.free_symbols for e in before)
        ):
            chosen.append(name)
    return tuple(chosen)
