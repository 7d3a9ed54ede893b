"""The C compiler and the shared libraries it makes of Blocks: found, built, kept in the user's cache, called.

Libraries are cached by the content of all that goes into them. A file's name holds the digest of its bytes,
so that a truncated one is seen before it is loaded; files appear whole, and two processes may build at once.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.targets.c import c_source

Array = NDArray[np.float64]

#: The same numbers on every machine: no fast-math, no fused multiply-add, nothing of this processor alone.
#: (Measured: -flto, -O2, -fno-trapping-math and -march=native gain less than 10 %.)
FLAGS = (
    "-O3 -std=c99 -fno-math-errno -ffp-contract=off -fPIC -shared -fvisibility=hidden".split()  # noqa: SIM905
)
_SUFFIX = ".dll" if os.name == "nt" else ".so"
#: Steps between two times of the grid after which the solver gives up, some seconds.
MAX_STEPS = 10_000_000
NO_MEMORY = 1  # of hc_solver.h
METHODS = ("dormand-prince", "rk4")  # in the order of hc_solver.h
_RUNTIME = ("hc_solver.c", "hc_events.c", "hc_friction.c", "hc_simulate.c")
_EXPORTS = """#include "hc_simulate.h"
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
EXPORT void block_derivatives(double t, const double *x, const double *u, const double *p, double *dx)
{
    hc_model.derivatives(t, x, u, p, 0, dx);
}
EXPORT void block_outputs(double t, const double *x, const double *u, const double *p, double *y)
{
    hc_model.outputs(t, x, u, p, 0, y);
}
EXPORT int block_simulate(const hc_options *options, const double *times, long n_times, double *x,
                          const double *u, const double *p, double *states, double *outputs, double *reached)
{
    return hc_simulate(&hc_model, options, times, n_times, x, u, p, states, outputs, reached);
}
EXPORT int block_sweep(const hc_options *options, const double *times, long n_times, long n_runs,
                       const double *x, const double *u, const double *p, double from, const double *band,
                       double *figures, double *final, int *status)
{
    return hc_sweep(&hc_model, options, times, n_times, n_runs, x, u, p, from, band, figures, final, status);
}
"""


class NoCompilerError(RuntimeError):
    """There is no C compiler; the text says what was looked for."""


def find_compiler() -> tuple[str, ...]:
    """Return the command of a C compiler: ``$CC``, else cc, gcc, clang, else the package ziglang.

    Raises
    ------
    NoCompilerError
        If there is none that answers.
    """
    chosen = shlex.split(os.environ.get("CC", ""))
    for command in [tuple(chosen)] if chosen else _candidates():
        path = shutil.which(command[0])
        if path and version((path, *command[1:])):
            return (os.path.abspath(path), *command[1:])
    if chosen:
        raise NoCompilerError(f"the C compiler of $CC, {shlex.join(chosen)!r}, does not run")
    raise NoCompilerError("no C compiler: neither cc, gcc nor clang, nor ziglang of hovercontrol[fmu]")


def _candidates() -> Iterator[tuple[str, ...]]:
    yield from (("cc",), ("gcc",), ("clang",))
    if importlib.util.find_spec("ziglang"):
        yield sys.executable, "-m", "ziglang", "cc"


@cache
def version(command: tuple[str, ...]) -> str:
    """Return what a compiler says of its version, empty if it does not run (Apple's stub, a broken link)."""
    try:
        done = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, timeout=60, errors="replace"
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def cache_folder() -> Path:
    """Return the folder of cached libraries: ``$HOVERCONTROL_CACHE``, else the user's cache directory.

    Where that cannot be written, a private temporary folder that ends with this process.
    """
    own = os.environ.get("HOVERCONTROL_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache"
    try:
        folder = Path(own or os.path.join(base, "hovercontrol")).expanduser().absolute() / "compiled"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # read-only, full, no home
        return _private_folder()


@cache
def _private_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="hovercontrol-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def load_library(name: str, files: Mapping[str, str]) -> ctypes.CDLL:
    """Return a shared library of C sources, from the cache or built now.

    Parameters
    ----------
    name : str
        Begins the file's name; an identifier.
    files : mapping of str to str
        Sources (``.c``) and headers by file name.

    Raises
    ------
    NoCompilerError
        If there is no C compiler.
    RuntimeError
        If it refuses the sources; the line names its log.
    """
    command = find_compiler()
    stem = f"{name}-{_key(command, files)}"
    for place in (cache_folder, _private_folder):
        folder = place()
        path = _cached(folder, stem) or _build(folder, stem, command, files)
        try:
            return ctypes.CDLL(str(path))
        except OSError as error:  # built for another system that shares this home, or a folder without exec
            reason = error
    raise RuntimeError(f"the compiled library {path} cannot be loaded: {reason}")


def _key(command: tuple[str, ...], files: Mapping[str, str]) -> str:
    parts = [*FLAGS, *command, version(command), sys.platform, platform.machine()]
    for name in sorted(files):
        parts += [name, files[name]]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _cached(folder: Path, stem: str) -> Path | None:
    """Return the library of that name whose bytes are those its name promises; remove any other."""
    for path in sorted(folder.glob(f"{stem}-*{_SUFFIX}")):
        try:
            if _digest(path) == path.stem.rpartition("-")[2]:
                return path
            path.unlink()
        except OSError:  # another process removed it, or it may not be read
            continue
    return None


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _build(folder: Path, stem: str, command: tuple[str, ...], files: Mapping[str, str]) -> Path:
    with tempfile.TemporaryDirectory(prefix=".build-", dir=folder, ignore_cleanup_errors=True) as work:
        for name, text in files.items():
            Path(work, name).write_text(text, encoding="utf-8")
        made = Path(work, f"library{_SUFFIX}")
        sources = [name for name in sorted(files) if name.endswith(".c")]
        call = [*command, *FLAGS, *sources, "-o", made.name, "-lm"]
        done = subprocess.run(call, cwd=work, capture_output=True, text=True, errors="replace")
        if done.returncode != 0 or not made.exists():
            log = folder / f"{stem}.log"
            log.write_text(f"{shlex.join(call)}\n{done.stdout}{done.stderr}", encoding="utf-8")
            first = next((x for x in done.stderr.splitlines() if "error" in x), f"status {done.returncode}")
            raise RuntimeError(f"the C compiler {command[0]} failed: {first.strip()}; its log: {log}")
        target = folder / f"{stem}-{_digest(made)}{_SUFFIX}"
        try:
            os.replace(made, target)
        except OSError:  # Windows: the same file, built by another process, is in use
            if not target.exists():
                raise
        return target


class Solver(NamedTuple):
    """How to integrate; ``step`` 0 means no limit."""

    method: str
    step: float
    rtol: float
    atol: float


class _Options(ctypes.Structure):
    """hc_options of hc_solver.h."""

    _fields_ = (
        ("method", ctypes.c_int),
        ("rtol", ctypes.c_double),
        ("atol", ctypes.c_double),
        ("step", ctypes.c_double),
        ("max_steps", ctypes.c_long),
        ("nominal", ctypes.c_void_p),
    )


class Library:
    """The shared library of one Block and the calls into it; arrays are C-contiguous and not checked.

    Parameters
    ----------
    block : Block
    friction : {"events", "smooth"}
    """

    def __init__(self, block: Block, friction: Literal["events", "smooth"]) -> None:
        self._sizes = len(block.states), len(block.outputs)
        runtime = resources.files("hovercontrol") / "fmu"
        wanted = (f for f in runtime.iterdir() if f.name.endswith(".h") or f.name in _RUNTIME)
        files = {f.name: f.read_text(encoding="utf-8") for f in wanted}
        files |= {"model.c": c_source(block, friction=friction, partials=False), "exports.c": _EXPORTS}
        library = load_library(block.name, files)
        real, whole, pointer = ctypes.c_double, ctypes.c_long, ctypes.c_void_p
        self._simulate, self._sweep = library.block_simulate, library.block_sweep
        self._simulate.argtypes = [pointer, pointer, whole, *[pointer] * 6]
        self._sweep.argtypes = [pointer, pointer, whole, whole, *[pointer] * 3, real, *[pointer] * 4]
        # A right-hand side takes less time than to let go of the interpreter's lock and to take it again.
        short = ctypes.PyDLL(library._name)
        self.derivatives, self.outputs = short.block_derivatives, short.block_outputs
        for function in (self.derivatives, self.outputs):
            function.argtypes, function.restype = [real, *[pointer] * 4], None

    def simulate(
        self, solver: Solver, times: Array, u: Array, x: Array, p: Array
    ) -> tuple[int, float, Array, Array]:
        """Return status, time reached, states and outputs, each of shape (n_times, signals)."""
        n_states, n_outputs = self._sizes
        states, outputs = np.empty((len(times), n_states)), np.empty((len(times), n_outputs))
        reached, last, rows = np.array([times[0]]), x.copy(), np.ascontiguousarray(u.T)
        arrays = (a.ctypes.data for a in (last, rows, p, states, outputs, reached))
        options = _options(solver)
        status = self._simulate(ctypes.byref(options), times.ctypes.data, len(times), *arrays)
        if status == NO_MEMORY:
            raise MemoryError("no memory for the solver")
        return status, float(reached[0]), states, outputs

    def sweep(
        self,
        solver: Solver,
        times: Array,
        u: Array,
        x: Array,
        p: Array,
        since: float,
        band: Array,
        results: tuple[Array, Array, NDArray[np.intc]],
    ) -> None:
        """Fill the results of some runs: figures, last states, status."""
        options, rows = _options(solver), np.ascontiguousarray(u.T)
        before = (a.ctypes.data for a in (x, rows, p))
        after = (a.ctypes.data for a in (band, *results))
        grid = (times.ctypes.data, len(times), len(x))
        if self._sweep(ctypes.byref(options), *grid, *before, since, *after) == NO_MEMORY:
            raise MemoryError("no memory for the solver")


def _options(solver: Solver) -> _Options:
    method = METHODS.index(solver.method)
    steps = MAX_STEPS if method == 0 else 0
    return _Options(method, solver.rtol, solver.atol, solver.step, steps, None)
