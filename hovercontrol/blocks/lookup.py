"""Lookup tables as SymPy expressions that every backend can print: entries by index, and interpolation.

A table of two axes is printed as an array, once for each corner of a cell. Measured on K06's
14 x 161 entries:

| form | conversion to Python | one call | 2000 points | C |
|---|---|---|---|---|
| ``Piecewise``, a chain | impossible: NumPy's code is nested too deeply | | | |
| ``Piecewise``, a tree, one corner only | 1.8 s | 0.5 us | 8 ms | 390 kB in 2.8 s |
| sum of hat functions | 4.9 s | 109 us | 9 ms | 40 kB in 3 s |
| array (here), all four corners | 0.06 s | 4 us | 0.1 ms | 80 kB in 0.06 s |

In C the table is one constant of the file; inside an expression, GCC would copy it at each call (1.5 us). A
table of one axis is short and is written as a sum of hinges. This needs no new function and allows any knot
spacing, so that the inverse of a table has the same form.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline


class Entries(sp.AtomicExpr):
    """The numbers of a table, row by row, as a constant in an expression.

    Parameters
    ----------
    name : str
        Name of the table in printed expressions.

    Examples
    --------
    >>> Entries("squares", [0.0, 1.0, 4.0])
    squares
    """

    __slots__ = ("name", "values")
    # Properties that unit checks and SymPy's assumptions query of a constant.
    is_number = True
    is_real = True
    is_finite = True
    is_zero = False
    is_commutative = True

    name: str
    values: tuple[float, ...]

    def __new__(cls, name: str, values: Sequence[float]) -> Entries:
        """Make the constant; SymPy treats constants of the same name and values as equal."""
        found: Entries = sp.AtomicExpr.__new__(cls)
        found.name, found.values = str(name), tuple(float(v) for v in values)
        return found

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.name, self.values

    def _hashable_content(self) -> tuple[Any, ...]:
        return self.name, self.values

    def sort_key(self, order: Any = None) -> Any:
        """Return SymPy's sorting key: tables are sorted by name."""
        return self.class_key(), (1, (self.name,)), sp.S.One.sort_key(), sp.S.One

    @property
    def identifier(self) -> str:
        """An identifier for generated code, unique to the table's name and values."""
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
    """The table entry at `index`, rounded down and clipped to the table; its derivative is zero.

    Parameters
    ----------
    index : sympy.Expr
        Dimensionless.

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
        """Return the value of the entry if the index is a number."""
        if index.is_Number and index.is_finite:
            return sp.Float(entries.values[min(max(int(sp.floor(index)), 0), len(entries.values) - 1)])
        return None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the derivative between two jumps, which is zero."""
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
        data = np.array(values, dtype="<f8").tobytes()  # read in place, not built per call
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
    """Return the bilinear interpolation of a table between the four entries around a point.

    Parameters
    ----------
    name : str
        Name of the table in printed expressions.
    values : array_like, shape (rows, columns)
        At least two rows and two columns.
    row, column : sympy.Expr
        Coordinates of the point in rows and columns from 0, dimensionless; clipped to the table.

    Examples
    --------
    >>> i, j = sp.symbols("i j", real=True)
    >>> float(bilinear("table", [[0, 1, 2], [10, 11, 12]], i, j).subs({i: 0.5, j: 1.25}))
    6.25
    """
    table = np.asarray(values, dtype=float)
    rows, columns = table.shape
    i, j = (sp.Max(0, sp.Min(at, n - 1)) for at, n in ((row, rows), (column, columns)))
    # On the far border the last cell is used, so that no entry beyond the table is needed.
    i0, j0 = sp.Min(sp.floor(i), rows - 2), sp.Min(sp.floor(j), columns - 2)
    entries = Entries(name, table.ravel().tolist())
    first = columns * i0 + j0
    at = {(a, b): entry(first + columns * a + b, entries) for a in (0, 1) for b in (0, 1)}
    # T_a = T[i0 + a, j0] + (j - j0) (T[i0 + a, j0 + 1] - T[i0 + a, j0]) for a = 0, 1;
    # T(i, j) = T_0 + (i - i0) (T_1 - T_0)
    top, bottom = (at[a, 0] + (j - j0) * (at[a, 1] - at[a, 0]) for a in (0, 1))
    return top + (i - i0) * (bottom - top)


def linear(x: sp.Expr, knots: ArrayLike, values: ArrayLike) -> sp.Expr:
    """Return the piecewise linear interpolation of knots as a sum of hinges; constant outside the knots.

    Parameters
    ----------
    x : sympy.Expr
        Dimensionless.
    knots, values : array_like, shape (n,)
        Increasing knots x_k and values y_k.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> [float(linear(x, [0, 1, 3], [0, 2, 4]).subs(x, at)) for at in (-1, 0.5, 2, 9)]
    [0.0, 1.0, 3.0, 4.0]
    """
    # y = y_0 + sum_k (m_k - m_{k-1}) max(0, min(x, x_{n-1}) - x_k),  k = 0 ... n - 2,
    # with the slopes m_k = (y_{k+1} - y_k) / (x_{k+1} - x_k) and m_{-1} = 0
    xs, ys = (np.asarray(a, dtype=float) for a in (knots, values))
    slopes = np.diff(ys) / np.diff(xs)
    bends = np.diff(slopes, prepend=0.0, append=0.0)
    total: sp.Expr = sp.Float(ys[0])
    inside = sp.Min(x, xs[-1])
    for knot, bend in zip(xs[:-1], bends[:-1], strict=True):
        total += bend * sp.Max(0, inside - knot)
    return total


def cubic(x: sp.Expr, knots: ArrayLike, values: Sequence[Any]) -> sp.Expr:
    """Return the cubic spline through knots; constant outside them, and linear in the values.

    Parameters
    ----------
    x : sympy.Expr
        Dimensionless.
    knots : array_like, shape (n,)
        Increasing, at least four.
    values : sequence of sympy.Expr or float
        Values at the knots, all in the same unit.

    Examples
    --------
    >>> x, a = sp.symbols("x a", real=True)
    >>> found = cubic(x, [0, 1, 2, 3], [0, a, 2 * a, 3 * a])
    >>> [float(found.subs({x: at, a: 5})) for at in (-1, 0.5, 2.5, 9)]
    [0.0, 2.5, 12.5, 15.0]
    """
    # y = y_0 + s_0 (z - x_0) + q_0 (z - x_0)^2 + sum_k d_k max(z - x_k, 0)^3 / 6, z = min(max(x, x_0), x_n):
    # slope s_0 and half the curvature q_0 at the first knot, jump d_k of the third derivative at each knot,
    # none at the second and the last but one (de Boor, A Practical Guide to Splines, IV)
    xs = np.asarray(knots, dtype=float)
    unit = CubicSpline(xs, np.eye(xs.size))  # of values (0 ... 1 ... 0), one column each
    jumps = np.diff(6.0 * unit.c[0], axis=0, prepend=0.0)
    z = sp.Min(sp.Max(x, xs[0]), xs[-1])

    def combined(weights: Any) -> sp.Expr:
        return sp.Add(*(float(w) * y for w, y in zip(weights, values, strict=True)))

    slope, curve = combined(unit.c[2][0]), combined(unit.c[1][0])
    bends = (
        combined(d) * sp.Max(z - knot, 0) ** 3 / 6
        for knot, d in zip(xs[:-1], jumps, strict=True)
        if np.abs(d).max() > 1e-9 * np.abs(jumps).max()
    )
    return values[0] + slope * (z - xs[0]) + curve * (z - xs[0]) ** 2 + sp.Add(*bends)
