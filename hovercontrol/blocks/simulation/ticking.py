"""Simulate a continuous or hybrid Block with plain floats: integrate between ticks, then execute them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.reasons import REASONS, StoppedError, where_it_stops
from hovercontrol.blocks.simulation.runge_kutta import NoProgressError, dormand_prince
from hovercontrol.blocks.ticks import ROOM, Schedule

#: Initial step size [s].
FIRST = 1e-3

#: Index into :data:`hovercontrol.blocks.simulation.reasons.REASONS`: a derivative is not a number.
STATUS_NOT_FINITE = 2


class Running:
    """The state of a Block during a simulation with plain floats.

    Parameters
    ----------
    block : Block
        Hybrid or continuous, without delays.
    time : float
        Initial time [s].
    state, inputs, params : sequence of float
        In the Block's order; ticks due at `time` are executed at once.
    rtol, atol : float, optional
        Tolerances of the integration between ticks.
    longest : float, optional
        Maximum step size [s].
    """

    def __init__(
        self,
        block: Block,
        time: float,
        state: Sequence[float],
        inputs: Sequence[float],
        params: Sequence[float],
        rtol: float = 1e-6,
        atol: float = 1e-9,
        longest: float = math.inf,
    ) -> None:
        self._block = block
        self._n, self._between = block.n_continuous, between_ticks(block)
        self._rhs = numpy_functions(self._between).scalar_pair("derivatives")
        functions = numpy_functions(block)
        places = {s.name: k for k, s in enumerate(block.states)}
        self._ticks = [
            (functions.tick_pair(k), [places[name] for name in tick.updates])
            for k, tick in enumerate(block.ticks)
        ]
        self._schedule = Schedule([tick.period for tick in block.ticks], time)
        self._step, self._allowed = FIRST, (rtol, atol, longest)
        self.time, self.state = time, list(state)
        self.inputs, self._params = list(inputs), params
        self._before: list[float] = []
        self._taken: list[tuple[float, int]] = []
        self._tick()

    def set_inputs(self, inputs: Sequence[float]) -> None:
        """Set the inputs now; ticks of this instant are executed again with them."""
        if list(inputs) != self.inputs:
            self.inputs = list(inputs)
            self.change()

    def change(
        self, states: Mapping[int, float] | None = None, params: Sequence[float] | None = None
    ) -> None:
        """Set states, by index, and parameters now; ticks of this instant are executed again.

        A state that one of these ticks sets is given as its value before the tick.
        """
        if self._taken:
            self.state = list(self._before)
        for place, value in (states or {}).items():
            self.state[place] = value
        if params is not None:
            self._params = params
        if self._taken:
            self._before = list(self.state)
            self._act()

    def save(self) -> tuple[Any, ...]:
        """Return the complete state of the simulation, for :meth:`load`."""
        lists = (tuple(values) for values in (self.state, self.inputs, self._params, self._before))
        return self.time, self._step, tuple(self._taken), self._schedule.save(), *lists

    def load(self, saved: tuple[Any, ...]) -> None:
        """Restore what :meth:`save` returned."""
        self.time, self._step, taken, due, *lists = saved
        self._taken = list(taken)
        self._schedule.load(due)
        self.state, self.inputs, self._params, self._before = map(list, lists)

    def advance(self, until: float, *, open_end: bool = False) -> None:
        """Integrate to the time `until` [s] and execute the ticks due then, unless `open_end` is true.

        Raises
        ------
        StoppedError
            If the integration cannot continue; time and states are then those of the last accepted step.
        """
        n, schedule = self._n, self._schedule
        while self.time < until:
            stop = until if schedule.time >= until - ROOM * abs(until) else schedule.time
            moved, step = self.state[:n], self._step
            if n:
                held = [*self.inputs, *self.state[n:]]
                try:
                    moved, step = dormand_prince(
                        self._rhs, self.time, moved, held, self._params, stop, step, *self._allowed
                    )
                except NoProgressError as end:
                    span = until - self.time
                    self.time, self.state[:n] = end.time, end.state
                    raise self._stopped(end.status, held, span) from None
            if not all(map(math.isfinite, self.state[n:])):
                raise self._stopped(STATUS_NOT_FINITE, [], 0.0)
            self.state[:n], self._step = moved, step
            self.time = stop
            self._taken = []
            if not (open_end and stop == until):
                self._tick()

    def _stopped(self, status: int, held: Sequence[float], span: float) -> StoppedError:
        """Return the error, with the time, the reason, and the state and switch that stop the simulation."""
        bad = [s for s, v in zip(self._block.states, self.state, strict=True) if not math.isfinite(v)]
        if bad:
            where = f": the state {bad[0].name} is not a number"
        else:
            rtol, atol, _ = self._allowed
            where = where_it_stops(
                self._between, self.time, self.state[: self._n], held, self._params,
                span=span, rtol=rtol, atol=atol,
            )  # fmt: skip
        text = f"the simulation stops at t = {self.time:.6g} s: {REASONS[status]}{where}"
        return StoppedError(self._block.where(text), status, where)

    def _tick(self) -> None:
        taken = []
        while self._schedule.is_due(self.time):
            at = self._schedule.time
            taken += [(at, k) for k in self._schedule.take(at)]
        if taken:
            self._before, self._taken = list(self.state), taken
            self._act()

    def _act(self) -> None:
        for at, k in self._taken:
            pair, places = self._ticks[k]
            values = call_scalar(pair, at, self.state, self.inputs, self._params)
            for place, value in zip(places, values, strict=True):
                self.state[place] = value


def run_hybrid(
    block: Block,
    times: Array,
    u: Array,
    x: Array,
    p: Sequence[float],
    *,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    longest: float = math.inf,
    progress: Callable[[float], None] | None = None,
) -> Array:
    """Return a hybrid Block's states at `times`, shape (n_states, n_times), after the ticks of each time.

    Parameters
    ----------
    times : ndarray, shape (n_times,)
    u : ndarray, shape (n_inputs, n_times)
        Inputs, held from each time to the next.
    x : ndarray, shape (n_states,)
        Initial state.
    p : sequence of float
        Parameter values in order.
    rtol, atol, longest
        As for :class:`Running`.
    progress : callable, optional
        Called at each time of `times` with that time [s].
    """
    grid = times.tolist()
    run = Running(block, grid[0], x.tolist(), u[:, 0].tolist(), p, rtol, atol, longest)
    states = np.empty((len(block.states), len(grid)))
    states[:, 0] = run.state
    for k, time in enumerate(grid[1:], start=1):
        run.advance(time)
        run.set_inputs(u[:, k].tolist())
        states[:, k] = run.state
        if progress is not None:
            progress(time)
    return states


@lru_cache(maxsize=64)
def between_ticks(block: Block) -> Block:
    """Return a hybrid Block's continuous part; states that ticks set become inputs, after the Block's own."""
    n = block.n_continuous
    names = [s.name for s in block.states[:n]]
    return block.unchecked(
        states=block.states[:n],
        inputs=(*block.inputs, *block.states[n:]),
        derivatives=Expressions((name, block.derivatives[name]) for name in names),
        ticks=(),
    )
