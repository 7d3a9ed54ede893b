"""The engine that computes a compiled Block: its shared library, or NumPy without a compiler."""

from __future__ import annotations

import math
import warnings
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.annotations import fits
from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.blocks.backends.compiler import NoCompilerError
from hovercontrol.blocks.backends.library import METHODS, Library, Point, Solver, Step, check_point
from hovercontrol.blocks.block import Block, Rows
from hovercontrol.blocks.friction import Friction
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.runge_kutta import rk4
from hovercontrol.blocks.simulation.ticking import Running
from hovercontrol.blocks.simulation.trajectory import simulate

Results = tuple[Array, Array, NDArray[np.intc]]


class NumpyEngine:
    """Does the work of :class:`.library.Library` without a compiler; methods and arguments are the same."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.pair = numpy_functions(block).scalar_pair

    def point(self, rows: Rows, values: tuple[float, ...]) -> Point:
        """Return the function ``(t, x, u) -> array`` at fixed parameters."""
        pair = self.pair(rows)

        def function(t: float, x: ArrayLike, u: ArrayLike = ()) -> Array:
            check_point(self.block, x, u)
            states, inputs = (np.asarray(a, dtype=float).tolist() for a in (x, u))
            return np.array(call_scalar(pair, t, states, inputs, values), dtype=float)

        return function

    def advance(self, solver: Solver, t: float, until: float, x: Array, u: Array, p: Array) -> int:
        """Change the states x at `t` to those at `until`, in place; return the status."""
        if self.block.ticks:
            run = Running(self.block, t, x.tolist(), u.tolist(), p.tolist())
            run.advance(until, open_end=True)
            x[:] = run.state
            return 0
        if until > t:
            status, *_, last = self.simulate(
                solver, np.array([t, until]), np.repeat(u[:, None], 2, axis=1), x, p
            )
            x[:] = last
            return status
        return 0

    def stepper(self, solver: Solver, values: tuple[float, ...]) -> Step:
        """Return the function ``(t, until, x, u) -> (status, array)`` at fixed parameters."""
        p = np.array(values)

        def function(t: float, until: float, x: ArrayLike, u: ArrayLike) -> tuple[int, Array]:
            check_point(self.block, x, u)
            states = np.array(x, dtype=float)
            return self.advance(solver, t, until, states, np.asarray(u, dtype=float), p), states

        return function

    def simulate(
        self, solver: Solver, times: Array, u: Array, x: Array, p: Array
    ) -> tuple[int, float, Array, Array, Array]:
        """Return the status, the time reached, the states, the outputs and the last states."""
        params = dict(zip(self.block.default_parameters, p.tolist(), strict=True))
        if solver.method != "rk4" or self.block.ticks:
            method = "DOP853" if solver.method == "dop853" else "RK45"
            longest, rtol, atol = solver.step or math.inf, solver.rtol, solver.atol
            r = simulate(
                self.block, times, u, x, params, method=method, rtol=rtol, atol=atol, max_step=longest
            )
            found = np.atleast_2d(r.states).T
            return 0, times[-1], found, np.atleast_2d(r.outputs).T, found[-1]
        states = [x.tolist()]
        for k, (t, until) in enumerate(pairwise(times.tolist())):
            steps = math.ceil((until - t) / solver.step - 1e-9)
            states.append(
                rk4(self.pair("derivatives"), t, states[-1], u[:, k].tolist(), p.tolist(), until, steps)
            )
            if not np.isfinite(states[-1]).all():
                return 2, t, np.array(states), np.empty((0, 0)), np.array(states[-2])
        found = np.array(states).reshape(len(times), -1)
        outputs = numpy_functions(self.block).outputs(times, found.T, u, params).T
        return 0, times[-1], found, outputs, found[-1]

    def sweep(
        self,
        solver: Solver,
        times: Array,
        u: Array,
        x: Array,
        p: Array,
        since: float,
        band: Array,
        results: Results,
    ) -> None:
        """Write the results of some runs: figures, last states, status."""
        figures, last, statuses = results
        counted = times >= times[0] + since
        t = times[counted]
        for k in range(len(x)):
            try:
                statuses[k], _, _, outputs, last[k] = self.simulate(solver, times, u, x[k], p[k])
            except InputError as error:
                statuses[k] = 2 if "not a number" in str(error) else 3
            if statuses[k]:
                continue
            # settling: the first time after the last one with |y(t) - y(t_end)| > band;
            # rms: sqrt(1/(t_end - t_0) integral of y^2 dt) by the trapezoidal rule
            y = outputs[counted]
            away = np.abs(y - y[-1]) > band
            settled = [t[np.flatnonzero(a)[-1] + 1] if a.any() else t[0] for a in away.T]
            rms = np.sqrt(np.trapezoid(y**2, t, axis=0) / (t[-1] - t[0])) if len(t) > 1 else np.abs(y[0])
            figures[k] = np.transpose([y[-1], y.max(axis=0), y.min(axis=0), rms, settled])


Engine = Library | NumpyEngine


@lru_cache(maxsize=64)
def engine_of(block: Block, friction: Friction, whole: bool = True, lanes: bool = False) -> Engine:
    """Return the cached engine of a Block; arguments are those of :class:`.library.Library`."""
    try:
        return Library(block, friction, whole=whole, lanes=lanes)
    except NoCompilerError as error:
        _warn_once(str(error))
        return NumpyEngine(block)


@cache
def _warn_once(reason: str) -> None:
    warnings.warn(
        f"{reason}: compiled Blocks run on NumPy, some thousand times slower and with smoothed friction; "
        "install a C compiler or pip install '.[fmu]'",
        stacklevel=5,
    )


def checked_solver(method: str, step: float | None, rtol: float, atol: float) -> Solver:
    """Return the solver settings, checked.

    Raises
    ------
    InputError
        If the method is unknown, rk4 has no step, or a number is not positive.
    """
    check_known(method, METHODS, f"unknown method {method!r}")
    if step is None and method == "rk4":
        raise InputError("method 'rk4' needs a step, in seconds")
    for name, value in (("step", step), ("rtol", rtol), ("atol", atol)):
        if value is not None and not (fits(value, float) and 0 < value < math.inf):
            raise InputError(f"{name} must be positive, found {shown(value)}")
    return Solver(method, step if step and step < math.inf else 0.0, rtol, atol)
