"""Stepwise simulation of a Block in machine code: the calls of hc_runner.h in its library."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.library import Library, Solver, solver_options


class NativeEngine:
    """Steps a Block in machine code; an :class:`~hovercontrol.blocks.simulation.runner.Engine`.

    Parameters
    ----------
    library : Library
        Library with all states of the Block.
    time : float
        Initial time [s].
    """

    kind = "native"

    def __init__(
        self,
        library: Library,
        solver: Solver,
        time: float,
        states: Sequence[float],
        inputs: Sequence[float],
        params: Sequence[float],
        n_outputs: int,
    ) -> None:
        self._library, self._n = library, len(states)  # keeps the library loaded
        self._calls = calls = _calls(library.short)
        self.y = np.zeros(n_outputs)
        options = solver_options(solver)
        self._at = at = calls.runner_new(ctypes.byref(options), self.y.ctypes.data)
        if not at:
            raise MemoryError("no memory for the solver")
        weakref.finalize(self, calls.runner_free, at)
        arrays = [np.array(values, dtype=float) for values in (states, inputs, params)]
        self._begun = calls.runner_begin(at, time, *(a.ctypes.data for a in arrays))
        # A step must cost little more than its C function, so the inputs are bytes, passed as a pointer.
        self.step: Any = partial(calls.runner_step, at) if not self._begun else self._refuse

    def _refuse(self, _until: float, _sent: bytes) -> int:
        return int(self._begun)

    def jump(self, states: Mapping[int, float], params: Sequence[float]) -> int:
        """Set states, by index, and all parameters now; return the status."""
        x, given = np.zeros(self._n), np.zeros(self._n, dtype=np.intc)
        for place, value in states.items():
            x[place], given[place] = value, 1
        p = np.array(params, dtype=float)
        return int(self._calls.runner_jump(self._at, *(a.ctypes.data for a in (x, given, p))))

    def time(self) -> float:
        """Return the time reached [s]."""
        return float(self._calls.runner_time(self._at))

    def states(self) -> Array:
        """Return the states."""
        x = np.empty(self._n)
        self._calls.runner_states(self._at, x.ctypes.data)
        return x

    def save(self) -> bytes:
        """Return the complete state of the engine."""
        numbers = np.empty(self._calls.runner_size(self._at))
        self._calls.runner_save(self._at, numbers.ctypes.data)
        return numbers.tobytes()

    def load(self, saved: bytes) -> None:
        """Restore what :meth:`save` returned."""
        size = self._calls.runner_size(self._at) * np.dtype(float).itemsize
        if len(saved) != size:
            raise ValueError(f"expected {size} bytes, found {len(saved)}")
        numbers = np.frombuffer(saved).copy()
        self._calls.runner_load(self._at, numbers.ctypes.data)


def _calls(library: ctypes.PyDLL) -> Any:
    """Declare the functions of the runner in a library, and return the library."""
    real, pointer = ctypes.c_double, ctypes.c_void_p
    for name, result, arguments in (
        ("new", pointer, [pointer, pointer]),
        ("free", None, [pointer]),
        ("begin", ctypes.c_int, [pointer, real, pointer, pointer, pointer]),
        ("step", ctypes.c_int, [pointer, real, ctypes.c_char_p]),
        ("jump", ctypes.c_int, [pointer, pointer, pointer, pointer]),
        ("time", real, [pointer]),
        ("states", None, [pointer, pointer]),
        ("size", ctypes.c_long, [pointer]),
        ("save", None, [pointer, pointer]),
        ("load", None, [pointer, pointer]),
    ):
        function = getattr(library, f"runner_{name}")
        function.restype, function.argtypes = result, arguments
    return library
