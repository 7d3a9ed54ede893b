"""Immutable, ordered and hashable mappings from names to expressions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanFunction

from hovercontrol.base.errors import InputError


class Expressions(Mapping[str, sp.Expr]):
    """An immutable, ordered, hashable mapping from a signal's name to its expression."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, Any] | Iterable[tuple[str, Any]] = ()) -> None:
        pairs = items.items() if isinstance(items, Mapping) else items
        self._items = {str(name): _as_expression(name, value) for name, value in pairs}

    def __getitem__(self, name: str) -> sp.Expr:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expressions) and list(self.items()) == list(other.items())

    def __hash__(self) -> int:
        return hash(tuple(self._items.items()))

    def __repr__(self) -> str:
        return f"Expressions({self._items})"


def _as_expression(name: str, value: Any) -> sp.Expr:
    if isinstance(value, str):
        raise InputError(f"{name}: expected a SymPy expression, found the text {value!r}")
    expression = sp.sympify(value)
    if not isinstance(expression, sp.Expr):
        raise InputError(f"{name}: expected a SymPy expression, found {value!r}")
    return expression


def with_symbols(expression: sp.Expr, swap: Mapping[sp.Symbol, sp.Symbol]) -> sp.Expr:
    """Return an expression with some symbols replaced by others.

    Like ``xreplace``, but minima, maxima, conditions and what they select keep their arguments, because SymPy
    would compare and simplify them again, which is slow.

    Examples
    --------
    >>> a, b, c = (sp.Symbol(name, real=True) for name in "abc")
    >>> with_symbols(sp.Max(a, b) + sp.sin(b), {b: c})
    sin(c) + Max(a, c)
    """
    done: dict[sp.Basic, sp.Basic] = {}

    def changed(e: sp.Basic) -> sp.Basic:
        if not e.args:
            return swap.get(e, e)
        if e not in done:
            done[e] = rebuilt(e, [changed(a) for a in e.args])
        return done[e]

    return changed(expression)


def rebuilt(e: sp.Basic, args: Sequence[sp.Basic]) -> sp.Basic:
    """Return an expression with other arguments; minima, maxima and conditions are not simplified again."""
    if all(a is b for a, b in zip(args, e.args, strict=True)):
        return e
    if isinstance(e, (sp.Min, sp.Max, sp.Piecewise, Relational, BooleanFunction)):
        return e.func(*args, evaluate=False)
    return e.func(*args)


class Definitions(dict[str, sp.Expr]):
    """A mapping to collect the definitions of a Block: call it with a name and an expression.

    Parameters
    ----------
    given : mapping of str to sympy.Expr, optional
        Initial definitions.
    prefix, suffix : str, optional
        Prefix and suffix of each further name.

    Examples
    --------
    >>> v, define = sp.Symbol("v", real=True), Definitions(prefix="air_")
    >>> 2 * define("speed", sp.Abs(v))
    2*air_speed
    >>> define
    {'air_speed': Abs(v)}
    """

    def __init__(
        self, given: Mapping[str, sp.Expr] = MappingProxyType({}), *, prefix: str = "", suffix: str = ""
    ) -> None:
        super().__init__(given)
        self._prefix, self._suffix = prefix, suffix

    def __call__(self, name: str, e: sp.Expr) -> sp.Symbol:
        """Add a definition and return its symbol."""
        whole = f"{self._prefix}{name}{self._suffix}"
        self[whole] = e
        return sp.Symbol(whole, real=True)
