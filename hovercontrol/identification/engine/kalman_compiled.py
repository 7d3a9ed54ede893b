"""The filter and the smoother of :mod:`.kalman` in C, compiled for each number of states and channels."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from importlib import resources
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.blocks.backends.background import InBackground
from hovercontrol.blocks.backends.compiler import load_library
from hovercontrol.blocks.backends.shoot import pool, threads

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_ARRAYS = (
    "A", "Q", "drive", "H", "R", "seen", "P0", "white", "log_det", "half", "back", "P", "Z",
    "weights", "state", "covariance", "push", "information",
)  # fmt: skip


class _Kalman(ctypes.Structure):
    """The struct ``kalman`` of kalman.c."""

    _fields_ = (
        *((name, ctypes.c_long) for name in ("rows", "stretches", "columns")),
        *((name, ctypes.c_void_p) for name in _ARRAYS),
    )


class Compiled:
    """The library for `n` states and `C` channels."""

    def __init__(self, n: int, C: int, *, build: bool = True) -> None:
        source = (resources.files("hovercontrol.identification.engine") / "kalman.c").read_text(
            encoding="utf-8"
        )
        files = {"kalman.c": source, "sizes.h": f"enum {{ N = {n}, C = {C} }};\n"}
        library = load_library(f"kalman_{n}_{C}", files, build=build)
        self._filter, self._smoother = library.kalman_filter, library.kalman_smoother
        for call in (self._filter, self._smoother):
            call.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_long]

    def filter(self, chains: Indices, **arrays: Array | None) -> None:
        """Fill ``white``, ``log_det`` and, unless None, ``half``, ``back``, ``P`` and ``Z``.

        Parameters
        ----------
        chains : ndarray of int
            :attr:`System.chains <hovercontrol.identification.engine.kalman.System.chains>`.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a covariance of innovations is not positive definite.
        """
        self._run(self._filter, chains, arrays)

    def smoother(self, chains: Indices, **arrays: Array | None) -> None:
        """Fill ``state``, ``covariance``, ``push`` and ``information``."""
        self._run(self._smoother, chains, arrays)

    def _run(self, call: Callable[..., int], chains: Indices, arrays: dict[str, Array | None]) -> None:
        given = {k: None if a is None else np.ascontiguousarray(a) for k, a in arrays.items()}
        rows, stretches, _, columns = given["white"].shape  # type: ignore[union-attr]
        places = {k: None if a is None else a.ctypes.data for k, a in given.items()}
        job = _Kalman(rows, stretches, columns, **places)
        spans = list(pairwise(chains.tolist()))

        def part(span: tuple[int, int]) -> int:
            return int(call(ctypes.byref(job), *span))

        several = len(spans) > 1 and threads() > 1
        failed = list(pool().map(part, spans) if several else map(part, spans))
        if 2 in failed:
            raise MemoryError("no memory for the filter")
        if any(failed):
            raise np.linalg.LinAlgError("a covariance of the innovations is not positive")


@InBackground
def compiled(build: bool, n: int, C: int) -> Compiled:
    """Return the library for `n` states and `C` channels; None while it is being built."""
    return Compiled(n, C, build=build)
