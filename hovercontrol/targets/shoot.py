"""Windows of logs simulated: many windows, and many perturbed copies of each, at once.

Classical Runge-Kutta in equal pieces from row to row, dry friction smooth. NumPy does it until a library is
built, where there is a compiler whose vectors gain something; the two agree but for rounding.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache, lru_cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.simulation.runge_kutta import rk4_step
from hovercontrol.targets.background import loaded, ready
from hovercontrol.targets.c_lanes import lanes_source
from hovercontrol.targets.compiler import NoCompilerError, generated, load_library
from hovercontrol.targets.runtime import SHOOTING, runtime_files

Array = NDArray[np.float64]

#: Fewest windows for a thread.
SHARE = 32

_EXPORTS = """#include "hc_shoot.h"
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
EXPORT int block_shoot(const hc_shoot *shoot, long from, long to)
{
    return hc_model_lanes ? hc_shoot_run(shoot, hc_model_lanes, from, to) : -1;
}
"""


class _Shoot(ctypes.Structure):
    """hc_shoot of hc_shoot.h."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("n_states", "n_inputs", "n_parameters", "n_known")),
        *((name, ctypes.c_long) for name in ("windows", "rows", "pieces", "copies", "ways")),
        *((name, ctypes.c_void_p) for name in ("known", "time", "step", "inputs", "values")),
        *((name, ctypes.c_void_p) for name in ("parameters", "states")),
    )


def shoot(
    block: Block,
    time: Array,
    step: Array,
    inputs: Array,
    known: Mapping[int, Array],
    parameters: Array,
    start: Array,
) -> Array:
    """Simulate windows.

    Parameters
    ----------
    block : Block
    time : ndarray, shape (S, K-1, W)
        Begin of each of the S pieces of a step from row to row [s].
    step : ndarray, broadcast to shape (S, K-1, C or 1, W)
        Length of each piece [s].
    inputs : ndarray, shape (n_inputs, S, K-1, C or 1, W)
        Held over a piece; 1 if the same for all copies.
    known : dict of int to ndarray, shape (S, K-1, C or 1, W)
        States that are given.
    parameters : ndarray, shape (n_parameters, C)
    start : ndarray, shape (n_states, C, W)

    Returns
    -------
    ndarray, shape (K, n_states, C, W)
        Infinite or NaN where the simulation runs away.
    """
    states = np.empty((time.shape[1] + 1, *start.shape))
    states[0] = start
    step = np.broadcast_to(step, inputs.shape[1:])
    for i, values in known.items():
        states[0, i] = values[0, 0]
    compiled = _compiled(block)
    if compiled:
        compiled.run(time, step, inputs, known, parameters, states)
    else:
        _run(block, time, step, inputs, known, parameters, states)
    return states


def _run(
    block: Block,
    time: Array,
    step: Array,
    inputs: Array,
    known: Mapping[int, Array],
    parameters: Array,
    states: Array,
) -> None:
    derivatives, p = block.to_numpy().array_derivatives, parameters[..., None]

    def slope(u: Array, t: Array, x: Array) -> Array:
        k = np.empty_like(x)
        for i, value in enumerate(derivatives(t, x, u, p)):
            k[i] = value
        k[list(known)] = 0.0
        return k

    x = states[0].copy()
    with np.errstate(all="ignore"):
        for row in range(time.shape[1]):
            for piece, begin in enumerate(time[:, row]):
                u, h = inputs[:, piece, row], step[piece, row]
                for i, values in known.items():
                    x[i] = values[piece, row]
                x = rk4_step(partial(slope, u), begin, x, h)
            states[row + 1] = x


class _Compiled:
    """The library of one Block."""

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
        parameters: Array,
        states: Array,
    ) -> None:
        pieces, rows, windows = time.shape
        which = np.array(list(known), dtype=np.intc)
        given = np.array(list(known.values())) if known else np.empty(0)
        arrays = [which, *(np.ascontiguousarray(a) for a in (time, step, inputs, given, parameters)), states]
        numbers = windows, rows + 1, pieces, states.shape[2], inputs.shape[3]
        shoot = _Shoot(*self._sizes, len(known), *numbers, *(a.ctypes.data for a in arrays))
        parts = min(threads(), max(windows // SHARE, 1))
        edges = np.linspace(0, windows, parts + 1).astype(int).tolist()
        jobs = [(shoot, arrays, a, b) for a, b in pairwise(edges)]
        failed = list(pool().map(self._job, jobs)) if parts > 1 else [self._job(jobs[0])]
        if any(failed):
            raise MemoryError("no memory for the windows' simulation")

    def _job(self, job: tuple[_Shoot, list[Array], int, int]) -> int:
        """Simulate some windows; the job holds the arrays, which a caller that is interrupted lets go."""
        shoot, _, first, end = job
        return int(self._call(ctypes.byref(shoot), first, end))


def threads() -> int:
    """Return how many threads simulate windows: all cores, or what ``OMP_NUM_THREADS`` says."""
    said = os.environ.get("OMP_NUM_THREADS", "")
    return max(int(said), 1) if said.isdigit() else os.cpu_count() or 1


@cache
def pool() -> ThreadPoolExecutor:
    """Return the threads in which windows are simulated."""
    return ThreadPoolExecutor(threads())


@lru_cache(maxsize=500)
def _build(block: Block) -> Future[_Compiled]:
    def load(build: bool) -> _Compiled:
        files = runtime_files(SHOOTING) | {"exports.c": _EXPORTS}
        lanes = partial(lanes_source, block, friction="smooth")
        files["lanes.c"] = generated(block, "lanes.c smooth True", lanes)
        return _Compiled(block, files, build=build)

    return loaded(load)


def _compiled(block: Block) -> _Compiled | None:
    """Return the compiled runs of a Block; None while they are built, or where that cannot be."""
    return ready(_build(block))
