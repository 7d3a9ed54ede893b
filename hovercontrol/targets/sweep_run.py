"""Run a sweep: many runs of a Block over one time grid, in parts on several threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.core.block import Block
from hovercontrol.core.delays import arrivals_of_runs
from hovercontrol.errors import InputError
from hovercontrol.simulation.given import input_rows
from hovercontrol.targets.engines import Engine
from hovercontrol.targets.library import Array, Library, Solver
from hovercontrol.targets.sweep import (
    FIGURES,
    Many,
    SweepResult,
    in_threads,
    number_of_runs,
    rows_by_state,
    settling_bands,
    units_of_runs,
    values_of_runs,
)


def run_sweep(
    block: Block,
    engine_from: Callable[[Array], Engine],
    times: Array,
    solver: Solver,
    params: Many | None,
    x0: Many | ArrayLike | None,
    inputs: ArrayLike | Many | None,
    start: float,
    band: float | Mapping[str, float],
    threads: int | None,
    progress: Callable[[int], None] | None,
) -> SweepResult:
    """Return the figures of many runs.

    Parameters
    ----------
    engine_from : callable
        Returns the engine for initial states.
    times : ndarray, shape (n,)
        Increasing times [s].
    params, x0, inputs, start, band, threads, progress
        As for :meth:`.compiled.CompiledBlock.sweep`.

    Raises
    ------
    InputError
        As for :meth:`.compiled.CompiledBlock.sweep`.
    """
    u = input_rows(block, inputs, times)
    if x0 is not None and not isinstance(x0, Mapping):
        x0 = rows_by_state(block, x0)
    runs = number_of_runs({**(params or {}), **(x0 or {})})
    keys = [block.parameter_key(s.name) for s in block.parameters]
    starts = dict(zip((s.name for s in block.states), block.states, strict=True))
    p, given_p = values_of_runs(
        block, dict(zip(keys, block.parameters, strict=True)), params, runs, "parameter"
    )
    x, given_x = values_of_runs(block, starts, x0, runs, "state")
    bands = settling_bands(block, band)
    counted = int(np.searchsorted(times, start))
    if counted == len(times):
        raise InputError(f"start = {start:g} s is after the last time, {times[-1]:g} s")
    # relative to times[0] [s]: midpoint between the last time before `start` and the first evaluated one
    since = (times[counted - 1] + times[counted]) / 2 - times[0] if counted else 0.0
    figures, last, status = (
        np.full((runs, len(block.outputs), len(FIGURES)), np.nan),
        np.full((runs, len(block.states)), np.nan),
        np.zeros(runs, dtype=np.intc),
    )

    groups = arrivals_of_runs(block, times, u, p)
    order = np.concatenate([which for which, _ in groups])  # groups runs with the same delays
    if len(groups) > 1:
        x, p = x[order], p[order]

    def work(k: int) -> int:
        part, late = parts[k]
        results = figures[part], last[part], status[part]
        engine.sweep(solver, late.times, late.inputs, x[part], p[part], since, bands, results)
        return part.stop - part.start

    engine = engine_from(x)
    size = max(1, runs // 256)  # independent of the number of threads, so that results are, too
    if isinstance(engine, Library):
        size = engine.lanes * math.ceil(size / engine.lanes)
    ends = np.cumsum([len(which) for which, _ in groups]).tolist()
    parts = [
        (slice(first, min(first + size, end)), late)
        for end, (which, late) in zip(ends, groups, strict=True)
        for first in range(end - len(which), end, size)
    ]
    in_threads(work, range(len(parts)), threads, progress)
    if len(groups) > 1:
        back = np.argsort(order)
        figures, last, status = figures[back], last[back], status[back]
    names = tuple(s.name for s in block.outputs)
    each: dict[str, Any] = {name: figures[:, :, k] for k, name in enumerate(FIGURES)}
    given = (given_p, given_x, units_of_runs(block))
    return SweepResult(names, tuple(starts), *given, **each, states_final=last, status=status)
