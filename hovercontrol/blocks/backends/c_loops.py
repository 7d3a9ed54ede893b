"""Write a long function as loops over statements that differ only in array elements and numbers.

Large Blocks repeat equations: those of a bank of filters for each window and candidate, those of a predictive
controller for each step. Written one after the other they exceed a processor's instruction cache and take the
C compiler minutes. Here definitions with numbers in their names, such as ``eta[2,5]``, become arrays. The
statements of one form that set elements of one array become loops, in which all places follow from the
counters by constant strides, so that compilers can use vector instructions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hovercontrol.blocks.backends.c_nests import Nest, nests
from hovercontrol.blocks.backends.c_printer import CPrinter, identifier
from hovercontrol.blocks.expressions import with_symbols
from hovercontrol.blocks.forms import Forms
from hovercontrol.blocks.program import common_parts

#: Least number of passes of a loop.
_LEAST = 4


@dataclass(frozen=True, eq=False)
class Statement:
    """``array[place] = expression``, or the constant `symbol` if the array is not used in loops."""

    array: str
    place: int
    expression: sp.Expr
    note: str
    symbol: sp.Symbol | None = None


@dataclass(frozen=True, eq=False)
class Family:
    """Statements of one form for elements of one array, as loops.

    Attributes
    ----------
    slots : dict of sympy.Symbol to str
        Arrays of what differs from statement to statement, in the order of a nest's places; the first one is
        the target.
    template : sympy.Expr
        Their expression, with the symbols of the slots.
    """

    statements: list[Statement]
    slots: dict[sp.Symbol, str]
    template: sp.Expr
    loops: list[Nest]


class Loops:
    """The statements of a function in order, many of them as loops.

    Parameters
    ----------
    definitions : mapping of str to sympy.Expr
        Each before its use.
    results : sequence of Statement
    loads : mapping of sympy.Symbol to (str, int)
        Array and place of each state, input and parameter.
    names : mapping of sympy.Symbol to str
        C identifiers of all symbols.
    taken : set of str
        C identifiers in use.

    Attributes
    ----------
    lines : list of str
    symbols : set of sympy.Symbol
        All symbols outside loops.
    arrays : set of str
        All arrays in loops.
    """

    def __init__(
        self,
        definitions: Mapping[str, sp.Expr],
        results: Sequence[Statement],
        loads: Mapping[sp.Symbol, tuple[str, int]],
        names: Mapping[sp.Symbol, str],
        taken: Iterable[str],
    ) -> None:
        self._names, self._taken = dict(names), set(taken)
        self._tables: dict[tuple[sp.Number, ...], str] = {}
        self._values: list[str] = []
        self._slots = sp.numbered_symbols("_S", real=True)
        statements = [*self._arranged(definitions), *results]
        self._at = {s.symbol: (s.array, s.place) for s in statements if s.symbol and s.array} | dict(loads)
        self._forms = Forms(lambda symbol: self._at.get(symbol, (symbol.name, 0)))
        families = [f for group in self._groups(statements) for f in self._families(group)]
        inside = {s for f in families for s in f.statements}
        single = [s for s in statements if s not in inside]
        self.arrays = {array for f in families for array in f.slots.values()}
        size: dict[str, int] = {}
        for s in statements:
            if s.symbol and s.array in self.arrays:
                size[s.array] = max(size.get(s.array, 0), s.place + 1)
                self._names[s.symbol] = f"{s.array}[{s.place}]"
        pieces, reduced = common_parts([*(f.template for f in families), *(s.expression for s in single)])
        self.symbols = set().union(*(e.free_symbols for e in (*reduced, *(e for _, e in pieces))))
        ordered = self._ordered(families, single, pieces, reduced)
        tables = [
            f"static const double {name}[] = {{{', '.join(map(CPrinter().doprint, row))}}};"
            for row, name in self._tables.items()
        ]
        self.lines = [*tables, *(f"double {array}[{n}];" for array, n in size.items()), *ordered]

    def _fresh(self, text: str) -> str:
        name = identifier(text, self._taken)
        self._taken.add(name)
        return name

    def _needs(self, e: sp.Expr) -> set[sp.Symbol]:
        return {leaf for leaf in self._forms.of(e)[1] if isinstance(leaf, sp.Symbol)}

    def _arranged(self, definitions: Mapping[str, sp.Expr]) -> Iterator[Statement]:
        """Yield the definitions as statements; those whose names differ only in numbers share an array.

        The number with the most values changes fastest.
        """
        alike: dict[tuple[str, ...], list[tuple[tuple[int, ...], str]]] = {}
        for name in definitions:
            parts = re.split(r"([0-9]+)", name)
            alike.setdefault(tuple(parts[::2]), []).append((tuple(map(int, parts[1::2])), name))
        places: dict[str, tuple[str, int]] = {}
        for text, members in alike.items():
            extent = [len(set(values)) for values in zip(*(numbers for numbers, _ in members), strict=True)]
            order = np.argsort(extent, kind="stable")
            ranked = sorted(members, key=lambda m, order=order: [m[0][k] for k in order])  # type: ignore[misc]
            array = self._fresh("_".join(text)) if len(members) >= _LEAST else ""
            places |= {name: (array, place) for place, (_, name) in enumerate(ranked)}
        for name, e in definitions.items():
            array, place = places[name]
            yield Statement(array, place, e, name, sp.Symbol(name, real=True))

    def _groups(self, statements: Sequence[Statement]) -> Iterator[list[Statement]]:
        """Yield the statements by array and form, such that one group can be executed after the other.

        Groups that need each other are divided by the level of their statements: the longest chain of
        definitions below. A statement needs only lower levels.
        """
        found: dict[Any, list[Statement]] = {}
        level: dict[sp.Symbol, int] = {}
        for s in statements:
            found.setdefault((s.array, self._forms.of(s.expression)[0]) if s.array else s, []).append(s)
            if s.symbol:
                level[s.symbol] = 1 + max((level.get(n, 0) for n in self._needs(s.expression)), default=0)
        groups = list(found.values())
        group_of = {s.symbol: k for k, group in enumerate(groups) for s in group if s.symbol}
        needs = [set().union(*(self._needs(s.expression) for s in group)) for group in groups]
        edges = {(k, group_of[n]) for k, some in enumerate(needs) for n in some if n in group_of}
        rows, columns = np.array(sorted(edges), dtype=int).reshape(-1, 2).T
        graph = coo_array((np.ones(rows.size), (rows, columns)), shape=(len(groups),) * 2)
        _, component = connected_components(graph, connection="strong")
        together = np.bincount(component)
        for k, group in enumerate(groups):
            parts: dict[int, list[Statement]] = {}
            for s in group:
                divided = s.symbol and (together[component[k]] > 1 or (k, k) in edges)
                parts.setdefault(level[s.symbol] if divided else 0, []).append(s)
            yield from parts.values()

    def _families(self, group: Sequence[Statement]) -> Iterator[Family]:
        """Yield the loops over statements of one form, if there are any."""
        if len(group) < _LEAST:
            return
        group = sorted(group, key=lambda s: s.place)
        slots: dict[tuple[Any, tuple[int, ...]], sp.Symbol] = {}

        def slot(array: Any, places: Iterable[int]) -> sp.Symbol:
            key = array, tuple(places)
            if key not in slots:
                slots[key] = next(self._slots)
            return slots[key]

        slot(group[0].array, (s.place for s in group))
        leaves = []
        for column in zip(*(self._forms.of(s.expression)[1] for s in group), strict=True):
            if len(set(column)) == 1:
                leaves.append(column[0])
            elif isinstance(column[0], sp.Symbol):
                leaves.append(slot(self._at[column[0]][0], (self._at[leaf][1] for leaf in column)))
            else:
                leaves.append(slot(column, range(len(group))))
        loops = [n for n in nests(np.array([places for _, places in slots]).T) if n.passes >= _LEAST]
        if loops:
            arrays = {
                symbol: array if isinstance(array, str) else self._table(array)
                for (array, _), symbol in slots.items()
            }
            chosen = [s for n in loops for s in group[n.at : n.at + n.passes]]
            yield Family(chosen, arrays, self._forms.with_leaves(group[0].expression, iter(leaves)), loops)

    def _table(self, row: tuple[sp.Number, ...]) -> str:
        if row not in self._tables:
            self._tables[row] = self._fresh("number")
        return self._tables[row]

    def _ordered(
        self,
        families: Sequence[Family],
        single: Sequence[Statement],
        pieces: Sequence[tuple[sp.Symbol, sp.Expr]],
        reduced: Sequence[sp.Expr],
    ) -> list[str]:
        """Return the lines of all loops and other statements, each after what it needs."""
        inside: dict[sp.Symbol, Family] = {symbol: f for f in families for symbol in f.slots}
        parts: dict[Family, list[tuple[sp.Symbol, sp.Expr]]] = {f: [] for f in families}
        work: list[_Work] = []
        for k, (symbol, e) in enumerate(pieces):
            self._names[symbol] = self._fresh(f"c{k}")
            loop = next((inside[s] for s in e.free_symbols if s in inside), None)
            if loop:
                inside[symbol] = loop
                parts[loop].append((symbol, e))
            else:
                work.append(_Work([symbol], e.free_symbols, [self._constant(symbol, e)]))
        for s, e in zip(single, reduced[len(families) :], strict=True):
            made = [s.symbol] if s.symbol else []
            work.append(_Work(made, e.free_symbols, [self._single(s, e)]))
        for f, e in zip(families, reduced[: len(families)], strict=True):
            needs = set[sp.Symbol]().union(*(self._needs(s.expression) for s in f.statements))
            needs |= e.free_symbols.union(*(part.free_symbols for _, part in parts[f]))
            made = [s.symbol for s in f.statements if s.symbol]
            work.append(_Work(made, needs, list(self._loops(f, parts[f], e))))
        return _in_order(work)

    def _single(self, s: Statement, e: sp.Expr) -> str:
        text = f"{s.array}[{s.place}] = {self._printed(e)};"
        if s.symbol and s.array not in self.arrays:
            text = self._constant(s.symbol, e)
        return text + (f" /* {s.note} */" if s.note else "")

    def _value(self, k: int) -> str:
        while len(self._values) <= k:
            self._values.append(self._fresh(f"v{k}"))
        return self._values[k]

    def _constant(self, symbol: sp.Symbol, e: sp.Expr) -> str:
        return f"const double {self._names[symbol]} = {self._printed(e)};"

    def _printed(self, e: sp.Expr) -> str:
        short = {s: sp.Symbol(self._names.get(s, s.name), real=True) for s in e.free_symbols}
        return str(CPrinter().doprint(with_symbols(e, short)))

    def _loops(self, f: Family, parts: Sequence[tuple[sp.Symbol, sp.Expr]], e: sp.Expr) -> Iterator[str]:
        target, *rest = f.slots
        body = [*(self._constant(*part) for part in parts), f"{target} = {self._printed(e)};"]
        if any(some.has(sp.Piecewise) for some in (e, *(part for _, part in parts))):
            # read before the branches: compilers do not use vector instructions if a branch reads memory
            values = {symbol.name: self._value(k) for k, symbol in enumerate(rest)}
            body = [_swapped(line, {target.name: target.name, **values}) for line in body]
            body = [*(f"const double {name} = {symbol};" for symbol, name in values.items()), *body]
        done = 0
        for nest in f.loops:
            last = done + nest.passes - 1
            yield f"/* {f.statements[done].note} ... {f.statements[last].note} */"
            done = last + 1
            depth = len(nest.lengths)
            for k, n in enumerate(nest.lengths):
                brace = " {" if k == depth - 1 else ""
                yield f"{'    ' * k}for (int l{k} = 0; l{k} < {n}; l{k}++){brace}"
            text = {
                symbol.name: f"{array}[{_place(nest, k)}]"
                for k, (symbol, array) in enumerate(f.slots.items())
            }
            yield from ("    " * depth + _swapped(line, text) for line in body)
            yield "    " * (depth - 1) + "}"


@dataclass(frozen=True, eq=False)
class _Work:
    """Lines, the symbols that they set and those that they need."""

    made: list[sp.Symbol]
    needs: set[sp.Symbol]
    lines: list[str]


def _in_order(work: Sequence[_Work]) -> list[str]:
    """Return all lines in an order in which each symbol is set before its use."""
    maker = {symbol: k for k, one in enumerate(work) for symbol in one.made}
    below = [sorted({maker[s] for s in one.needs if s in maker} - {k}) for k, one in enumerate(work)]
    done: dict[int, list[str]] = {}
    for last in range(len(work)):
        stack = [last]
        while stack:
            waiting = [k for k in below[stack[-1]] if k not in done]
            if waiting and stack[-1] not in done:
                stack.append(waiting[0])
            else:
                node = stack.pop()
                done[node] = work[node].lines
    return [line for lines in done.values() for line in lines]


def _swapped(line: str, text: Mapping[str, str]) -> str:
    """Return a line with texts in place of the symbols of slots."""
    return re.sub(r"\b_S\d+\b", lambda m: text[m[0]], line)


def _place(nest: Nest, slot: int) -> str:
    """Return the place of a slot as C source: first + l0 stride_0 + l1 stride_1 + ..."""
    text = str(nest.first[slot])
    for k, stride in enumerate(nest.strides):
        n = int(stride[slot])
        if n:
            text += f" {'-' if n < 0 else '+'} " + (f"{abs(n)} * l{k}" if abs(n) > 1 else f"l{k}")
    return text.removeprefix("0 + ")
