"""Cost of a right-hand side through an imported FMU for Model Exchange, over the FMU's own.

The FMU's own cost: its calls of time, states, inputs and derivatives by a loop in C. Ours: the
function behind ``system.dynamics`` that python-control calls, at points of which time, states and inputs
differ from the last, and at points of which the states alone differ.
"""

from __future__ import annotations

import ctypes
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import hovercontrol as hc
from hovercontrol.blocks.backends.compiler import load_library
from hovercontrol.fmi import load
from hovercontrol.fmi.importer.model import FmuModel

Array = NDArray[np.float64]
Row = tuple[str, str, str, bool | None]

POINTS, REPEATS = 5_000, 101
BAR = 2e-6

OWN = """
#include <stddef.h>
#include <stdint.h>
typedef int set_time(void *, double);
typedef int set_states(void *, const double *, size_t);
typedef int set_real(void *, const uint32_t *, size_t, const double *);
typedef int rates(void *, double *, size_t);
__attribute__((visibility("default")))
int own(void *c, set_time *a, set_states *b, set_real *d, rates *e, const uint32_t *of, const double *x,
        const double *u, size_t n, size_t m, long points)
{
    double k[64];
    int worst = 0;
    for (long i = 0; i < points; i++) {
        worst |= a(c, 1e-3 * (double)i) | b(c, x + (size_t)(i & 1) * n, n);
        worst |= d(c, of, m, u + (size_t)(i & 1) * m) | e(c, k, n);
    }
    return worst;
}
"""


def least(run: Callable[[], object]) -> float:
    """Return the least time of some runs for one point [s]."""
    found = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        run()
        found.append(time.perf_counter() - begin)
    return min(found) / POINTS


def rows() -> Iterator[Row]:
    """Yield what was measured, its value, the bar, and whether it is met."""
    with tempfile.TemporaryDirectory() as name:
        path = hc.vehicle("c17_simulation").plant().to_fmu(Path(name) / "craft.fmu", version=2)
        system = load(path, kind="ModelExchange")
        assert isinstance(system, FmuModel)
        rng = np.random.default_rng(0)
        x, u = rng.normal(0.0, 0.5, (2, system.nstates)), rng.uniform(0.2, 1.0, (2, system.ninputs))
        system._rhs(0.0, x[0], u[0])
        yield from measured(system, x, u)
        system.close()


def measured(system: FmuModel, x: Array, u: Array) -> Iterator[Row]:
    """Yield the costs of one FMU."""
    fmu = system._engine._fmu
    calls = [
        ctypes.cast(getattr(fmu.dll, f"fmi2{name}"), ctypes.c_void_p)
        for name in ("SetTime", "SetContinuousStates", "SetReal", "GetDerivatives")
    ]
    references = (ctypes.c_uint32 * system.ninputs)(*(v.reference for v in system.interface.inputs))
    library = load_library("fmu_rates", {"own.c": OWN})
    sizes = (ctypes.c_size_t(system.nstates), ctypes.c_size_t(system.ninputs), ctypes.c_long(POINTS))
    arguments = (ctypes.c_void_p(fmu.component), *calls, references, ctypes.c_void_p(x.ctypes.data))
    own = least(lambda: library.own(*arguments, ctypes.c_void_p(u.ctypes.data), *sizes))
    system._engine.forget()
    f = system._rhs
    times = [1e-3 * i for i in range(POINTS)]

    def all_differ() -> None:
        for i, t in enumerate(times):
            f(t, x[i & 1], u[i & 1])

    def states_differ() -> None:
        for i in range(POINTS):
            f(0.0, x[i & 1], u[0])

    def empty() -> None:
        for i, t in enumerate(times):
            (t, x[i & 1], u[i & 1])

    around = least(empty)
    yield "an FMU of six states: its own right-hand side, called in C", f"{1e6 * own:.2f} us", "", None
    for what, run in (("states differ", states_differ), ("time, states and inputs differ", all_differ)):
        over = least(run) - around - own
        yield f"imported: over its own, {what}", f"{1e6 * over:.2f} us", "<= 2 us", over <= BAR
