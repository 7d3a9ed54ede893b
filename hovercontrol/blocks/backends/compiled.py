"""A Block compiled to machine code: fast simulation, and sweeps over thousands of runs on all cores.

The generated C code (:mod:`.c`) and the runtime in ``fmu/`` are compiled to a shared library
(:mod:`.library`). Without a C compiler the same calls use NumPy (:mod:`.engines`), which is slow and always
smooths dry friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.annotations import fits
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.backends.engines import Engine, checked_solver, engine_of
from hovercontrol.blocks.backends.executors import sweep_on
from hovercontrol.blocks.backends.library import Library, Point, Solver, states_and_inputs
from hovercontrol.blocks.backends.native_runner import NativeEngine
from hovercontrol.blocks.backends.sweep import (
    Many,
    SweepResult,
    number_of_threads,
)
from hovercontrol.blocks.backends.sweep_run import run_sweep
from hovercontrol.blocks.block import Block, Rows
from hovercontrol.blocks.delays import arrivals, undelayed
from hovercontrol.blocks.friction import Friction
from hovercontrol.blocks.simulation.arguments import checked_times, initial_state, input_rows
from hovercontrol.blocks.simulation.python_runner import start_block
from hovercontrol.blocks.simulation.reasons import REASONS, StoppedError, where_it_stops
from hovercontrol.blocks.simulation.runner import BlockRunner, Inputs
from hovercontrol.blocks.simulation.ticking import between_ticks
from hovercontrol.blocks.simulation.trajectory import time_response
from hovercontrol.blocks.summary import block_line

if TYPE_CHECKING:
    import control

Method = Literal["dormand-prince", "rk4", "dop853"]


def compile_block(block: Block, *, friction: Friction = "smooth") -> CompiledBlock:
    """Return a Block compiled to machine code; ``block.compile()`` does the same.

    Parameters
    ----------
    friction : {"smooth", "events"}, optional
        Dry friction smoothed over its width, as in every backend, or Coulomb's law, which sticks at exactly
        zero velocity; see :data:`hovercontrol.blocks.friction.Friction`.

    Raises
    ------
    RuntimeError
        If the C compiler fails; the message gives its log file. Without a compiler NumPy is used, and a
        warning says so once.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0, lower=0.0)
    >>> decay = compile_block(Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> decay.simulate([0.0, 1.0], params={"decay.k": 1.0}).outputs.round(5).tolist()
    [[1.0, 0.36788]]
    >>> decay.sweep([0.0, 1.0], params={"decay.k": [0.0, 1.0, 2.0]})["v"].final.round(5).tolist()
    [1.0, 0.36788, 0.13534]
    """
    return CompiledBlock(block, friction)


class CompiledBlock:
    """A Block ready for fast simulation, from :func:`compile_block`. It is safe to use in several threads.

    Parameters
    ----------
    friction : {"events", "smooth"}
    """

    def __init__(self, block: Block, friction: Friction = "smooth") -> None:
        if friction not in ("events", "smooth"):
            raise InputError(f"friction must be 'events' or 'smooth', found {friction!r}")
        self.block, self.friction = block, friction
        self._plain = undelayed(block)
        self._engine = engine_of(self._plain, friction, whole=False)
        self._whole: Engine | None = None
        self._defaults = block.parameter_values()
        self._point = lru_cache(maxsize=16)(self._make_point)
        self._selected = lru_cache(maxsize=16)(self._select)

    def __repr__(self) -> str:
        how = "machine code" if self.native else "NumPy"
        return f"CompiledBlock ({how}, {self.friction} friction) of {block_line(self.block)}"

    def __reduce__(self) -> tuple[Any, ...]:
        return CompiledBlock, (self.block, self.friction)

    def _select(self, outputs: tuple[str, ...]) -> CompiledBlock:
        return CompiledBlock(self.block.with_outputs(outputs), self.friction)

    @property
    def native(self) -> bool:
        """Whether machine code is used; without a compiler it is NumPy."""
        return isinstance(self._engine, Library)

    def _engine_from(self, x: Array, lanes: bool = False) -> Engine:
        """Return the engine for initial states; it omits the resting states if they all start at zero."""
        whole = isinstance(self._engine, Library) and bool(x[..., self._engine.resting].any())
        return engine_of(self._plain, self.friction, whole, lanes) if whole or lanes else self._engine

    @checked
    def derivatives(
        self, t: float, x: ArrayLike, u: ArrayLike = (), params: Mapping[str, float] | None = None
    ) -> Array:
        """Return the states' time derivatives, shape (n_states,).

        The values are those of ``block.to_numpy()``: dry friction is smooth here for every `friction`.

        Parameters
        ----------
        t : float
            Time [s].
        x : array_like, shape (n_states,)
        u : array_like, shape (n_inputs,)
        params : mapping, optional
            Parameter values by key; others have their defaults.
        """
        return self.point_function("derivatives", params)(t, x, u)

    @checked
    def outputs(
        self, t: float, x: ArrayLike, u: ArrayLike = (), params: Mapping[str, float] | None = None
    ) -> Array:
        """Return the outputs, shape (n_outputs,); arguments as in :meth:`derivatives`."""
        return self.point_function("outputs", params)(t, x, u)

    @checked
    def point_function(self, rows: Rows, params: Mapping[str, float] | None = None) -> Point:
        """Return the function ``(t, x, u) -> array`` at fixed parameters, for use in other solvers."""
        values = self.block.parameter_values(params, bounded=False) if params else self._defaults
        return self.point_values(rows, values)

    def point_values(self, rows: Rows, values: tuple[float, ...]) -> Point:
        """Return the same function, unchecked, for all parameter values in order."""
        return self._point(rows, values)

    def _make_point(self, rows: Rows, values: tuple[float, ...]) -> Point:
        self.block.need_prompt_inputs("a function of one instant")
        return engine_of(self.block, "smooth").point(rows, values)

    @checked
    def advance(
        self,
        t: float,
        until: float,
        x: ArrayLike,
        u: ArrayLike = (),
        params: Mapping[str, float] | None = None,
        *,
        rtol: float = 1e-6,
        atol: float = 1e-9,
    ) -> Array:
        """Return the states at a later time, for stepwise loops such as an animation or a pilot.

        Parameters
        ----------
        t, until : float
            Begin and end [s]. A hybrid Block executes its ticks at `t`, but not those at `until`. If `until`
            equals `t`, the states after the ticks are returned.
        x : array_like, shape (n_states,)
        u : array_like, shape (n_inputs,)
            Held inputs.
        params, rtol, atol
            As for :meth:`simulate`.

        Returns
        -------
        ndarray, shape (n_states,)

        Raises
        ------
        InputError
            If a shape is wrong, `until` is before `t`, the solver fails, or inputs are delayed.
        """
        if not (fits(t, float) and fits(until, float) and t <= until < math.inf):
            raise InputError(f"expected a time from {shown(t)} s on, found {shown(until)}")
        x, u = states_and_inputs(self.block, x, u)
        values = self._defaults if params is None else self.block.parameter_values(params)
        solver = checked_solver("dormand-prince", None, rtol, atol)
        return self.advance_values(t, until, x, u, values, solver)

    def advance_values(
        self, t: float, until: float, x: ArrayLike, u: ArrayLike, values: Sequence[float], solver: Solver
    ) -> Array:
        """Do the same as :meth:`advance`, unchecked, with all parameter values in order."""
        self.block.need_prompt_inputs("a single step")
        engine = self._whole or self._look_for_whole()
        states, p = np.array(x, dtype=float), np.array(values)
        status = engine.advance(solver, t, until, states, np.array(u, dtype=float), p)
        if status:
            where = self._where(t, states, np.array(u, dtype=float), p, until - t, solver)
            raise self._stopped(f"after t = {t:.6g} s", status, where)
        return states

    def _look_for_whole(self) -> Engine:
        self._whole = engine_of(self.block, self.friction)
        return self._whole

    @checked
    def start(
        self,
        x0: ArrayLike | Mapping[str, float] | None = None,
        params: Mapping[str, float] | None = None,
        *,
        inputs: Inputs | None = None,
        time: float = 0.0,
        rtol: float = 1e-6,
        atol: float = 1e-9,
    ) -> BlockRunner:
        """Start a stepwise simulation in machine code.

        Arguments, result and errors are those of :meth:`hovercontrol.blocks.block.Block.start`.
        """
        if not self.native:
            return start_block(self.block, x0, params, inputs=inputs, time=time, rtol=rtol, atol=atol)
        whole = engine_of(self._plain, self.friction)
        assert isinstance(whole, Library)
        solver, n = checked_solver("dormand-prince", None, rtol, atol), len(self.block.outputs)
        return BlockRunner(
            self.block,
            lambda begin, states, held, values: NativeEngine(whole, solver, begin, states, held, values, n),
            x0, params, inputs, time,
        )  # fmt: skip

    @checked
    def simulate(
        self,
        time: ArrayLike,
        inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
        x0: ArrayLike | Mapping[str, float] | None = None,
        params: Mapping[str, float] | None = None,
        *,
        method: Method = "dormand-prince",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        hold: str = "zero",
        outputs: Sequence[str] | None = None,
    ) -> control.TimeResponseData:
        """Simulate over a time grid; arguments and result are those of :func:`hovercontrol.simulate`.

        Parameters
        ----------
        time, inputs, x0, params
            As for that function. An input is held from one time to the next.
        method : {"dormand-prince", "rk4", "dop853"}, optional
            Dormand-Prince 5(4) with step-size control, the classical Runge-Kutta method in equal steps, or
            Dormand-Prince 8(5,3) with step-size control, which is faster at tolerances below 1e-8.
        step : float, optional
            Step size of rk4, maximum step size of the others [s].
        rtol, atol : float, optional
            Relative and absolute tolerance; rk4 ignores them.
        hold : {"zero"}, optional
            Compiled simulations do not interpolate inputs.
        outputs : sequence of str, optional
            Names of the outputs to compute (default: all). A selection is compiled at its first use.

        Raises
        ------
        InputError
            As for that function; if the solver fails, the message gives the time reached.
        """
        if outputs is not None:
            return self._selected(tuple(outputs)).simulate(
                time, inputs, x0, params, method=method, step=step, rtol=rtol, atol=atol, hold=hold
            )
        if hold != "zero":
            raise InputError(
                f"hold must be 'zero' in a compiled simulation, found {hold!r}: "
                "hovercontrol.simulate interpolates with hold='linear'"
            )
        times = checked_times(time)
        u = input_rows(self.block, inputs, times)
        x = initial_state(self.block, x0)
        p = np.array(self.block.parameter_values(params))
        solver = checked_solver(method, step, rtol, atol)
        late = arrivals(self.block, times, u, p)
        run = self._engine_from(x).simulate(solver, late.times, late.inputs, x, p)
        status, reached, states, y, last = run
        if status:
            row = max(int(np.searchsorted(late.times, reached, side="right")) - 1, 0)
            where = self._where(reached, last, late.inputs[:, row], p, times[-1] - times[0], solver)
            raise self._stopped(f"at t = {reached:.6g} s", status, where)
        return time_response(self.block, times, y[late.given].T, states[late.given].T, u)

    def _where(self, t: float, x: Array, u: Array, p: Array, span: float, solver: Solver) -> str:
        """Return the end of the error message: the state that stops a run."""
        moves, n = between_ticks(self._plain), self._plain.n_continuous
        held = [*u.tolist(), *x[n:].tolist()]
        return where_it_stops(
            moves, t, x[:n].tolist(), held, p.tolist(), span=span, rtol=solver.rtol, atol=solver.atol
        )

    def _stopped(self, when: str, status: int, where: str) -> StoppedError:
        text = f"the simulation stops {when}: {REASONS[status]}{where}"
        return StoppedError(self.block.where(text), status, where)

    @checked
    def sweep(
        self,
        time: ArrayLike,
        *,
        params: Many | None = None,
        x0: Many | ArrayLike | None = None,
        inputs: ArrayLike | Many | None = None,
        start: float = -math.inf,
        band: float | Mapping[str, float] = 0.02,
        threads: int | None = None,
        method: Method = "dormand-prince",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        outputs: Sequence[str] | None = None,
        progress: Callable[[int], None] | None = None,
        executor: Executor | None = None,
        checkpoint: str | Path | None = None,
    ) -> SweepResult:
        """Simulate many runs over one time grid; return figures of each run, not its trajectory.

        Parameters
        ----------
        time : array_like, shape (n,)
            Increasing times [s] at which the figures are evaluated.
        params : mapping of str to array_like, optional
            Parameter values by key: one value for all runs or one for each.
        x0 : mapping of str to array_like, or array_like of shape (n_runs, n_states), optional
            Initial states: one value for all runs or one for each.
        inputs : optional
            As for :meth:`simulate`; the same in all runs. If inputs are delayed, the figures are also
            evaluated at the times at which they arrive.
        start : float, optional
            Time from which on the figures are evaluated [s].
        band : float or mapping by output, optional
            An output has settled when it stays within this distance of its final value, in its own unit.
        threads : int, optional
            Number of threads (default: one per core). The results do not depend on it.
        method, step, rtol, atol
            As for :meth:`simulate`. With rk4, eight runs are computed in parallel by vector instructions if
            gcc and glibc 2.35 on x86_64 offer them. Functions such as sine are then accurate to 4 units in
            the last place, and the results agree with those of :meth:`simulate` to rounding.
        outputs : sequence of str, optional
            Names of the outputs to compute (default: all); their figures are in the result.
        progress : callable, optional
            Called repeatedly with the number of runs done.
        executor : concurrent.futures.Executor, optional
            Executor of the sweep, such as processes or a cluster; see :mod:`.executors`.
        checkpoint : path, optional
            Folder from which the same sweep resumes; see :mod:`.executors`.

        Returns
        -------
        SweepResult
            A run that fails is marked in it; the other runs continue.

        Raises
        ------
        InputError
            If a name, a shape or a value is wrong.
        """
        if outputs is not None:
            return self._selected(tuple(outputs)).sweep(
                time, params=params, x0=x0, inputs=inputs, start=start, band=band, threads=threads,
                method=method, step=step, rtol=rtol, atol=atol, progress=progress, executor=executor,
                checkpoint=checkpoint,
            )  # fmt: skip
        if executor is not None or checkpoint is not None:
            with ThreadPoolExecutor(number_of_threads(threads)) as here:
                return sweep_on(
                    executor or here, self, time, params=params, x0=x0, checkpoint=checkpoint,
                    progress=progress, inputs=inputs, start=start, band=band, method=method, step=step,
                    rtol=rtol, atol=atol,
                )  # fmt: skip
        lanes = method == "rk4" and not self.block.ticks
        return run_sweep(
            self.block,
            lambda x: self._engine_from(x, lanes),
            checked_times(time),
            checked_solver(method, step, rtol, atol),
            params, x0, inputs, start, band, threads, progress,
        )  # fmt: skip
