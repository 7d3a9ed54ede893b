"""Forms of expressions: what is left of them without their symbols and numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import sympy as sp

from hovercontrol.blocks.expressions import rebuilt


class Forms:
    """Finds the forms of expressions.

    Parameters
    ----------
    where : callable
        Returns array and place of a symbol.
    """

    def __init__(self, where: Callable[[sp.Symbol], tuple[str, int]]) -> None:
        self._where = where
        self._ids: dict[Any, int] = {}
        self._known: dict[Any, tuple[int, tuple[Any, ...], tuple[int, ...]]] = {}

    def of(self, e: Any) -> tuple[int, tuple[Any, ...]]:
        """Return an expression's form and its leaves: symbols and numbers."""
        return self._shape(e)[:2]

    def _shape(self, e: Any) -> tuple[int, tuple[Any, ...], tuple[int, ...]]:
        if e not in self._known:
            self._known[e] = self._found(e)
        return self._known[e]

    def _id(self, *key: Any) -> int:
        return self._ids.setdefault(key, len(self._ids))

    def _found(self, e: Any) -> tuple[int, tuple[Any, ...], tuple[int, ...]]:
        if isinstance(e, sp.Symbol):
            return self._id("element", self._where(e)[0]), (e,), ()
        if isinstance(e, sp.Number):
            return self._id("number"), (e,), ()
        if not e.args:
            return self._id("atom", e), (), ()
        args = list(e.args)
        if isinstance(e, sp.Pow) and isinstance(e.exp, sp.Number):
            key, leaves, _ = self._shape(e.base)
            return self._id("power", e.exp, key), leaves, (0,)
        order = list(range(len(args)))
        parts = [self._shape(a) for a in args]
        if isinstance(e, sp.Add | sp.Mul | sp.And | sp.Or | sp.Min | sp.Max):
            order.sort(key=lambda k: (parts[k][0], [self._rank(leaf) for leaf in parts[k][1]]))
        leaves = tuple(leaf for k in order for leaf in parts[k][1])
        return self._id(type(e), *(parts[k][0] for k in order)), leaves, tuple(order)

    def _rank(self, leaf: Any) -> float:
        return self._where(leaf)[1] if isinstance(leaf, sp.Symbol) else float(leaf)

    def with_leaves(self, e: Any, leaves: Iterator[Any]) -> Any:
        """Return an expression with other leaves, given in the order of :meth:`of`."""
        if isinstance(e, sp.Symbol | sp.Number):
            return next(leaves)
        if not e.args:
            return e
        args = list(e.args)
        for k in self._shape(e)[2]:
            args[k] = self.with_leaves(args[k], leaves)
        return rebuilt(e, args)
