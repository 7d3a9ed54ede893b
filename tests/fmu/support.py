"""Compile a test model with the runtime and drive it through ctypes."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.blocks.backends.runtime import SIMULATION, runtime_folder

RUNTIME = runtime_folder()
MODELS = Path(__file__).parent / "models"
SOURCES = [RUNTIME / name for name in SIMULATION if name.endswith(".c") and name != "hc_runner.c"]
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]

DORMAND_PRINCE, RK4, DOP853 = 0, 1, 2
OK, NO_MEMORY, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS = range(5)
Array = NDArray[np.float64]


class Options(ctypes.Structure):
    _fields_ = [
        ("method", ctypes.c_int),
        ("rtol", ctypes.c_double),
        ("atol", ctypes.c_double),
        ("step", ctypes.c_double),
        ("max_steps", ctypes.c_long),
        ("nominal", ctypes.POINTER(ctypes.c_double)),
    ]


class ModelType(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("states", "inputs", "parameters", "outputs", "friction")]


def options(rtol=1e-6, atol=None, method=DORMAND_PRINCE, step=0.0, max_steps=0) -> Options:
    return Options(method, rtol, rtol * 1e-2 if atol is None else atol, step, max_steps, None)


def pointer(array: Array | None) -> Any:
    return None if array is None else array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def doubles(values: ArrayLike | None) -> Array | None:
    return None if values is None else np.array(values, dtype=float, order="C")


@dataclass
class Run:
    status: int
    reached: float
    states: Array
    outputs: Array
    last: Array


class Runtime:
    """One compiled model with its runtime."""

    def __init__(self, path: Path) -> None:
        self.lib = lib = ctypes.CDLL(str(path))
        self.model = ModelType.in_dll(lib, "hc_model")
        lib.hc_solver_new.restype = ctypes.c_void_p
        lib.hc_solver_time.restype = ctypes.c_double
        lib.hc_solver_states.restype = ctypes.POINTER(ctypes.c_double)
        lib.hc_solver_modes.restype = ctypes.POINTER(ctypes.c_int)

    def simulate(
        self, times: ArrayLike, x: ArrayLike, p: ArrayLike, u: ArrayLike | None = None, **opts: Any
    ) -> Run:
        m, n = self.model, len(times)
        t, x, p, u = doubles(times), doubles(x), doubles(p), doubles(u)
        states, outputs = np.empty((n, m.states)), np.empty((n, m.outputs))
        reached = ctypes.c_double()
        status = self.lib.hc_simulate(
            ctypes.byref(m), ctypes.byref(options(**opts)), pointer(t), ctypes.c_long(n), pointer(x),
            pointer(u), pointer(p), pointer(states), pointer(outputs), ctypes.byref(reached),
        )  # fmt: skip
        return Run(status, reached.value, states, outputs, x)

    def sweep(
        self, times: ArrayLike, x: ArrayLike, p: ArrayLike, band: ArrayLike, u: ArrayLike | None = None,
        start: float = 0.0, **opts: Any,
    ) -> tuple[Array, Array, NDArray[np.intc]]:  # fmt: skip
        m = self.model
        t, x, p, u, band = doubles(times), doubles(x), doubles(p), doubles(u), doubles(band)
        runs = len(x)
        figures, final = np.empty((runs, m.outputs, 5)), np.empty((runs, m.states))
        status = np.empty(runs, np.intc)
        assert self.lib.hc_sweep(
            ctypes.byref(m), ctypes.byref(options(**opts)), pointer(t), ctypes.c_long(len(t)),
            ctypes.c_long(runs), pointer(x), pointer(u), pointer(p), ctypes.c_double(start), pointer(band),
            pointer(figures), pointer(final), status.ctypes.data_as(ctypes.POINTER(ctypes.c_int)),
        ) == OK  # fmt: skip
        return figures, final, status

    def solver(self, **opts: Any) -> Solver:
        return Solver(self, options(**opts))


class Solver:
    """hc_solver of one model."""

    def __init__(self, runtime: Runtime, opts: Options) -> None:
        self.lib, self.model = runtime.lib, runtime.model
        self.handle = ctypes.c_void_p(self.lib.hc_solver_new(ctypes.byref(self.model), ctypes.byref(opts)))

    def __del__(self) -> None:
        self.lib.hc_solver_free(self.handle)

    def set(
        self, t: float, x: ArrayLike | None = None, u: ArrayLike | None = None, p: ArrayLike | None = None
    ) -> int:
        arrays = [doubles(x), doubles(u), doubles(p)]
        return self.lib.hc_solver_set(self.handle, ctypes.c_double(t), *map(pointer, arrays))

    def advance(self, until: float) -> int:
        return self.lib.hc_solver_advance(self.handle, ctypes.c_double(until))

    @property
    def time(self) -> float:
        return self.lib.hc_solver_time(self.handle)

    @property
    def states(self) -> Array:
        return np.array(self.lib.hc_solver_states(self.handle)[: self.model.states])

    @property
    def modes(self) -> list[int]:
        return self.lib.hc_solver_modes(self.handle)[: self.model.friction]

    @property
    def counts(self) -> dict[str, int]:
        counts = (ctypes.c_long * 4)()
        self.lib.hc_solver_counts(self.handle, counts)
        return dict(zip(("evaluations", "accepted", "rejected", "events"), counts, strict=True))


def compile_c(compiler: str, sources: Sequence[Path], target: Path, flags: Sequence[str]) -> None:
    command = [compiler, *STRICT, *flags, f"-I{RUNTIME}", *map(str, sources), "-o", str(target), "-lm"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


_FOLDER = tempfile.TemporaryDirectory(prefix="hovercontrol-objects-")  # removed at the end of the process


@cache
def objects(compiler: str, folder: Path, names: tuple[str, ...], flags: tuple[str, ...]) -> tuple[Path, ...]:
    """Compile C files of a folder, with its headers; return the objects, made once in this process."""
    own = Path(tempfile.mkdtemp(dir=_FOLDER.name))
    command = [compiler, *flags, "-c", f"-I{folder}", *(str(folder / name) for name in names)]
    result = subprocess.run(command, capture_output=True, text=True, cwd=own)
    assert result.returncode == 0, result.stderr
    return tuple(own / name.replace(".c", ".o") for name in names)


def runtime_objects(compiler: str, flags: Sequence[str]) -> tuple[Path, ...]:
    """Return the compiled files of the runtime that simulates."""
    return objects(compiler, RUNTIME, tuple(path.name for path in SOURCES), (*STRICT, *flags))
