"""Simulate many windows of logs at once, with the sensitivities of their final states.

The classical Runge-Kutta method is used with equal steps between two rows, and with smooth dry friction;
for the rates of a sampled model Euler's method, which is exact for these.
NumPy does the work until a library is built; that needs a compiler with useful vector instructions. The two
agree to rounding.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.users_code import OWN_THREADS
from hovercontrol.blocks.backends.background import InBackground
from hovercontrol.blocks.backends.c_lanes import lanes_source, slopes_source
from hovercontrol.blocks.backends.compiler import NoCompilerError, generated, load_library
from hovercontrol.blocks.backends.runtime import SHOOTING, runtime_files
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.runge_kutta import rk4_step

#: Minimum number of windows per thread.
SHARE = 32

_EXPORTS = """#include "hc_shoot.h"
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
EXPORT int block_shoot(const hc_shoot *shoot, long from, long to)
{
    return hc_model_lanes ? hc_shoot_run(shoot, hc_model_lanes, &hc_model_slopes, from, to) : -1;
}
"""


class _Shoot(ctypes.Structure):
    """hc_shoot of hc_shoot.h."""

    _fields_ = (
        *(
            (name, ctypes.c_int)
            for name in ("n_states", "n_inputs", "n_parameters", "n_known", "n_columns", "euler")
        ),
        *((name, ctypes.c_long) for name in ("windows", "rows", "pieces")),
        *((name, ctypes.c_void_p) for name in ("known", "time", "step", "inputs", "values")),
        *((name, ctypes.c_void_p) for name in ("parameters", "states", "slopes")),
        *((name, ctypes.c_void_p) for name in ("of_state", "of_parameter")),
    )


@dataclass(frozen=True)
class Columns:
    """The variables of the sensitivities: initial values of some states, and some parameters.

    Attributes
    ----------
    of_state : sequence of int
        Column of the initial value of each state, or -1.
    of_parameter : sequence of int
        Column of each parameter, or -1; parameters may share a column.
    """

    of_state: Sequence[int]
    of_parameter: Sequence[int]

    @property
    def count(self) -> int:
        """Number of columns."""
        return max((*self.of_state, *self.of_parameter), default=-1) + 1


def shoot(
    block: Block,
    time: Array,
    step: Array,
    inputs: Array,
    known: Mapping[int, Array],
    parameters: Sequence[float],
    start: Array,
    *,
    euler: bool = False,
) -> Array:
    """Simulate windows of logs.

    Parameters
    ----------
    time : ndarray, shape (S, K-1, W)
        Begin of each of the S steps between two rows [s], for K rows and W windows.
    step : ndarray, broadcast to shape (S, K-1, W)
        Length of each step [s].
    inputs : ndarray, shape (n_inputs, S, K-1, W)
        Inputs, held over each step.
    known : dict of int to ndarray, shape (S, K-1, W)
        Given values of states, by index; they are not integrated.
    parameters : sequence of float
        Values of all parameters, in order.
    start : ndarray, shape (n_states, W)
        Initial states.
    euler : bool, optional
        Whether the steps are Euler's, ``x + h f(t, x, u, p)``: the next values of a sampled model whose rates
        the Block holds (:meth:`.BlockModel.rates`).

    Returns
    -------
    ndarray, shape (K, n_states, W)
        States at the rows; infinite or NaN where the simulation diverges.
    """
    return _shoot(block, time, step, inputs, known, parameters, start, None, euler)[0]


def shoot_with_slopes(
    block: Block,
    time: Array,
    step: Array,
    inputs: Array,
    known: Mapping[int, Array],
    parameters: Sequence[float],
    start: Array,
    columns: Columns,
    *,
    euler: bool = False,
) -> tuple[Array, Array]:
    """Simulate windows, with the sensitivities S = dx/dtheta of their final states.

    theta are the initial values and parameters in `columns`. The variational equation is integrated by the
    same Runge-Kutta steps, so that S is the exact derivative of the computed states (Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, I.14)::

        x' = f(t, x, u, p),    S' = (df/dx) S + df/dtheta,    S(0) = dx(0)/dtheta (entries 0 and 1)

    A partial derivative that is not finite, such as that of a speed at rest, counts as zero. Inputs and given
    states count as fixed.

    Parameters
    ----------
    block, time, step, inputs, known, parameters, start, euler
        As for :func:`shoot`.

    Returns
    -------
    ndarray, shape (K, n_states, W)
        States at the rows.
    ndarray, shape (n_states, n_columns, W)
        Sensitivities of the states of the last row.
    """
    return _shoot(block, time, step, inputs, known, parameters, start, columns, euler)


def _shoot(
    block: Block,
    time: Array,
    step: Array,
    inputs: Array,
    known: Mapping[int, Array],
    parameters: Sequence[float],
    start: Array,
    columns: Columns | None,
    euler: bool,
) -> tuple[Array, Array]:
    states = np.empty((time.shape[1] + 1, *start.shape))
    states[0] = start
    slopes = np.empty((len(start), columns.count if columns else 0, *start.shape[1:]))
    step = np.broadcast_to(step, inputs.shape[1:])
    for i, values in known.items():
        states[0, i] = values[0, 0]
    run = _compiled(block) or _Numpy(block)
    run.run(time, step, inputs, known, parameters, states, columns, slopes, euler)
    return states, slopes


class _Numpy:
    """Does the work of :class:`_Compiled` without a compiler."""

    def __init__(self, block: Block) -> None:
        self._functions = block.to_numpy()
        self._count = len(block.states)

    def run(
        self,
        time: Array,
        step: Array,
        inputs: Array,
        known: Mapping[int, Array],
        parameters: Sequence[float],
        states: Array,
        columns: Columns | None,
        slopes: Array,
        euler: bool,
    ) -> None:
        n, p = self._count, parameters
        x = np.zeros((n, 1 + slopes.shape[1], *states.shape[2:]))  # states, then sensitivities by column
        x[:, 0] = states[0]
        for i, column in enumerate(columns.of_state if columns else ()):
            if column >= 0:
                x[i, 1 + column] = 1.0

        def slope(u: Array, t: Array, x: Array) -> Array:
            k = np.zeros_like(x)
            for i, value in enumerate(self._functions.array_derivatives(t, x[:, 0], u, p)):
                k[i, 0] = value
            if columns:
                self._vary(t, x, u, p, columns, k)
            k[list(known)] = 0.0
            return k

        with np.errstate(all="ignore"):
            for row in range(time.shape[1]):
                for piece, begin in enumerate(time[:, row]):
                    u, h = inputs[:, piece, row], step[piece, row]
                    for i, values in known.items():
                        x[i, 0] = values[piece, row]
                    x = x + h * slope(u, begin, x) if euler else rk4_step(partial(slope, u), begin, x, h)
                states[row + 1] = x[:, 0]
        slopes[:] = x[:, 1:]

    def _vary(self, t: Array, x: Array, u: Array, p: Sequence[float], columns: Columns, k: Array) -> None:
        # S' = (df/dx) S + df/dtheta, added to k[:, 1:] entry by entry of the nonzero partial derivatives
        function, entries = self._functions.array_partials("derivatives")
        for (i, j), value in zip(entries, function(t, x[:, 0], u, p), strict=True):
            value = np.where(np.isfinite(value), value, 0.0)
            if j < self._count:
                k[i, 1:] += value * x[j, 1:]
            elif (column := columns.of_parameter[j - self._count]) >= 0:
                k[i, 1 + column] += value


class _Compiled:
    """Simulates windows with the compiled library of one Block."""

    def __init__(self, block: Block, files: Mapping[str, str], *, build: bool = True) -> None:
        self._sizes = len(block.states), len(block.inputs), len(block.parameters)
        self._call = load_library(block.name, files, build=build).block_shoot
        self._call.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_long]
        if self._call(ctypes.byref(_Shoot()), 0, 0) < 0:
            raise NoCompilerError("this machine's vectors gain nothing")

    def run(
        self,
        time: Array,
        step: Array,
        inputs: Array,
        known: Mapping[int, Array],
        parameters: Sequence[float],
        states: Array,
        columns: Columns | None,
        slopes: Array,
        euler: bool,
    ) -> None:
        pieces, rows, windows = time.shape
        which = np.array(list(known), dtype=np.intc)
        given = np.array(list(known.values())) if known else np.empty(0)
        arrays = [
            which,
            *(np.ascontiguousarray(a) for a in (time, step, inputs, given)),
            np.array(parameters),
            states,
            slopes,
        ]
        if columns:
            arrays += [np.array(of, dtype=np.intc) for of in (columns.of_state, columns.of_parameter)]
        numbers = len(known), slopes.shape[1], euler, windows, rows + 1, pieces
        shoot = _Shoot(*self._sizes, *numbers, *(a.ctypes.data for a in arrays))
        parts = min(threads(), max(windows // SHARE, 1))
        edges = np.linspace(0, windows, parts + 1).astype(int).tolist()
        jobs = [(shoot, arrays, a, b) for a, b in pairwise(edges)]
        failed = list(pool().map(self._job, jobs)) if parts > 1 else [self._job(jobs[0])]
        if any(failed):
            raise MemoryError("no memory for the windows' simulation")

    def _job(self, job: tuple[_Shoot, list[Array], int, int]) -> int:
        """Simulate some windows; the job keeps the arrays alive if the caller is interrupted."""
        shoot, _, first, end = job
        return int(self._call(ctypes.byref(shoot), first, end))


def threads() -> int:
    """Return the number of threads for windows: ``OMP_NUM_THREADS``, or one per core."""
    said = os.environ.get("OMP_NUM_THREADS", "")
    return max(int(said), 1) if said.isdigit() else os.cpu_count() or 1


@cache
def pool() -> ThreadPoolExecutor:
    """Return the pool of threads that simulate windows."""
    return ThreadPoolExecutor(threads(), thread_name_prefix=OWN_THREADS)


@InBackground
def _compiled(build: bool, block: Block) -> _Compiled:
    files = runtime_files(SHOOTING) | {"exports.c": _EXPORTS}
    lanes = partial(lanes_source, block, friction="smooth")
    files["lanes.c"] = generated(block, "lanes.c smooth True", lanes)
    slopes = partial(slopes_source, block, friction="smooth")
    files["slopes.c"] = generated(block, "slopes.c smooth", slopes)
    return _Compiled(block, files, build=build)
