"""Run tasks on processes or a cluster, and keep each result under a name that its content decides.

A result's name is the digest of the logs' bytes, the model, the options and the version: the same task is
never done twice, whoever asks, and a changed log, model or option is another task.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import hovercontrol
from hovercontrol.base.errors import InputError, one_line
from hovercontrol.base.files import write_quietly
from hovercontrol.blocks.backends.executors import cluster
from hovercontrol.identification.engine.subject import Subject
from hovercontrol.identification.fleet.worker import Work, done

T = TypeVar("T")

#: Tasks that wait on the workers at a time.
AHEAD = 256

Report = Callable[[int, int], None]


class Store:
    """Results in a folder: ``done/ab/KEY.json``, each with a digest of its own content."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _file(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.json"

    def get(self, key: str) -> dict[str, Any] | None:
        """Return a result; None if it is not there or damaged."""
        try:
            known, _, text = self._file(key).read_bytes().partition(b"\n")
        except OSError:
            return None
        if hashlib.sha256(text).hexdigest().encode() != known:
            return None
        found: dict[str, Any] = json.loads(text)
        return found

    def put(self, key: str, result: Mapping[str, Any]) -> None:
        """Write a result atomically."""
        text = json.dumps(result, allow_nan=False).encode()
        whole = hashlib.sha256(text).hexdigest().encode() + b"\n" + text
        write_quietly(self._file(key), lambda file: file.write_bytes(whole))


def model_text(model: Subject) -> str:
    """Return what says all of a model, the same in every process."""
    return f"{model.plant().content_hash} {model.effects!r}"


def key_of(work: Work, model: str, digests: Mapping[str, str]) -> str:
    """Return the name of a task's result.

    The logs' addresses belong to it, since they may say the craft and the day.

    Parameters
    ----------
    model : str
        :func:`model_text` of its model, which takes time.
    digests : mapping of str to str
        Digest of each log's bytes.
    """
    logs = [(log, digests[log]) for log in work.logs]
    how = [model, str(work.read), work.by, work.added, work.fixed]
    said = [hovercontrol.__version__, work.kind, logs, *how]
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def run(
    executor: Executor, store: Store, tasks: Mapping[str, Work], report: Report
) -> dict[str, dict[str, Any]]:
    """Return the result of each task by its key; those in the store are not done again.

    A task whose worker dies with it again and again is refused, and not kept: the next run tries it again.
    """
    found = {key: kept for key in tasks if (kept := store.get(key)) is not None}
    todo = {key: work for key, work in tasks.items() if key not in found}
    ready, total = len(found), len(tasks)
    report(ready, total)
    for key, result in _each(executor, done, todo):
        if isinstance(result, BaseException):
            found[key] = {"refused": one_line(f"its worker failed: {type(result).__name__}: {result}", 300)}
        else:
            found[key] = result
            store.put(key, result)
        ready += 1
        report(ready, total)
    return {key: found[key] for key in tasks}


def each_of(
    executor: Executor, function: Callable[[str], T], names: Sequence[str]
) -> dict[str, T | BaseException]:
    """Return a function's result, or its error, for each name."""
    found = dict(_each(executor, function, {name: name for name in names}))
    return {name: found[name] for name in names}


def _each(
    executor: Executor, function: Callable[[Any], Any], todo: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Yield each result, or the error, as it comes; few tasks are ahead, so that there may be millions."""
    waiting: dict[Future[Any], str] = {}
    left = iter(todo.items())
    try:
        while True:
            while len(waiting) < AHEAD and (one := next(left, None)) is not None:
                future = executor.submit(function, one[1])
                waiting[future] = one[0]
                if future.done():
                    break
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                key, error = waiting.pop(future), future.exception()
                yield key, error if error is not None else future.result()
    finally:
        for future in waiting:
            future.cancel()


class _Here(Executor):
    """Does each task at once, in this process."""

    def submit(self, function: Callable[..., T], /, *arguments: Any, **options: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(function(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def executor(on: str, workers: int | None) -> Iterator[Executor]:
    """Give what runs the tasks: a Dask cluster at an address, or processes of this machine.

    Parameters
    ----------
    on : str
        Address of a scheduler; empty: this machine.
    workers : int or None
        Processes of one thread each; 1: no other process. Default: one for each processor, with Dask.

    Raises
    ------
    InputError
        If the scheduler does not answer, or Dask is not installed.
    """
    if on:
        with cluster(on) as given:
            yield given
        return
    if workers is None:
        workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        workers = workers if importlib.util.find_spec("distributed") else 1
    if workers == 1:
        yield _Here()
        return
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise InputError("fleet: --workers needs Dask: pip install '.[cluster]'; or --workers 1") from None
    options = {"threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None, "silence_logs": 50}
    with (
        distributed.LocalCluster(n_workers=workers, processes=True, **options) as here,
        cluster(here.scheduler_address, timeout=60.0) as given,
    ):
        yield given
