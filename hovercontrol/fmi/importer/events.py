"""Simulation of an FMU for Model Exchange: SciPy's solvers between the FMU's events.

An event is due where an event indicator changes its sign (state event), at the time that the FMU named at
the event before (time event), where it asks for one after a step (step event), and where an input that
changes at events only is set (FMI 3.0 section 3.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.integrate
from numpy.typing import NDArray
from scipy.optimize import brentq

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.simulation.arguments import checked_times
from hovercontrol.fmi.importer.continuous import Continuous

if TYPE_CHECKING:
    from hovercontrol.blocks.simulation.response import Response
    from hovercontrol.fmi.importer.model import FmuModel


METHODS = ("DOP853", "RK45", "Radau", "BDF", "LSODA")
#: Most events without progress in time.
MOST_EVENTS = 1000
#: How far past its root, over the time, a state event is taken: FMUs ask for a sign that has changed.
PAST = 1e-13

#: Times that differ by less than this part of themselves are one instant.
ROUNDING = 1e-12


def simulated(
    system: FmuModel,
    engine: Continuous,
    values: tuple[float | None, ...],
    given: tuple[Any, Any, Any],
    options: tuple[str, float, float],
) -> Response:
    """Return the simulation of :meth:`FmuModel.simulate`."""
    times = checked_times(given[0])
    check_known(options[0], METHODS, f"unknown method {options[0]!r}")
    rows = _rows(system, given[1], times)
    run = _Run(system, engine, times, rows, options)
    engine.begin(float(times[0]), values, rows[:, 0].tolist(), ticks=given[2] is None)
    x = engine.states
    if given[2] is not None:
        x = np.broadcast_to(np.asarray(given[2], dtype=float), (system.nstates,)).copy()
        engine.at_event(float(times[0]), x, rows[:, 0])  # discrete states that fit
        x = engine.states
    run.all(x)
    return _response(system, times, run, rows)


class _Run:
    """One simulation, from event to event."""

    def __init__(
        self,
        system: FmuModel,
        engine: Continuous,
        times: Array,
        rows: Array,
        options: tuple[str, float, float],
    ) -> None:
        self._system, self._engine, self._times, self._rows = system, engine, times, rows
        self._method, self._rtol, self._atol = options
        self.states = np.zeros((system.nstates, len(times)))
        self.outputs = np.zeros((system.noutputs, len(times)))
        labels = [(label, v) for v in system.interface.inputs for label in v.labels]
        self._held = np.array([v.discrete for _, v in labels], dtype=bool)
        self._next = 0  # the sample that is recorded next

    def inputs(self, t: float) -> Array:
        """Return the inputs at a time: interpolated, or held."""
        times, rows = self._times, self._rows
        k = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), len(times) - 2)
        part = (t - times[k]) / (times[k + 1] - times[k])
        u: Array = rows[:, k] + min(part, 1.0) * (rows[:, k + 1] - rows[:, k])
        u[self._held] = rows[self._held, k if part < 1.0 else k + 1]
        return u

    def all(self, x: Array) -> None:
        t, end, stuck = float(self._times[0]), float(self._times[-1]), 0
        kinks = self._kinks()
        self._record(t, lambda _: x)
        while t < end and not self._engine.event.ended:
            ahead = kinks[kinks > t]
            bound = min(end, self._next_event(), float(ahead[0]) if len(ahead) else end)
            before = t
            if bound > t:
                t, x, event = self._until(t, x, bound)
            else:
                event = True
            due = t >= self._next_event() or (self._held.any() and t in kinks)
            if event or due:
                self._engine.at_event(t, x, self.inputs(t))
                x = self._engine.states
            stuck = stuck + 1 if t == before else 0
            if stuck > MOST_EVENTS:
                raise InputError(
                    f"FMU {self._system.name!r}: more than {MOST_EVENTS} events at t = {t:.9g} s"
                )
        for k in range(self._next, len(self._times)):  # the FMU ended the run
            self.states[:, k], self.outputs[:, k] = self.states[:, k - 1], self.outputs[:, k - 1]

    def _next_event(self) -> float:
        """Return the next time event; at the sample that follows it if only rounding is in between."""
        at = self._engine.event.next
        k = int(np.searchsorted(self._times, at))
        near = k < len(self._times) and self._times[k] - at <= ROUNDING * max(1.0, abs(at))
        return float(self._times[k]) if near else at

    def _kinks(self) -> Array:
        """Return the samples at which an input bends, or jumps if it is held: solvers restart there."""
        slopes = np.diff(self._rows, axis=1) / np.diff(self._times)
        bends = (np.diff(slopes, axis=1) != 0.0).any(axis=0)
        return self._times[1:-1][bends]

    def _until(self, t: float, x: Array, bound: float) -> tuple[float, Array, bool]:
        """Integrate up to a time or an event; return where that is, and whether an event is due."""
        if not len(x):
            self._record(bound, lambda _: x)
            return bound, x, False
        engine = self._engine
        solver = getattr(scipy.integrate, self._method)(
            lambda s, y: engine.derivatives(s, y, self.inputs(s)),
            t,
            x,
            bound,
            rtol=self._rtol,
            atol=self._atol,
        )
        z = engine.indicators(t, x, self.inputs(t))
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise InputError(
                    f"FMU {self._system.name!r}: the solver stopped at t = {solver.t:.9g} s: {message}"
                )
            inside, reached = solver.dense_output(), float(solver.t)
            after = engine.indicators(reached, solver.y, self.inputs(reached))
            crossed = np.flatnonzero((z > 0.0) != (after > 0.0))
            if len(crossed):
                at = self._first_root(inside, float(solver.t_old), reached, crossed, z)
                self._record(at, inside)
                return at, np.array(inside(at)), True
            self._record(reached, inside)
            z = after
            engine.derivatives(reached, solver.y, self.inputs(reached))
            event, ended = engine.completed_step()
            if event or ended:
                return reached, solver.y.copy(), True
        return float(solver.t), solver.y.copy(), False

    def _first_root(
        self, inside: Callable[[float], Array], low: float, high: float, crossed: NDArray[np.int64], z: Array
    ) -> float:
        """Return the first time just past the change of an indicator's sign."""
        first = high
        for i in crossed:

            def value(s: float, i: int = int(i)) -> float:
                return float(self._engine.indicators(s, np.array(inside(s)), self.inputs(s))[i])

            positive = z[i] > 0.0
            if (value(low) > 0.0) != positive or (value(first) > 0.0) == positive:
                continue
            root, nudge = (
                float(brentq(value, low, first, xtol=1e-15, rtol=1e-14)),
                PAST * max(1.0, abs(first)),
            )
            while root < first and (value(root) > 0.0) == positive:
                root, nudge = min(root + nudge, first), 2.0 * nudge
            first = root
        return first

    def _record(self, reached: float, inside: Callable[[float], Array]) -> None:
        """Keep the samples up to a time."""
        while self._next < len(self._times) and self._times[self._next] <= reached:
            t = float(self._times[self._next])
            x = np.array(inside(t), dtype=float)
            u = self.inputs(t) if not self._held.any() else self.inputs(np.nextafter(t, -np.inf))
            self.states[:, self._next] = x
            self.outputs[:, self._next] = self._engine.outputs_at(t, x, u)
            self._next += 1


def _rows(system: FmuModel, inputs: Any, times: Array) -> Array:
    """Return all inputs at the times, shape (n_inputs, n)."""
    names = list(system.input_index)
    rows = np.repeat(system._first_inputs[:, None], len(times), axis=1)
    if inputs is None:
        return rows
    if isinstance(inputs, Mapping):
        for name, row in inputs.items():
            check_known(name, names, f"FMU {system.name!r}: unknown input {name!r}")
            rows[names.index(name)] = row
    else:
        given = np.asarray(inputs, dtype=float)
        rows[:] = given if given.ndim == 2 else given.reshape(len(names), -1) if given.ndim else given
    for t, u in zip(times, rows.T, strict=True):
        system._input_check.checked(f"FMU {system.name!r}", float(t), u)
    return rows


def _response(system: FmuModel, times: Array, run: _Run, rows: Array) -> Response:
    from hovercontrol.blocks.simulation.response import Response

    response = Response(
        times,
        run.outputs,
        run.states,
        rows,
        issiso=system.noutputs == 1 and system.ninputs == 1,
        output_labels=list(system.output_index),
        state_labels=list(system.state_index),
        input_labels=list(system.input_index),
        sysname=system.name,
        title=system.name,
        plot_inputs=bool(system.ninputs),
    )
    response.units = dict(system.units)
    response.held = False
    return response
