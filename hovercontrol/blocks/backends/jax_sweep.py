"""Sweeps in JAX: chunks of runs side by side in one kernel, and their figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.engines import checked_solver
from hovercontrol.blocks.backends.jax_kernel import fits_kernel, kernel_runner
from hovercontrol.blocks.backends.jax_needs import need_jax
from hovercontrol.blocks.backends.jax_run import Plan, plan_of, runner_of
from hovercontrol.blocks.backends.library import Solver
from hovercontrol.blocks.backends.sweep import FIGURES, Many, SweepResult, in_threads
from hovercontrol.blocks.backends.sweep_run import Sweep, sweep_of
from hovercontrol.blocks.delays import arrivals_of_runs
from hovercontrol.blocks.simulation.arguments import checked_times

if TYPE_CHECKING:
    from hovercontrol.blocks.backends.jax import JaxFunctions


#: Runs of a chunk on a CPU: the values of a step stay in the cache.
CPU_CHUNK = 256
#: Memory for the rows of a chunk on a GPU [bytes].
GPU_MEMORY = 8e9
#: Index into :data:`hovercontrol.blocks.simulation.reasons.REASONS`: a derivative is not a number.
NOT_FINITE = 2


def sweep(
    functions: JaxFunctions,
    time: ArrayLike,
    params: Many | None,
    x0: Many | ArrayLike | None,
    inputs: ArrayLike | Many | None,
    start: float,
    band: float | Mapping[str, float],
    threads: int | None,
    method: str,
    step: float | None,
    rtol: float,
    atol: float,
    chunk: int | None,
    progress: Callable[[int], None] | None,
) -> SweepResult:
    """Sweep as :meth:`.jax.JaxFunctions.sweep`."""
    import jax

    functions, step = functions.running, step or functions.block.period or None
    block, times = functions.block, checked_times(time)
    solver = checked_solver(method, step, rtol, atol)
    if chunk is not None and chunk < 1:
        raise InputError(f"chunk must be 1 or more, found {chunk}")
    given = sweep_of(block, times, params, x0, inputs, start, band)
    go = functions.cached(
        ("sweep", solver), lambda: jax.jit(_chunk_of(functions, solver), static_argnums=(4, 5))
    )
    results: tuple[NDArray[Any], ...] = given.results
    size = min(chunk or _chunk(len(times) * len(block.outputs)), len(given.x))
    parts: list[tuple[NDArray[np.intp], Plan]] = []
    for which, late in arrivals_of_runs(block, times, given.u, given.p):
        plan = plan_of(functions.plain.block, times, late, given.p[which[0]], solver)
        parts += [(which[k : k + size], plan) for k in range(0, len(which), size)]

    def work(k: int) -> int:
        which, plan = parts[k]
        padded = np.resize(which, size) if len(parts) > 1 else which  # each chunk has the same shape
        x, p = _columns(given, padded)
        found = go(x, p, plan, given.bands, given.counted, len(padded))
        for whole, part in zip(results, found, strict=True):
            whole[_slice(which)] = np.asarray(part)[: len(which)]
        return len(which)

    in_threads(work, range(len(parts)), threads, progress)
    return given.result()


def _chunk(numbers: int) -> int:
    """Return the number of runs of a chunk; `numbers` floats are kept of each."""
    import jax

    return CPU_CHUNK if jax.default_backend() == "cpu" else max(1, int(GPU_MEMORY / (8 * max(numbers, 1))))


def _slice(which: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """Return the indices as a slice if they follow one another, for then NumPy copies in one piece."""
    first, last = int(which[0]), int(which[-1])
    return slice(first, last + 1) if (np.diff(which) == 1).all() else which


def _columns(given: Sweep, which: NDArray[np.intp]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return states and parameters: an array for each that differs among runs, a number for each other."""
    part = _slice(which)
    states = [s.name for s in given.block.states]
    return (
        tuple(c[part] if s in given.x0 else c[0] for s, c in zip(states, given.x.T, strict=True)),
        tuple(
            c[part] if key in given.parameters and np.ndim(given.params[key]) else c[0]
            for key, c in zip(given.keys, given.p.T, strict=True)
        ),
    )


def _chunk_of(functions: JaxFunctions, solver: Solver) -> Callable[..., Any]:
    """Return ``(x, p, plan, band, counted, runs) -> (figures, last states, status)`` of a chunk of runs."""
    import jax

    jnp = need_jax()
    fused = solver.method == "rk4" and jax.default_backend() == "gpu" and fits_kernel(functions.plain.block)
    run = kernel_runner(functions.plain) if fused else runner_of(functions.plain, solver, "outputs")

    def chunk(x: Any, p: Any, plan: Plan, band: Any, counted: int, runs: int) -> tuple[Any, Any, Any]:
        x = tuple(jnp.broadcast_to(jnp.asarray(a, dtype=float), (runs,)) for a in x)
        if solver.method == "rk4":
            rows, last = run(x, p, plan)
        else:  # each run has its own steps
            own = tuple(0 if np.ndim(a) else None for a in p)
            rows, last = jax.vmap(lambda x, p: run(x, p, plan), (0, own), (1, 0))(x, p)
        last = jnp.stack(last, axis=-1) if last else jnp.zeros((runs, 0))
        y = jnp.stack(rows, axis=-1)[counted:] if rows else jnp.zeros((len(plan.t) - counted, runs, 0))
        t = plan.t[counted:, 0]
        fine = jnp.isfinite(last).all(axis=-1) & jnp.isfinite(y).all(axis=(0, -1))
        # settling: the first time after the last one with |y(t) - y(t_end)| > band
        # rms: sqrt(1/(t_end - t_0) integral of y^2 dt) by the trapezoidal rule
        away = jnp.abs(y - y[-1]) > band
        after = len(t) - jnp.argmax(away[::-1], axis=0)
        settled = jnp.where(away.any(axis=0), t[jnp.minimum(after, len(t) - 1)], t[0])
        span = t[-1] - t[0]
        mean = jnp.trapezoid(y**2, t, axis=0) / jnp.where(span > 0, span, 1.0)
        rms = jnp.sqrt(jnp.where(span > 0, mean, y[0] ** 2))
        figures = jnp.stack([y[-1], y.max(axis=0), y.min(axis=0), rms, settled], axis=-1)
        assert figures.shape[-1] == len(FIGURES)
        return jnp.where(fine[..., None, None], figures, jnp.nan), last, jnp.where(fine, 0, NOT_FINITE)

    return chunk
