"""Libraries that are loaded from the cache, or built behind the caller's back while NumPy does the work."""

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
    """Return what a call loads: at once where it is in the cache, else as soon as it is built.

    Parameters
    ----------
    load : callable
        Called with whether it may build; raises :class:`.compiler.NotCachedError` where it must.
    """
    done: Future[T] = Future()
    try:
        find_compiler()
        done.set_result(load(False))
    except NotCachedError:
        return _builder().submit(load, True)
    except RuntimeError as error:  # no compiler, or it refuses
        done.set_exception(error)
    return done


def ready(building: Future[T], patience: float = 0.0) -> T | None:
    """Return what was loaded; None while it is built, or where that cannot be.

    Parameters
    ----------
    building : Future
    patience : float, optional
        For how long to wait for it [s].
    """
    try:
        return building.result(patience)
    except Exception:  # not yet, or never
        return None
