"""Sweeps on a Dask cluster: a scheduler and two workers on this machine, against two threads."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor

import numpy as np

from hovercontrol.blocks.backends.executors import cluster, sweep_on
from hovercontrol.blocks.backends.sweep import FIGURES, SweepResult
from hovercontrol.control.analysis.loops import tracking_loop
from hovercontrol.craft.models.vehicles import c17_simulation

RUNS, TIMES = 10_000, 3


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    import distributed

    loop = tracking_loop(c17_simulation(), control_point=0.2, k1=2.0, k2=2.0).compile()
    grid = np.linspace(0.0, 20.0, 201)
    values = {"plant.yaw_linear_drag": np.linspace(0.3, 0.6, RUNS)}

    def sweep(executor: Executor) -> SweepResult:
        return sweep_on(executor, loop, grid, params=values)

    begin = time.perf_counter()
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "host": "127.0.0.1",
        "dashboard_address": "127.0.0.1:0",
    }
    with (
        distributed.LocalCluster(processes=True, **options) as local,
        cluster(local.scheduler_address) as workers,
        ThreadPoolExecutor(2) as threads,
    ):
        sweep(workers)  # the workers have loaded their libraries
        yield (
            "cluster of two workers ready, their libraries loaded",
            f"{time.perf_counter() - begin:.1f} s",
            "",
            None,
        )
        spent: dict[Executor, list[float]] = {workers: [], threads: []}
        for _ in range(TIMES):  # by turns, so that what else the machine does falls on both
            for executor, seconds in spent.items():
                seconds.append(clocked(lambda executor=executor: sweep(executor)))
        by_dask, by_threads = (statistics.median(spent[executor]) for executor in (workers, threads))
        yield f"{RUNS} closed loops of 20 s, 2 threads; median of {TIMES}", f"{by_threads:.2f} s", "", None
        speed = by_threads / by_dask
        yield "the same, Dask with 2 workers", f"{speed:.2f} times the speed", ">= 0.8 times", speed >= 0.8
        one, other = loop.sweep(grid, params=values), sweep(workers)
        same = all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in FIGURES)
        yield "results identical to the bit", str(same), "True", same


def clocked(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
