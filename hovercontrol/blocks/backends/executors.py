"""Sweeps on any ``concurrent.futures.Executor`` (threads, processes, a Dask cluster), with checkpoints.

A sweep is divided into parts independently of the executor, so that results cannot depend on it. Each worker
simulates a part with :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`. The results are
collected here and, on request, stored in a folder of Parquet files.
"""

from __future__ import annotations

import asyncio
import importlib
import math
import pickle
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import as_user
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.backends.checkpoint import Checkpoint, fingerprint
from hovercontrol.blocks.backends.resting import without_resting_states
from hovercontrol.blocks.backends.sweep import (
    FIGURES,
    WORKER_FAILED,
    Many,
    SweepResult,
    number_of_runs,
    rows_by_state,
    units_of_runs,
    values_of_runs,
)
from hovercontrol.blocks.simulation.arguments import by_state, checked_times

if TYPE_CHECKING:
    from hovercontrol.blocks.backends.compiled import CompiledBlock

#: Approximate number of parts of a sweep. Each part holds a multiple of 16 runs, so that the 8 lanes of the
#: vector code are filled.
PARTS, TOGETHER = 64, 16


def sweep_on(
    executor: Executor,
    ready: CompiledBlock,
    time: ArrayLike,
    *,
    params: Many | None = None,
    x0: Many | ArrayLike | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[int], None] | None = None,
    **options: Any,
) -> SweepResult:
    """Simulate many runs on an executor; results are bit-identical to those of ``ready.sweep``.

    Parameters
    ----------
    executor : concurrent.futures.Executor
        Threads, processes, or a cluster (see :func:`cluster`). It is not shut down.
    ready : CompiledBlock
        Each worker loads its library from its own cache, or builds it.
    time, params, x0
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.
    checkpoint : path, optional
        Folder for the results, one Parquet file for each finished part; together they hold the table of
        :meth:`~hovercontrol.blocks.backends.sweep.SweepResult.to_table`. The same sweep with the same folder
        continues an interrupted one; runs that failed in a worker are repeated.
    progress : callable, optional
        Called repeatedly with the number of runs done.
    **options
        ``inputs``, ``start``, ``band``, ``method``, ``step``, ``rtol``, ``atol``, as for ``ready.sweep``.

    Returns
    -------
    SweepResult
        A run that fails is marked in it; the other runs continue. If a part fails in its worker, each of its
        runs is repeated alone, and those that fail again are marked. Results are bit-identical for the same
        processors and compilers.

    Raises
    ------
    InputError
        As for ``ready.sweep``, and if the folder belongs to another sweep.
    RuntimeError
        If all parts fail, or the executor breaks. A process pool breaks if a process is killed; a Dask
        cluster gives the tasks to other workers. The checkpoint keeps its results.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> from hovercontrol import Block, Signal
    >>> v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0, lower=0.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}).compile()
    >>> with ThreadPoolExecutor(2) as threads:
    ...     result = sweep_on(threads, decay, [0.0, 1.0], params={"decay.k": [0.0, 1.0, 2.0]})
    >>> result["v"].final.round(5).tolist()
    [1.0, 0.36788, 0.13534]
    """
    work = _work(ready, checked_times(time), params, x0, options)
    runs, size = len(work.x), TOGETHER * math.ceil(len(work.x) / (PARTS * TOGETHER))
    result = _empty(work)
    kept = None
    todo = [slice(first, min(first + size, runs)) for first in range(0, runs, size)]
    if checkpoint is not None:
        kept = Checkpoint(Path(checkpoint), fingerprint(ready, *work[1:]))
        kept.load(result)
        todo = [part for part in todo if (result.status[part] == WORKER_FAILED).any()]
    counter = _Counter(runs - sum(part.stop - part.start for part in todo), progress)
    failed = _run(executor, work, todo, result, kept, counter)
    if failed and len(failed) == len(todo):
        raise RuntimeError(f"all parts of the sweep failed, the first so: {failed[0][1]}")
    alone = [slice(k, k + 1) for part, _ in failed for k in range(part.start, part.stop)]
    for part, text in _run(executor, work, alone, result, kept, counter):
        result.errors[part.start] = text
        counter.more(1)
    return result


@contextmanager
def cluster(address: str, timeout: float = 10.0) -> Iterator[Executor]:
    """Connect to a Dask cluster as an executor; needs ``pip install '.[cluster]'``.

    Parameters
    ----------
    address : str
        Address of its scheduler, such as ``tcp://127.0.0.1:8786``.
    timeout : float, optional
        Time limit for the answer of the scheduler, and then of a worker [s].

    Raises
    ------
    InputError
        If they do not answer in time, the address is invalid, or Dask is not installed.
    """
    positive("cluster: timeout", timeout)
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise InputError("a cluster needs Dask: pip install '.[cluster]'") from None
    with ThreadPoolExecutor(1) as apart:  # the caller may have an event loop of its own
        apart.submit(asyncio.run, _answers(distributed, address, timeout)).result()
    with distributed.Client(address, timeout=timeout, set_as_default=False) as client:
        try:
            client.wait_for_workers(1, timeout=timeout)
        except TimeoutError:
            raise InputError(f"cluster {address!r}: no worker within {timeout:g} s") from None
        yield client.get_executor(pure=False)


async def _answers(distributed: Any, address: str, timeout: float) -> None:
    """Raise if no scheduler answers at the address: Dask itself would wait without a limit."""
    try:
        greeting = distributed.comm.connect(address, timeout=timeout)
        (await asyncio.wait_for(greeting, timeout)).abort()
    except (OSError, TimeoutError):
        raise InputError(f"cluster {address!r}: does not answer within {timeout:g} s") from None
    except Exception as error:
        raise InputError(f"cluster {address!r}: no Dask scheduler: {error}") from None


class _Work(NamedTuple):
    """Input of the workers: the data shared by all runs, and initial states and parameters of each run."""

    ready: bytes
    times: Array
    options: dict[str, Any]
    x: Array
    params: dict[str, Array]
    x0: dict[str, Array]


class _Counter:
    """The number of runs done, reported to the caller."""

    def __init__(self, done: int, progress: Callable[[int], None] | None) -> None:
        self.done, self._progress = 0, progress
        if done:
            self.more(done)

    def more(self, runs: int) -> None:
        self.done += runs
        if self._progress is not None:
            self._progress(self.done)


def _work(
    ready: CompiledBlock,
    times: Array,
    params: Many | None,
    x0: Many | ArrayLike | None,
    options: Mapping[str, Any],
) -> _Work:
    block = ready.block
    if x0 is not None and not isinstance(x0, Mapping):
        x0 = rows_by_state(block, x0)
    x0 = by_state(block, x0 or {})
    params = {block.full_key(name): values for name, values in (params or {}).items()}
    runs = number_of_runs({**params, **x0})
    by_key = {block.parameter_key(s.name): s for s in block.parameters}
    _, p = values_of_runs(block, by_key, params, runs, "parameter")
    x, given = values_of_runs(block, {s.name: s for s in block.states}, x0, runs, "state")
    resting = np.delete(np.arange(len(block.states)), without_resting_states(block)[1])
    moved = np.flatnonzero(x[:, resting].any(axis=1))
    if moved.size:  # if one run needs all states, all runs compute them, in every part
        start = {block.states[k].name: float(x[moved[0], k]) for k in resting}
        ready = block.with_values(start).compile(friction=ready.friction)
    return _Work(pickle.dumps(ready), times, dict(options), x, p, given)


def _empty(work: _Work) -> SweepResult:
    """Return a result in which no run is finished."""
    block, runs = _load(work.ready).block, len(work.x)
    outputs, states = (tuple(s.name for s in group) for group in (block.outputs, block.states))
    figures: dict[str, Any] = {name: np.full((runs, len(outputs)), np.nan) for name in FIGURES}
    last, status = np.full((runs, len(states)), np.nan), np.full(runs, WORKER_FAILED, dtype=np.intc)
    given = (work.params, work.x0, units_of_runs(block))
    return SweepResult(outputs, states, *given, **figures, states_final=last, status=status)


def _run(
    executor: Executor,
    work: _Work,
    parts: list[slice],
    result: SweepResult,
    kept: Checkpoint | None,
    counter: _Counter,
) -> list[tuple[slice, str]]:
    """Simulate the parts; return those that failed in their worker, with the reason."""
    failed: list[tuple[slice, str]] = []
    futures: dict[Future[dict[str, Any]], slice] = {}
    try:
        for part in parts:
            params = {key: values[part] for key, values in work.params.items()}
            call = (work.ready, work.times, params, work.x[part], work.options)
            futures[executor.submit(_simulate, *call)] = part
        for future in as_completed(futures):
            part = futures[future]
            try:
                found = future.result()
            except (BrokenExecutor, CancelledError, InputError):
                raise
            except Exception as error:
                failed.append((part, f"{type(error).__name__}: {error}".splitlines()[0]))
                continue
            for name, values in found.items():
                getattr(result, name)[part] = values
            if kept is not None:
                kept.add(result, part)
            counter.more(part.stop - part.start)
    except (BrokenExecutor, CancelledError) as error:
        where = "; the checkpoint keeps what was done" if kept is not None else ""
        reason = str(error) or type(error).__name__
        raise RuntimeError(
            f"the executor broke after {counter.done} of {len(work.x)} runs: {reason}{where}"
        ) from error
    finally:  # also after Ctrl-C: parts that have not started are cancelled
        for future in futures:
            future.cancel()
    return failed


def _simulate(
    ready: bytes, times: Array, params: dict[str, Array], x: Array, options: dict[str, Any]
) -> dict[str, Any]:
    """Simulate a part in the worker's process."""
    result = as_user(_load(ready).sweep, times, params=params, x0=x, threads=1, **options)
    return {name: getattr(result, name) for name in (*FIGURES, "states_final", "status")}


@lru_cache(maxsize=8)
def _load(ready: bytes) -> CompiledBlock:
    loaded: CompiledBlock = pickle.loads(ready)
    return loaded
