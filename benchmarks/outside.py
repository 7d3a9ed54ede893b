"""Table I's loop with its estimator by numba: the same equations and the same Runge-Kutta pair, beside ours.

The loop by numba is what a user would write: Dormand-Prince 5(4) with step-size control, compiled with the
equations in it, which returns the last states of each phase. Times are the least of 31 calls in turn,
processor time of one thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import sympy as sp

from benchmarks.compiled import least, table_one
from benchmarks.fused import systems
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import _Floats
from hovercontrol.blocks.program import Program
from hovercontrol.blocks.sgn import regularise
from hovercontrol.blocks.signals import time
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import phase_parameters

#: Dormand and Prince, J. Comp. Appl. Math. 6, 1980: nodes, stages, and the difference of the two orders.
C = [0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1]
A = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
]
E = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]


def rates_text(block: Block) -> str:
    """Return the derivatives as the text of a function ``f(t, x, p, dx)``."""
    program = Program(block, [regularise(block.expand(e)) for e in block.derivatives.values()])
    short: dict[sp.Symbol, sp.Symbol] = {time: sp.Symbol("t")}
    short |= {s.symbol: sp.Symbol(f"x[{k}]") for k, s in enumerate(block.states)}
    short |= {s.symbol: sp.Symbol(f"p[{k}]") for k, s in enumerate(block.parameters)}
    short |= {symbol: sp.Symbol(f"c{k}") for k, (symbol, _) in enumerate(program.steps)}
    show = _Floats().doprint
    lines = [f"    {short[symbol]} = {show(e.xreplace(short))}" for symbol, e in program.steps]
    lines += [f"    dx[{k}] = {show(e.xreplace(short))}" for k, e in enumerate(program.results)]
    return "\n".join(["def f(t, x, p, dx):", *lines])


def stage_text(k: int) -> str:
    """Return the statement of stage k: y = x + h (a_1 K_1 + ...)."""
    terms = " + ".join(f"{a!r} * K[{j}, i]" for j, a in enumerate(A[k]) if a)
    return f"""        for i in range(n):
            y[i] = x[i] + h * ({terms})
        f(t + {C[k]!r} * h, y, p, K[{k}])
"""


def loop_text() -> str:
    """Return the text of ``run(t, end, x, p, rtol, atol)``, which returns the last states."""
    stages = "".join(stage_text(k) for k in range(1, 7))
    error = " + ".join(f"{e!r} * K[{j}, i]" for j, e in enumerate(E) if e)
    return f"""def run(t, end, start, p, rtol, atol):
    n = len(start)
    x, y, K, h = start.copy(), np.empty(n), np.empty((7, n)), 1e-3
    f(t, x, p, K[0])
    while t < end:
        h = min(h, end - t)
{stages}        total = 0.0
        for i in range(n):
            size = atol + rtol * max(abs(x[i]), abs(y[i]))
            total += (h * ({error}) / size) ** 2
        norm = math.sqrt(total / n)
        if norm <= 1.0:
            t = end if end - t <= h else t + h
            for i in range(n):
                x[i], K[0, i] = y[i], K[6, i]
        h *= min(10.0, max(0.2, 0.9 * (norm + 1e-300) ** -0.2))
    return x
"""


def compiled_by(jit: Callable[..., Any], block: Block) -> Callable[..., Any]:
    """Return ``run`` of :func:`loop_text` for a Block, compiled by numba."""
    space: dict[str, Any] = {"math": math, "np": np}
    exec(rates_text(block), space)
    space["f"] = jit(error_model="numpy")(space["f"])
    exec(loop_text(), space)
    return jit(error_model="numpy")(space["run"])


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    try:
        from numba import njit
    except ImportError:
        yield "numba is not installed (pip install numba): nothing is measured", "", "", None
        return
    scenario, block = load_scenario("table1"), systems()[0].block
    ours, run = block.compile(), compiled_by(njit, block)
    start = np.array([s.start for s in block.states])
    params = [np.array(block.parameter_values(phase_parameters(scenario, p))) for p in scenario.phases]

    def by_numba(rtol: float = 1e-6, atol: float = 1e-9) -> np.ndarray:
        x, ran = start, 0.0
        for phase, p in zip(scenario.phases, params, strict=True):
            x, ran = run(ran, phase.until, x, p, rtol, atol), phase.until
        return x

    def by_c(**options: Any) -> np.ndarray:
        x, ran = start, 0.0
        for phase in scenario.phases:
            given = phase_parameters(scenario, phase)
            found = ours.simulate([ran, phase.until], x0=x, params=given, outputs=[], **options)
            x, ran = found.states[:, -1], phase.until
        return x

    def with_rows(**options: Any) -> np.ndarray:
        two = ["error_x", "error_y"]
        found = table_one(
            lambda g, x, p: ours.simulate(g, x0=x, params=p, outputs=two, **options), scenario, start
        )
        return found[-1].states[:, -1]

    tight = {"rtol": 1e-9, "atol": 1e-12}
    gap = float(np.abs(by_numba(**tight) - by_c(**tight)).max())
    numba, own, every = (1e3 * t for t in least([by_numba, by_c, with_rows], 31))
    yield "Table I, 50 s, rtol 1e-6, a loop by numba", f"{numba:.2f} ms", "", None
    yield "the same by compile(), without rows in between", f"{own:.2f} ms", "", None
    yield "ratio", f"{numba / own:.2f} times as fast", "", None
    yield "with all states and two outputs at 1,000 times", f"{every:.2f} ms", "", None
    yield "largest difference of the last states at rtol 1e-9", f"{gap:.1e}", "< 1e-6", gap < 1e-6
