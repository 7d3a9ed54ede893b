"""Run a sweep: many runs of a Block over one time grid, in parts on several threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.engines import Engine
from hovercontrol.blocks.backends.library import Library, Solver
from hovercontrol.blocks.backends.sweep import (
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
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import arrivals_of_runs
from hovercontrol.blocks.simulation.arguments import by_state, input_rows


@dataclass(frozen=True)
class Sweep:
    """A sweep's arguments in the Block's order, and arrays for its results.

    Attributes
    ----------
    x, p : ndarray, shape (n_runs, n_states) and (n_runs, n_parameters)
    u : ndarray, shape (n_inputs, n_times)
    keys : list of str
        Of the parameters.
    params : mapping
        The parameters as given.
    parameters, x0 : dict of str to ndarray, shape (n_runs,)
        The given values of each run.
    counted : int
        Index of the first time at which figures are evaluated.
    bands : ndarray, shape (n_outputs,)
    results : tuple of ndarray
        Figures (n_runs, n_outputs, 5), last states (n_runs, n_states), status (n_runs,).
    """

    block: Block
    x: Array
    p: Array
    u: Array
    keys: list[str]
    params: Many
    parameters: dict[str, Array]
    x0: dict[str, Array]
    counted: int
    bands: Array
    results: tuple[Array, Array, NDArray[np.intc]]

    def result(self) -> SweepResult:
        """Return the results with their names and units."""
        figures, last, status = self.results
        outputs, states = (tuple(s.name for s in g) for g in (self.block.outputs, self.block.states))
        each: dict[str, Any] = {name: figures[:, :, k] for k, name in enumerate(FIGURES)}
        given = (self.parameters, self.x0, units_of_runs(self.block))
        return SweepResult(outputs, states, *given, **each, states_final=last, status=status)


def sweep_of(
    block: Block,
    times: Array,
    params: Many | None,
    x0: Many | ArrayLike | None,
    inputs: ArrayLike | Many | None,
    start: float,
    band: float | Mapping[str, float],
) -> Sweep:
    """Return a sweep's arguments, checked; they are those of :meth:`.compiled.CompiledBlock.sweep`.

    Raises
    ------
    InputError
        If a name, a shape or a value is wrong.
    """
    u = input_rows(block, inputs, times)
    if x0 is not None and not isinstance(x0, Mapping):
        x0 = rows_by_state(block, x0)
    x0 = by_state(block, x0 or {})
    params = {block.full_key(name): values for name, values in (params or {}).items()}
    runs = number_of_runs({**params, **x0})
    keys = [block.parameter_key(s.name) for s in block.parameters]
    signals = dict(zip(keys, block.parameters, strict=True))
    p, given_p = values_of_runs(block, signals, params, runs, "parameter")
    x, given_x = values_of_runs(block, {s.name: s for s in block.states}, x0, runs, "state")
    bands = settling_bands(block, band)
    counted = int(np.searchsorted(times, start))
    if counted == len(times):
        raise InputError(f"start = {start:g} s is after the last time, {times[-1]:g} s")
    results = (
        np.full((runs, len(block.outputs), len(FIGURES)), np.nan),
        np.full((runs, len(block.states)), np.nan),
        np.zeros(runs, dtype=np.intc),
    )
    return Sweep(block, x, p, u, keys, params, given_p, given_x, counted, bands, results)


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
    given = sweep_of(block, times, params, x0, inputs, start, band)
    u, x, p, (figures, last, status) = given.u, given.x, given.p, given.results
    # relative to times[0] [s]: midpoint between the last time before `start` and the first evaluated one
    counted, runs = given.counted, len(x)
    since = (times[counted - 1] + times[counted]) / 2 - times[0] if counted else 0.0
    groups = arrivals_of_runs(block, times, u, p)
    order = np.concatenate([which for which, _ in groups])  # groups runs with the same delays
    if len(groups) > 1:
        x, p = x[order], p[order]

    def work(k: int) -> int:
        part, late = parts[k]
        results = figures[part], last[part], status[part]
        engine.sweep(solver, late.times, late.inputs, x[part], p[part], since, given.bands, results)
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
        for whole in given.results:
            whole[:] = whole[back]
    return given.result()
