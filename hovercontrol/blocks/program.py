"""Straight-line programs: a Block's expressions as ordered assignments, common parts computed once.

Every backend that prints code (plain Python, NumPy, C) prints the same program.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.simplify.cse_main import opt_cse

from hovercontrol.blocks.derivatives import needed_definitions
from hovercontrol.blocks.expressions import rebuilt
from hovercontrol.blocks.sgn import regularise

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block


class Program:
    """Assignments that compute a list of results.

    Parameters
    ----------
    block : Block
        The expressions may use its definitions.
    wanted : sequence of sympy.Expr
        The results; ``sgn`` is computed in its smooth form.

    Raises
    ------
    InputError
        If the Block has delayed inputs: a program for one instant cannot compute a delay.

    Attributes
    ----------
    steps : list of (sympy.Symbol, sympy.Expr)
        Ordered assignments: the definitions needed, under their names, and common subexpressions.
    results : list of sympy.Expr
    """

    def __init__(self, block: Block, wanted: Sequence[sp.Expr]) -> None:
        definitions, results = equations(block, wanted)
        pieces, reduced = common_parts([*definitions.values(), *results])
        bodies = dict(pieces) | {
            sp.Symbol(n, real=True): e for n, e in zip(definitions, reduced[: len(definitions)], strict=True)
        }
        self.results: list[sp.Expr] = list(reduced[len(definitions) :])
        self.steps = _in_order(bodies, self.results)

    def without_branches(self) -> Program:
        """Return the program with all values that a condition selects or compares computed beforehand."""
        flat = copy(self)
        flat.steps = []

        def name(e: sp.Expr) -> sp.Expr:
            if e.is_Atom:
                return e
            symbol = sp.Dummy(real=True)
            flat.steps.append((symbol, e))
            return symbol

        def lift(e: Any) -> Any:
            if not e.has(sp.Piecewise):
                return e
            if not isinstance(e, sp.Piecewise):
                return e.func(*(lift(a) for a in e.args))
            pairs = []
            for value, condition in e.args:
                swap = {r: r.func(*(name(lift(a)) for a in r.args)) for r in condition.atoms(Relational)}
                pairs.append((name(lift(value)), condition.xreplace(swap)))
            return sp.Piecewise(*pairs, evaluate=False)

        for symbol, e in self.steps:
            lifted = lift(e)  # appends the parts of e first
            flat.steps.append((symbol, lifted))
        flat.results = [lift(e) for e in self.results]
        return flat

    @property
    def symbols(self) -> set[sp.Symbol]:
        """All symbols in the program."""
        every = [*(e for _, e in self.steps), *self.results]
        return set().union(*(e.free_symbols for e in every))


def equations(block: Block, wanted: Sequence[sp.Expr]) -> tuple[dict[str, sp.Expr], list[sp.Expr]]:
    """Return the definitions that some expressions need, in order, and the expressions, for one instant.

    Raises
    ------
    InputError
        If the Block has delayed inputs.
    """
    block.need_prompt_inputs("a function of one instant")
    used = needed_definitions(block, wanted)
    return {n: regularise(block.definitions[n]) for n in used}, [regularise(e) for e in wanted]


def common_parts(wanted: Sequence[sp.Expr]) -> tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]:
    """Return assignments of the parts that occur repeatedly, ``_c0``, ..., and the expressions with them.

    This is ``sympy.cse``, but minima, maxima and conditions keep their arguments (see :func:`.rebuilt`), and
    what has no common part is not built again.
    """
    # sums and products with common terms, and powers, not evaluated; their arguments may be plain integers
    written: dict[sp.Basic, Any] = opt_cse(wanted, order="none")
    seen, repeated = set[Any](), set[Any]()

    def count(e: Any) -> None:
        if not getattr(e, "args", ()):
            return
        if not isinstance(e, sp.Tuple):
            if e in seen:
                repeated.add(e)
                return
            seen.add(e)
        for a in written.get(e, e).args:
            count(a)

    for e in wanted:
        count(e)
    taken = {s.name for e in wanted for s in e.free_symbols}
    names = (s for s in sp.numbered_symbols("_c", real=True) if s.name not in taken)
    pieces: list[tuple[sp.Symbol, sp.Expr]] = []
    done: dict[Any, sp.Symbol] = {}

    def reduced(e: Any) -> sp.Basic:
        if not getattr(e, "args", ()) or e in done:
            return done.get(e, e)
        form = written.get(e, e)
        args = [reduced(a) for a in form.args]
        found = rebuilt(form, args) if isinstance(form, sp.Basic) else form.func(*args)
        if e in repeated:
            done[e] = next(names)
            pieces.append((done[e], found))
            return done[e]
        return found

    return pieces, [reduced(e) for e in wanted]


def _in_order(
    bodies: Mapping[sp.Symbol, sp.Expr], results: Sequence[sp.Expr]
) -> list[tuple[sp.Symbol, sp.Expr]]:
    """Return the assignments in an order in which each symbol is set before its use."""
    done: dict[sp.Symbol, sp.Expr] = {}
    stack: list[tuple[sp.Symbol | None, Iterable[sp.Symbol]]] = []

    def needs(e: sp.Expr) -> Iterable[sp.Symbol]:
        return iter(sorted((s for s in e.free_symbols if s in bodies), key=attrgetter("name")))

    for result in results:
        stack.append((None, needs(result)))
        while stack:
            symbol, rest = stack[-1]
            following = next((s for s in rest if s not in done), None)
            if following is not None:
                stack.append((following, needs(bodies[following])))
                continue
            stack.pop()
            if symbol is not None:
                done[symbol] = bodies[symbol]
    return list(done.items())
