"""Load libraries from the cache, or build them in a background thread while NumPy does the work."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from hovercontrol.io.users_code import OWN_THREADS
from hovercontrol.targets.compiler import NotCachedError, find_compiler

T = TypeVar("T")


@cache
def _builder() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix=OWN_THREADS)


def loaded(load: Callable[[bool], T]) -> Future[T]:
    """Return the future of a loaded library: complete if it is in the cache, else once it is built.

    Parameters
    ----------
    load : callable
        Called with a bool: whether it may build the library. Raises :class:`.compiler.NotCachedError` if it
        may not but must.
    """
    done: Future[T] = Future()
    try:
        find_compiler()
        done.set_result(load(False))
    except NotCachedError:
        return _builder().submit(load, True)
    except RuntimeError as error:  # no compiler, or the compiler fails
        done.set_exception(error)
    return done


def ready(building: Future[T], patience: float = 0.0) -> T | None:
    """Return the loaded library; None while it is being built, or if that is impossible.

    Parameters
    ----------
    building : Future
    patience : float, optional
        Maximum waiting time [s].
    """
    try:
        return building.result(patience)
    except Exception:  # not built yet, or failed
        return None
