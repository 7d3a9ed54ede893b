"""The shared library of one Block: its C sources and the calls into it."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.backends.c_exports import EXPORTS
from hovercontrol.blocks.backends.c_lanes import lanes_source
from hovercontrol.blocks.backends.compiler import NotCachedError, generated, load_library
from hovercontrol.blocks.backends.resting import without_resting_states
from hovercontrol.blocks.backends.runtime import SIMULATION, runtime_files
from hovercontrol.blocks.block import Block, Rows
from hovercontrol.blocks.friction import Friction

Point = Callable[[float, ArrayLike, ArrayLike], Array]
Step = Callable[[float, float, ArrayLike, ArrayLike], tuple[int, Array]]

#: Maximum number of solver steps between two grid times; they take some seconds.
MAX_STEPS = 10_000_000
NO_MEMORY = 1  # of hc_solver.h
METHODS = ("dormand-prince", "rk4", "dop853")  # in the order of hc_solver.h
_NO_LANES = '#include "hc_lanes.h"\nconst hc_lanes_function hc_model_lanes = NULL;\n'


class Solver(NamedTuple):
    """Solver settings; ``step`` 0 means no maximum step size."""

    method: str
    step: float
    rtol: float
    atol: float


class _Options(ctypes.Structure):
    """hc_options of hc_solver.h."""

    _fields_ = (
        ("method", ctypes.c_int),
        ("rtol", ctypes.c_double),
        ("atol", ctypes.c_double),
        ("step", ctypes.c_double),
        ("max_steps", ctypes.c_long),
        ("nominal", ctypes.c_void_p),
    )


class _Part(ctypes.Structure):
    """hc_part of hc_simulate.h."""

    _fields_ = (("n_all", ctypes.c_int), ("place", ctypes.c_void_p))


class _Buffers(threading.local):
    """Arrays for one call at a point, separate for each thread."""

    def __init__(self, n_inputs: int, p: Array, n_states: int, n_outputs: int, rows: Rows) -> None:
        self.x, self.u = np.zeros(n_states), np.zeros(n_inputs)
        self.result = np.zeros(n_states if rows == "derivatives" else n_outputs)
        self.addresses = tuple(a.ctypes.data for a in (self.x, self.u, p, self.result))
        self.times = np.zeros(2)
        self.span = self.times.ctypes.data


def check_point(block: Block, x: ArrayLike, u: ArrayLike) -> None:
    """Raise if the number of states or inputs is not that of the Block.

    Raises
    ------
    InputError
    """
    n_x, n_u = len(block.states), len(block.inputs)
    if np.shape(x) != (n_x,) or np.shape(u) != (n_u,):
        raise InputError(
            f"block {block.name!r}: expected {n_x} states and {n_u} inputs, "
            f"found shapes {np.shape(x)} and {np.shape(u)}"
        )


def states_and_inputs(block: Block, x: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
    """Return states and inputs as arrays.

    Raises
    ------
    InputError
        If they are not numbers, or their count is not that of the Block.
    """
    try:
        states, inputs = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"block {block.name!r}: expected numbers as states and inputs, found {shown(x)} and {shown(u)}"
        ) from None
    check_point(block, states, inputs)
    return states, inputs


class Library:
    """The shared library of one Block and the calls into it; arrays are C-contiguous and not checked.

    Parameters
    ----------
    friction : {"events", "smooth"}
    whole : bool, optional
        Whether to compute also the states that rest at zero (see :mod:`.resting`). Without them the library
        is faster, but these states must start at zero. Derivatives and outputs at a point need all states.
    lanes : bool, optional
        Whether Runge-Kutta sweeps use the processor's vector instructions; this doubles the build time.
    build : bool, optional
        Whether to build a library that is not in the cache.

    Raises
    ------
    NoCompilerError, RuntimeError
        As for :func:`load_library`.
    NotCachedError
        If the library is not in the cache and `build` is false.

    Attributes
    ----------
    resting : ndarray of int
        Indices of the omitted states.
    lanes : int
        Number of runs that a Runge-Kutta sweep computes in parallel.
    short : ctypes.PyDLL
        The library for calls too short to release the interpreter's lock.
    """

    def __init__(
        self,
        block: Block,
        friction: Friction,
        *,
        whole: bool = True,
        lanes: bool = False,
        build: bool = True,
    ) -> None:
        self._block = block
        self._sizes = len(block.states), len(block.outputs)
        model, kept = (block, range(len(block.states))) if whole else without_resting_states(block)
        self._place = np.array(kept, dtype=np.intc)
        self.resting = np.delete(np.arange(len(block.states)), kept)
        self._part = _Part(len(block.states), self._place.ctypes.data)
        files = runtime_files(SIMULATION) | {"exports.c": EXPORTS}
        texts = {"model.c": partial(c_source, partials=False)} | ({"lanes.c": lanes_source} if lanes else {})
        for name, make in texts.items():
            kind = f"{name} {friction} {whole}"
            files[name] = generated(
                block, kind, partial(make, model, friction=friction) if build else _refuse
            )
        files.setdefault("lanes.c", _NO_LANES)
        library = load_library(block.name, files, build=build)
        self.lanes = int(library.block_lanes())
        real, count, pointer = ctypes.c_double, ctypes.c_long, ctypes.c_void_p
        self._simulate, self._sweep = library.block_simulate, library.block_sweep
        self._simulate.argtypes = [pointer, pointer, pointer, count, *[pointer] * 6]
        self._sweep.argtypes = [*[pointer] * 3, count, count, *[pointer] * 3, real, *[pointer] * 4]
        self._advance = library.block_advance
        self._advance.argtypes = [pointer] * 5
        # A right-hand side takes less time than releasing and taking the interpreter's lock.
        self.short = short = ctypes.PyDLL(library._name)
        self._rows = {"derivatives": short.block_derivatives, "outputs": short.block_outputs}
        for function in self._rows.values():
            function.argtypes, function.restype = [real, *[pointer] * 4], None

    def point(self, rows: Rows, values: tuple[float, ...]) -> Point:
        """Return the function ``(t, x, u) -> array`` of derivatives or outputs at fixed parameters."""
        native, p = self._rows[rows], np.array(values)
        ready = _Buffers(len(self._block.inputs), p, *self._sizes, rows)

        def function(t: float, x: ArrayLike, u: ArrayLike = ()) -> Array:
            check_point(self._block, x, u)
            ready.x[:], ready.u[:] = x, u
            native(t, *ready.addresses)
            return ready.result.copy()

        return function

    def advance(self, solver: Solver, t: float, until: float, x: Array, u: Array, p: Array) -> int:
        """Change the states x at `t` to those at `until`, in place; return the status.

        Ticks at `t` are executed, those at `until` are not. If `until` equals `t`, only these ticks are
        executed.
        """
        options, times = solver_options(solver), np.array([t, until], dtype=float)
        return self._advance(ctypes.byref(options), *(a.ctypes.data for a in (times, x, u, p)))

    def stepper(self, solver: Solver, values: tuple[float, ...]) -> Step:
        """Return :meth:`advance` at fixed parameters as ``(t, until, x, u) -> (status, array)``."""
        p, options = np.array(values), solver_options(solver)
        ready = _Buffers(len(self._block.inputs), p, *self._sizes, "derivatives")
        how = ctypes.byref(options)

        def function(t: float, until: float, x: ArrayLike, u: ArrayLike) -> tuple[int, Array]:
            check_point(self._block, x, u)
            ready.x[:], ready.u[:] = x, u
            ready.times[:] = t, until
            status = self._advance(how, ready.span, *ready.addresses[:3])
            return status, ready.x.copy()

        return function

    def simulate(
        self, solver: Solver, times: Array, u: Array, x: Array, p: Array
    ) -> tuple[int, float, Array, Array, Array]:
        """Return status, time reached, states and outputs, shape (n_times, signals), and the last states."""
        n_states, n_outputs = self._sizes
        states, outputs = np.empty((len(times), n_states)), np.empty((len(times), n_outputs))
        reached, last, rows = np.array([times[0]]), x.copy(), np.ascontiguousarray(u.T)
        arrays = (a.ctypes.data for a in (last, rows, p, states, outputs, reached))
        options = solver_options(solver)
        call = (ctypes.byref(self._part), ctypes.byref(options), times.ctypes.data, len(times))
        status = self._simulate(*call, *arrays)
        if status == NO_MEMORY:
            raise MemoryError("no memory for the solver")
        return status, float(reached[0]), states, outputs, last

    def sweep(
        self,
        solver: Solver,
        times: Array,
        u: Array,
        x: Array,
        p: Array,
        since: float,
        band: Array,
        results: tuple[Array, Array, NDArray[np.intc]],
    ) -> None:
        """Write the results of some runs: figures, last states, status."""
        options, rows = solver_options(solver), np.ascontiguousarray(u.T)
        before = (a.ctypes.data for a in (x, rows, p))
        after = (a.ctypes.data for a in (band, *results))
        call = (ctypes.byref(self._part), ctypes.byref(options), times.ctypes.data, len(times), len(x))
        if self._sweep(*call, *before, since, *after) == NO_MEMORY:
            raise MemoryError("no memory for the solver")


def solver_options(solver: Solver) -> _Options:
    """Return solver settings as the structure of the C runtime."""
    steps = 0 if solver.method == "rk4" else MAX_STEPS
    return _Options(METHODS.index(solver.method), solver.rtol, solver.atol, solver.step, steps, None)


def _refuse() -> str:
    raise NotCachedError
