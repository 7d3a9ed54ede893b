"""A Block's derivatives and outputs at single points, for other solvers: in Python, later in machine code.

Machine code takes 2 us for every Block; Python takes 2 us for a plant and 10 us for a loop with its
estimator. But the library must be loaded, or first built. So the time spent in Python is counted, and machine
code replaces Python when that time equals the cost of the change. A short script then does not wait for a
compiler, and a long one at most doubles the time that it has already used.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.compiler import NotCachedError
from hovercontrol.blocks.backends.library import Library, Point, check_point
from hovercontrol.blocks.block import Block, Rows
from hovercontrol.blocks.functions import call_scalar, numpy_functions

_REAL = np.dtype(float)
#: Executed Python bytecode [bytes, 1 ns each] after which a library is loaded, and after which it is built.
LOAD_AFTER, BUILD_AFTER = 3e7, 1e9
#: Size of the bytecode [bytes] below which an evaluation is faster in Python.
SMALL = 3000


class Points:
    """The functions of one Block at single points, shared by all its systems; see :func:`points`."""

    def __init__(self, block: Block) -> None:
        self.block = block
        functions = numpy_functions(block)
        self._pairs = {rows: functions.scalar_pair(rows) for rows in ("derivatives", "outputs")}
        self._size = {rows: len(pair[0].__code__.co_code) for rows, pair in self._pairs.items()}
        self._spent = 0
        self._next = LOAD_AFTER if max(self._size.values()) >= SMALL else math.inf
        self._library: Library | None = None
        self._at = lru_cache(maxsize=16)(self._functions)

    def python(self, rows: Rows, t: float, x: Any, u: Any, values: tuple[float, ...]) -> Array:
        """Evaluate in Python; states and inputs may be scalars or arrays of any shape with the right size."""
        self._spent += self._size[rows]
        states, inputs = _list(x), _list(u)
        try:
            return np.array(call_scalar(self._pairs[rows], t, states, inputs, values), float)
        except (ValueError, IndexError):
            check_point(self.block, states, inputs)
            raise

    def native(self, values: tuple[float, ...]) -> tuple[Point, Point] | None:
        """Return derivatives and outputs in machine code at fixed parameters, None while Python is used."""
        if self._library is None and self._spent >= self._next:
            self._change_over()
        return self._at(values) if self._library else None

    def _functions(self, values: tuple[float, ...]) -> tuple[Point, Point]:
        assert self._library
        return self._library.point("derivatives", values), self._library.point("outputs", values)

    def _change_over(self) -> None:
        build = self._spent >= BUILD_AFTER
        self._next = math.inf if build else BUILD_AFTER
        try:
            self._library = Library(self.block, "smooth", build=build)
        except (NotCachedError, RuntimeError):  # not built, no compiler, or it fails: Python continues
            return


@lru_cache(maxsize=256)
def points(block: Block) -> Points:
    """Return the functions of a Block at single points; equal Blocks share them."""
    return Points(block)


def _list(values: Any) -> list[float]:
    if type(values) is np.ndarray and values.dtype is _REAL and values.ndim == 1:
        return values.tolist()
    return np.asarray(values, dtype=float).ravel().tolist()
