"""Lookup tables as SymPy expressions that every backend prints: an entry by its number, and interpolation.

A table of two axes is printed as an array, once for each corner of a cell. Measured on K06's
14 x 161 entries:

| form | to Python | one call | 2000 points | C |
|---|---|---|---|---|
| ``Piecewise``, a chain | not at all: NumPy's text nests too deep | | | |
| ``Piecewise``, a tree, one corner only | 1.8 s | 0.5 us | 8 ms | 390 kB in 2.8 s |
| sum of hat functions | 4.9 s | 109 us | 9 ms | 40 kB in 3 s |
| array (here), all four corners | 0.06 s | 4 us | 0.1 ms | 80 kB in 0.06 s |

In C the table stands once in the file (inside an expression GCC would copy it at each call, 1.5 us). A table
of one axis is short: it is a sum of hinges, which needs nothing new and takes knots at any distance, so that
its inverse is one as well.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike


class Entries(sp.AtomicExpr):
    """The numbers of a table, in rows; a constant of an expression.

    Parameters
    ----------
    name : str
        How texts call the table.
    values : sequence of float

    Examples
    --------
    >>> Entries("squares", [0.0, 1.0, 4.0])
    squares
    """

    __slots__ = ("name", "values")
    # What checkers of units and assumptions ask of a constant.
    is_number = True
    is_real = True
    is_finite = True
    is_zero = False
    is_commutative = True

    name: str
    values: tuple[float, ...]

    def __new__(cls, name: str, values: Sequence[float]) -> Entries:
        """Make the constant; equal ones are one to SymPy."""
        found: Entries = sp.AtomicExpr.__new__(cls)
        found.name, found.values = str(name), tuple(float(v) for v in values)
        return found

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.name, self.values

    def _hashable_content(self) -> tuple[Any, ...]:
        return self.name, self.values

    def sort_key(self, order: Any = None) -> Any:
        """Return SymPy's key for sorting: tables stand in the order of their names."""
        return self.class_key(), (1, (self.name,)), sp.S.One.sort_key(), sp.S.One

    @property
    def identifier(self) -> str:
        """A name that no other table has, for generated code."""
        digest = hashlib.sha256(repr(self.values).encode()).hexdigest()[:8]
        return f"table_{re.sub(r'[^0-9A-Za-z]+', '_', self.name)}_{digest}"

    def _sympystr(self, printer: Any) -> str:
        return self.name

    def _sympyrepr(self, printer: Any) -> str:
        return f"Entries({self.name!r}, {hashlib.sha256(repr(self.values).encode()).hexdigest()!r})"

    def _latex(self, printer: Any) -> str:
        return r"\mathrm{" + self.name.replace("_", r"\_") + "}"

    def _mathml_presentation(self, printer: Any) -> Any:
        node = printer.dom.createElement("mtext")
        node.appendChild(printer.dom.createTextNode(self.name))
        return node


class entry(sp.Function):  # noqa: N801  (a function, as SymPy writes them)
    """The entry of a table whose number is `index`, rounded down and kept within; its slope is zero.

    Parameters
    ----------
    index : sympy.Expr
        A plain number.
    entries : Entries

    Examples
    --------
    >>> k = sp.Symbol("k", real=True)
    >>> found = entry(k, Entries("squares", [0.0, 1.0, 4.0]))
    >>> found, found.subs(k, 1.9), found.subs(k, 7), found.diff(k)
    (squares[k], 1.00000000000000, 4.00000000000000, 0)
    """

    nargs = 2

    @classmethod
    def eval(cls, index: Any, entries: Any) -> Any:
        """Return the number where the index is one."""
        if index.is_Number and index.is_finite:
            return sp.Float(entries.values[min(max(int(sp.floor(index)), 0), len(entries.values) - 1)])
        return None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the slope between the steps."""
        return sp.S.Zero

    def _eval_is_real(self) -> bool:
        return True

    def _parts(self, printer: Any) -> tuple[str, tuple[float, ...]]:
        return printer._print(self.args[0]), self.args[1].values

    def _pythoncode(self, printer: Any) -> str:
        index, values = self._parts(printer)
        return f"{values!r}[int(min({len(values) - 1}, max(0, {index})))]"

    def _numpycode(self, printer: Any) -> str:
        index, values = self._parts(printer)
        data = np.array(values, dtype="<f8").tobytes()  # read where it lies, not built at each call
        place = f"numpy.fmax(0, numpy.fmin({len(values) - 1}, {index}))"
        return f"numpy.frombuffer({data!r}, '<f8')[numpy.asarray({place}).astype(int)]"

    def _sympystr(self, printer: Any) -> str:
        return f"{printer._print(self.args[1])}[{printer._print(self.args[0])}]"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        text = f"{printer._print(self.args[1])}_{{{printer._print(self.args[0])}}}"
        return text if exp is None else f"{text}^{{{exp}}}"

    def _mathml_presentation(self, printer: Any) -> Any:
        node = printer.dom.createElement("msub")
        for part in (self.args[1], self.args[0]):
            node.appendChild(printer._print(part))
        return node


def bilinear(name: str, values: ArrayLike, row: sp.Expr, column: sp.Expr) -> sp.Expr:
    """Return the interpolation of a table between the four entries around a place.

    Parameters
    ----------
    name : str
        How texts call the table.
    values : array_like, shape (rows, columns)
        Of two rows and columns at least.
    row, column : sympy.Expr
        The place, counted in rows and columns from 0; plain numbers. Outside, the border continues.

    Examples
    --------
    >>> i, j = sp.symbols("i j", real=True)
    >>> float(bilinear("table", [[0, 1, 2], [10, 11, 12]], i, j).subs({i: 0.5, j: 1.25}))
    6.25
    """
    table = np.asarray(values, dtype=float)
    rows, columns = table.shape
    i, j = (sp.Max(0, sp.Min(at, n - 1)) for at, n in ((row, rows), (column, columns)))
    # The last cell reaches to its far border, so that no entry beyond the table is needed there.
    i0, j0 = sp.Min(sp.floor(i), rows - 2), sp.Min(sp.floor(j), columns - 2)
    entries = Entries(name, table.ravel().tolist())
    first = columns * i0 + j0
    at = {(a, b): entry(first + columns * a + b, entries) for a in (0, 1) for b in (0, 1)}
    top, bottom = (at[a, 0] + (j - j0) * (at[a, 1] - at[a, 0]) for a in (0, 1))
    return top + (i - i0) * (bottom - top)


def linear(x: sp.Expr, knots: ArrayLike, values: ArrayLike) -> sp.Expr:
    """Return the line through the knots as a sum of hinges; outside them it stays at the end's value.

    Parameters
    ----------
    x : sympy.Expr
        A plain number.
    knots, values : array_like, shape (n,)
        Knots increase.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> [float(linear(x, [0, 1, 3], [0, 2, 4]).subs(x, at)) for at in (-1, 0.5, 2, 9)]
    [0.0, 1.0, 3.0, 4.0]
    """
    xs, ys = (np.asarray(a, dtype=float) for a in (knots, values))
    slopes = np.diff(ys) / np.diff(xs)
    bends = np.diff(slopes, prepend=0.0, append=0.0)
    total: sp.Expr = sp.Float(ys[0])
    inside = sp.Min(x, xs[-1])
    for knot, bend in zip(xs[:-1], bends[:-1], strict=True):
        total += bend * sp.Max(0, inside - knot)
    return total
