"""The filter and the smoother of :mod:`.kalman` in C, compiled for each number of states and channels."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from importlib import resources
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.background import InBackground
from hovercontrol.blocks.backends.compiler import load_library
from hovercontrol.blocks.backends.shoot import pool, threads

if TYPE_CHECKING:
    from hovercontrol.identification.engine.kalman import Filtered, Smoothed, System

#: Most groups of columns of a system.
GROUPS = 4

_NUMBERS = ("rows", "stretches", "columns", "groups", "states", "width", "driven", "sampled")
_ARRAYS = (
    "A", "Q", "H", "R", "P0", "moments", "of", "products", "log_dets", "P", "Z", "white", "log_det",
    "weights", "state", "variance", "known", "forces",
)  # fmt: skip


class _Kalman(ctypes.Structure):
    """The struct ``kalman`` of kalman.c."""

    _fields_ = (
        *((name, ctypes.c_long) for name in _NUMBERS),
        ("count", ctypes.c_long * GROUPS),
        ("drive_strides", ctypes.c_long * (2 * GROUPS)),
        ("seen_strides", ctypes.c_long * (2 * GROUPS)),
        ("drive", ctypes.c_void_p * GROUPS),
        ("seen", ctypes.c_void_p * GROUPS),
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
            call.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long]

    def filter(self, system: System, found: Filtered) -> None:
        """Fill what a filter run finds.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a covariance of innovations is not positive definite.
        """
        self._run(self._filter, system, **_of_filter(found))

    def smoother(self, system: System, filtered: Filtered, weights: Array, found: Smoothed) -> None:
        """Fill what a smoother run finds; `weights` has shape (W, m)."""
        arrays = {name: getattr(found, name) for name in ("state", "variance", "known", "forces")}
        self._run(self._smoother, system, **_of_filter(filtered), weights=weights, **arrays)

    def _run(self, call: Callable[..., int], system: System, **arrays: Array | None) -> None:
        own = {"A": system.A, "Q": system.Q, "H": system.H, "R": system.R, "P0": system.P0}
        forces = system.forces
        given = {k: None if a is None else np.ascontiguousarray(a) for k, a in (own | arrays).items()}
        given |= {"moments": np.ascontiguousarray(forces.moments), "of": np.array(forces.of, dtype="l")}
        columns = [[None if a is None else _laid(a) for a in pair] for pair in system.columns]
        rows, stretches = system.R.shape[:2]
        numbers = (
            rows, stretches, sum(system.counts), len(columns), forces.states, system.A.shape[-1],
            len(forces.of), forces.sampled,
        )  # fmt: skip
        drive, seen = zip(*columns, strict=True)
        places = {k: None if a is None else a.ctypes.data for k, a in given.items()}
        job = _Kalman(
            *numbers,
            (ctypes.c_long * GROUPS)(*system.counts),
            _strides(drive),
            _strides(seen),
            _places(drive),
            _places(seen),
            **places,
        )
        chains = system.chains.astype("l")
        parts = max(min(threads(), len(chains) - 1), 1)
        edges = np.linspace(0, len(chains) - 1, parts + 1).astype(int).tolist()

        def part(span: tuple[int, int]) -> int:
            first, end = span
            return int(call(ctypes.byref(job), chains[first:].ctypes.data, end - first))

        spans = list(pairwise(edges))
        failed = list(pool().map(part, spans) if parts > 1 else map(part, spans))
        if 2 in failed:
            raise MemoryError("no memory for the filter")
        if any(failed):
            raise np.linalg.LinAlgError("a covariance of the innovations is not positive")


def _laid(a: Array) -> Array:
    """Return an array whose rows of columns, or whose columns, are contiguous."""
    return a if np.moveaxis(a, -1, 0).flags.c_contiguous else np.ascontiguousarray(a)


def _strides(arrays: Sequence[Array | None]) -> ctypes.Array[ctypes.c_long]:
    """Return the distance of states or channels, and of columns, of each array, in numbers."""
    found = [n for a in arrays for n in ((0, 0) if a is None else (a.strides[-2] // 8, a.strides[-1] // 8))]
    return (ctypes.c_long * (2 * GROUPS))(*found)


def _places(arrays: Sequence[Array | None]) -> ctypes.Array[ctypes.c_void_p]:
    return (ctypes.c_void_p * GROUPS)(*(None if a is None else a.ctypes.data for a in arrays))


def _of_filter(found: Filtered) -> dict[str, Array | None]:
    return {
        "products": found.products, "log_dets": found.log_dets, "P": found.P, "Z": found.Z,
        "white": found._white, "log_det": found._log_det,
    }  # fmt: skip


@InBackground
def compiled(build: bool, n: int, C: int) -> Compiled:
    """Return the library for `n` states and `C` channels; None while it is being built."""
    return Compiled(n, C, build=build)
