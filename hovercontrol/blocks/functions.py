"""A Block as Python functions: of plain floats, fast for one point, and of NumPy arrays, for many points.

SymPy prints the source of both from the same expressions; common subexpressions are computed once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.derivatives import partial_derivatives
from hovercontrol.blocks.expressions import with_symbols
from hovercontrol.blocks.program import Program
from hovercontrol.blocks.signals import time
from hovercontrol.blocks.summary import block_line

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block, Columns, Rows

Function = Callable[..., tuple[Any, ...]]
FunctionPair = tuple[Function, Function]  # for floats, for arrays
Backend = Literal["math", "numpy"]


class NumpyFunctions:
    """The functions of one Block, from ``block.to_numpy()``."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self._groups = (
            [s.symbol for s in block.states],
            [s.symbol for s in block.inputs],
            [s.symbol for s in block.parameters],
        )

    def __repr__(self) -> str:
        return f"NumpyFunctions of {block_line(self.block)}"

    @checked
    def derivatives(
        self, t: ArrayLike, x: ArrayLike, u: ArrayLike = (), params: Mapping[str, float] | None = None
    ) -> Array:
        """Return the states' time derivatives.

        Parameters
        ----------
        t : array_like, scalar or shape (...)
            Time [s].
        x : array_like, shape (n_states, ...)
            States; further axes are independent points.
        u : array_like, shape (n_inputs, ...)
        params : mapping, optional
            Parameter values by key; others have their defaults. Values out of bounds are allowed, because
            finite differences need them.

        Returns
        -------
        ndarray, shape (n_states, ...)

        Raises
        ------
        InputError
            If a shape or a key is wrong.
        """
        return self._evaluate(self._pair("derivatives"), t, x, u, params)

    @checked
    def outputs(
        self, t: ArrayLike, x: ArrayLike, u: ArrayLike = (), params: Mapping[str, float] | None = None
    ) -> Array:
        """Return the outputs, shape (n_outputs, ...); arguments as in :meth:`derivatives`."""
        return self._evaluate(self._pair("outputs"), t, x, u, params)

    @checked
    def jacobian(
        self,
        t: ArrayLike,
        x: ArrayLike,
        u: ArrayLike = (),
        params: Mapping[str, float] | None = None,
        rows: Rows = "derivatives",
        columns: Columns = "states",
    ) -> Array:
        """Return the exact Jacobian, shape (n_rows, n_columns, ...); arguments as in :meth:`derivatives`.

        Entry (i, j) is the partial derivative of row i by column j: rows are the states' derivatives or the
        outputs; columns are states, inputs or parameters.
        """
        args = self._arguments(t, x, u)
        return self.jacobian_values(*args, self.block.parameter_values(params, bounded=False), rows, columns)

    def jacobian_values(
        self, t: Any, x: Array, u: Array, values: tuple[float, ...], rows: Rows, columns: Columns
    ) -> Array:
        """Return the same as :meth:`jacobian`, unchecked, with all parameter values in order."""
        function, entries, shape = self._jacobian_parts(rows, columns)
        found = function(t, x, u, values)
        points = (
            ()
            if x.ndim == u.ndim == 1 and np.ndim(t) == 0
            else np.broadcast_shapes(*map(np.shape, (*x, *u, t)))
        )
        result = np.zeros(shape + points)
        for (i, j), value in zip(entries, found, strict=True):
            result[i, j] = value
        return result

    def scalar_pair(self, rows: Rows) -> FunctionPair:
        """Return the function ``(t, x, u, p) -> tuple`` for plain floats, and the same for arrays.

        Call the pair with :func:`call_scalar` in tight loops; p are the parameter values in order.
        """
        return self._pair(rows)

    def tick_pair(self, k: int) -> FunctionPair:
        """Return the pair for the k-th tick of a hybrid Block: new states, in the order of its updates."""
        return self._pair(k)

    @cached_property
    def array_derivatives(self) -> Function:
        """Derivatives as a function ``(t, x, u, p) -> tuple`` of arrays, without any checks."""
        return self._function("derivatives", "numpy")

    @cached_property
    def array_outputs(self) -> Function:
        """Outputs as a function ``(t, x, u, p) -> tuple`` of arrays, without any checks."""
        return self._function("outputs", "numpy")

    @lru_cache(maxsize=2)  # noqa: B019  (the object lives as long as its Block)
    def array_partials(self, rows: Rows) -> tuple[Function, list[tuple[int, int]]]:
        """Return the nonzero partial derivatives, and the row and column of each.

        The first result is a function ``(t, x, u, p) -> tuple`` of arrays, without any checks. Columns are
        the states, then the parameters. Derivatives that are identically zero are left out.
        """
        names = [s.name for s in (*self.block.states, *self.block.parameters)]
        return self._partials(rows, names)

    # ---- inside --------------------------------------------------------------------------------------

    @cached_property
    def _compiled(self) -> dict[tuple[str | int, str], Function]:
        return {}

    @cached_property
    def _programs(self) -> dict[str | int, Program]:
        return {}

    def _pair(self, rows: Rows | int) -> FunctionPair:
        return self._function(rows, "math"), self._function(rows, "numpy")

    def _function(self, rows: Rows | int, backend: Backend) -> Function:
        if rows not in self._programs:
            block = self.block
            if isinstance(rows, int):
                wanted: Mapping[str, sp.Expr] = block.ticks[rows].updates
            else:
                wanted = block.derivatives if rows == "derivatives" else block.output_expressions
            self._programs[rows] = Program(block, list(wanted.values()))
        if (rows, backend) not in self._compiled:
            self._compiled[rows, backend] = _compile(self._programs[rows], backend, self._groups)
        return self._compiled[rows, backend]

    @lru_cache(maxsize=16)  # noqa: B019  (one entry per Jacobian; the object lives as long as its Block)
    def _jacobian_parts(
        self, rows: Rows, columns: Columns
    ) -> tuple[Function, list[tuple[int, int]], tuple[int, int]]:
        names = [s.name for s in getattr(self.block, columns)]
        n_rows = len(self.block.states if rows == "derivatives" else self.block.outputs)
        return *self._partials(rows, names), (n_rows, len(names))

    def _partials(self, rows: Rows, names: Sequence[str]) -> tuple[Function, list[tuple[int, int]]]:
        entries = partial_derivatives(self.block, rows, names)
        return _compile(Program(self.block, list(entries.values())), "numpy", self._groups), list(entries)

    def _arguments(self, t: ArrayLike, x: ArrayLike, u: ArrayLike) -> tuple[Any, Array, Array]:
        xs, us = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        for given, group, kind in ((xs, self.block.states, "state"), (us, self.block.inputs, "input")):
            found = given.shape[0] if given.ndim else 1
            if found != len(group):
                names = ", ".join(s.name for s in group[:8]) + (", ..." if len(group) > 8 else "")
                raise InputError(
                    f"block {self.block.name!r}: expected {len(group)} {kind} values ({names}), found {found}"
                )
        return np.asarray(t, dtype=float)[()], np.atleast_1d(xs), np.atleast_1d(us)

    def _evaluate(self, pair: FunctionPair, t: ArrayLike, x: ArrayLike, u: ArrayLike, params: Any) -> Array:
        t, xs, us = self._arguments(t, x, u)
        p = self.block.parameter_values(params, bounded=False)
        if xs.ndim == us.ndim == 1 and np.ndim(t) == 0:
            return np.array(call_scalar(pair, float(t), xs.tolist(), us.tolist(), p), dtype=float)  # type: ignore[arg-type]
        if xs.ndim > 1 and us.ndim == 1:
            us = us.reshape(-1, *(1,) * (xs.ndim - 1))
        values = pair[1](t, xs, us, p)
        shape = np.broadcast_shapes(np.shape(t), xs.shape[1:], us.shape[1:])
        return np.array([np.broadcast_to(v, shape) for v in values], dtype=float).reshape(-1, *shape)


def call_scalar(
    pair: FunctionPair, t: float, x: Sequence[float], u: Sequence[float], p: Sequence[float]
) -> tuple[float, ...]:
    """Evaluate with plain floats; if Python raises (1/0), evaluate with NumPy, which returns inf or nan."""
    try:
        return pair[0](t, x, u, p)
    except (ZeroDivisionError, OverflowError, ValueError):
        with np.errstate(all="ignore"):
            return tuple(float(v) for v in pair[1](t, np.array(x), np.array(u), np.array(p)))


def array_function(block: Block, wanted: Sequence[sp.Expr]) -> Function:
    """Return expressions of a Block's signals as a function ``(t, x, u, p) -> tuple`` of arrays, unchecked.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=2.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> array_function(decay, [v.symbol**2])(0.0, np.array([[1.0, 2.0, 3.0]]), (), (2.0,))
    (array([1., 4., 9.]),)
    """
    return _compile(Program(block, wanted), "numpy", numpy_functions(block)._groups)


@lru_cache(maxsize=256)
def numpy_functions(block: Block) -> NumpyFunctions:
    """Return the functions of a Block; equal Blocks share them.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=2.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> numpy_functions(decay).derivatives(0.0, [[1.0, 2.0, 3.0]])
    array([[-2., -4., -6.]])
    """
    return NumpyFunctions(block)


def _compile(program: Program, backend: Backend, groups: Sequence[list[sp.Symbol]]) -> Function:
    """Compile a program to a function ``f(t, x, u, p)`` that returns a tuple."""
    return program_function(program, groups, _Floats() if backend == "math" else ArrayPrinter(), math, np)


def program_function(
    program: Program, groups: Sequence[list[sp.Symbol]], printer: PythonCodePrinter, *modules: ModuleType
) -> Function:
    """Compile a program to a Python function ``f(t, x, u, p)`` that returns a tuple.

    Parameters
    ----------
    program : Program
    groups : sequence of list of sympy.Symbol
        Symbols of the states, the inputs and the parameters, in the order of x, u and p.
    printer : sympy.printing.pycode.PythonCodePrinter
        Prints the expressions; it writes the modules' full names.
    *modules : module
        Modules that the printed code calls.
    """
    short: dict[sp.Symbol, sp.Symbol] = {time: sp.Symbol("t")}
    lines = ["def f(t, x, u, p):"]
    used = program.symbols
    for letter, group in zip("xup", groups, strict=True):
        for k, symbol in enumerate(group):
            short[symbol] = sp.Symbol(f"{letter}{k}")
        loads = [f"{letter}{k} = {letter}[{k}]" for k, s in enumerate(group) if s in used]
        if len(loads) == len(group) > 1:
            loads = [f"{', '.join(f'{letter}{k}' for k in range(len(group)))} = {letter}"]
        lines += [f"    {load}" for load in loads]
    for k, (symbol, _) in enumerate(program.steps):
        short[symbol] = sp.Symbol(f"c{k}")
    for symbol, e in program.steps:
        lines.append(f"    {short[symbol]} = {printer.doprint(with_symbols(e, short))}")
    values = "".join(f"{printer.doprint(with_symbols(e, short))}, " for e in program.results)
    lines.append(f"    return ({values})")
    space: dict[str, Any] = {module.__name__.partition(".")[0]: module for module in modules}
    exec("\n".join(lines), space)
    return space["f"]


class _Floats(PythonCodePrinter):
    """Prints Python code for floats."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": True, "standard": "python3"})

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 2 <= exponent <= 3:
            return "(" + "*".join([f"({self._print(base)})"] * int(exponent)) + ")"
        if not exponent.is_Integer and abs(exponent) != sp.S.Half:
            # A root of a negative number is an error here (and nan in NumPy), not Python's complex number.
            return f"math.pow({self._print(base)}, {self._print(exponent)})"
        return str(super()._print_Pow(expr, rational=rational))


class ArrayPrinter(NumPyPrinter):
    """Prints NumPy code, or that of a module with the same functions, for arrays that broadcast."""

    def _print_Max(self, expr: sp.Max) -> str:
        return self._fold(f"{self._module}.maximum", expr.args)

    def _print_Min(self, expr: sp.Min) -> str:
        return self._fold(f"{self._module}.minimum", expr.args)

    def _fold(self, name: str, args: Sequence[sp.Expr]) -> str:
        text = str(self._print(args[0]))
        for arg in args[1:]:
            text = f"{name}({text}, {self._print(arg)})"
        return text

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        pieces = list(expr.args)
        value, condition = pieces.pop()
        text = self._print(value) if condition == sp.true else f"{self._module}.nan"
        if condition != sp.true:
            pieces.append((value, condition))
        for value, condition in reversed(pieces):
            text = f"{self._module}.where({self._print(condition)}, {self._print(value)}, {text})"
        return str(text)
