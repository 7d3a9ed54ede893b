"""Expressions by name: immutable, ordered, hashable."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import sympy as sp

from hovercontrol.errors import InputError


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
