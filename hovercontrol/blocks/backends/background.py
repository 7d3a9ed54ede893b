"""Load a library from the cache, or build it in a background thread while NumPy does the work."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache, lru_cache, partial
from typing import Concatenate, Generic, ParamSpec, TypeVar

from hovercontrol.base.users_code import OWN_THREADS
from hovercontrol.blocks.backends.compiler import NotCachedError, find_compiler

P = ParamSpec("P")
T = TypeVar("T")


@cache
def _builder() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix=OWN_THREADS)


class InBackground(Generic[P, T]):
    """A function that returns a library without waiting for the compiler; used as a decorator.

    Called with the arguments of `load`, it returns the library, or None while the library is being built or
    if it cannot be built.

    Parameters
    ----------
    load : callable
        Called as ``load(build, ...)``; `build` says whether it may build the library. It raises
        :class:`.compiler.NotCachedError` if it may not but must.
    """

    def __init__(self, load: Callable[Concatenate[bool, P], T]) -> None:
        self._load = load
        self._future: Callable[P, Future[T]] = lru_cache(maxsize=500)(self._loaded)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T | None:
        """Return the library, or None if it is not available now."""
        return self.within(0.0, *args, **kwargs)

    def within(self, seconds: float, *args: P.args, **kwargs: P.kwargs) -> T | None:
        """Return the library as a call does, after waiting for at most some time [s]."""
        try:
            return self.future(*args, **kwargs).result(seconds)
        except Exception:  # not built yet, or failed
            return None

    def future(self, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return the future of the library: complete if it is in the cache, else once it is built."""
        return self._future(*args, **kwargs)

    def _loaded(self, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        done: Future[T] = Future()
        try:
            find_compiler()
            done.set_result(self._load(False, *args, **kwargs))
        except NotCachedError:
            return _builder().submit(partial(self._load, True), *args, **kwargs)
        except RuntimeError as error:  # no compiler, or the compiler fails
            done.set_exception(error)
        return done
