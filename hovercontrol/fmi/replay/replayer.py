"""An FMU run over the rows of a log, in this process: C loops over its calls where they can be built.

Inputs are held from row to row. Model Exchange is integrated by Runge-Kutta steps of equal length between two
rows; events are located within a step by bisection (:mod:`hovercontrol.fmi.importer.events` takes SciPy's
solvers instead: for a fit the computed path must depend smoothly on the parameters).
"""

from __future__ import annotations

import base64
import ctypes
import math
import pickle
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.compiler import NoCompilerError, load_library
from hovercontrol.fmi.importer.continuous import Continuous
from hovercontrol.fmi.importer.instance import STATUS, FmuError, Instance, RunEnded
from hovercontrol.fmi.importer.interface import Interface
from hovercontrol.fmi.importer.point import all_doubles, references
from hovercontrol.fmi.importer.ticking import instance_of
from hovercontrol.fmi.replay.added import Added

#: Most events in one step between two rows.
MOST_EVENTS = 1000
#: Halvings that locate an event within a step.
HALVINGS = 52
#: Calls of replay.c, by their number.
_CALLS = (
    "", "SetTime", "SetContinuousStates", "Set inputs", "GetContinuousStateDerivatives", "Get outputs",
    "GetEventIndicators", "CompletedIntegratorStep", "DoStep",
)  # fmt: skip
_DONE, _EVENT, _REFUSED, _ENDED = range(4)
#: Sizes that replay.c holds.
_MOST = 512


class _Job(ctypes.Structure):
    """hc_replay of replay.c."""

    _fields_ = (
        ("component", ctypes.c_void_p),
        *((name, ctypes.c_long) for name in ("fmi", "states", "inputs", "outputs", "indicators")),
        *((name, ctypes.c_void_p) for name in ("set_time", "set_states", "rates", "indicate")),
        *((name, ctypes.c_void_p) for name in ("set2", "get2", "set3", "get3")),
        *((name, ctypes.c_void_p) for name in ("complete2", "complete3", "step2", "step3")),
        *((name, ctypes.c_void_p) for name in ("input_references", "output_references")),
        *((name, ctypes.c_size_t) for name in ("input_count", "output_count")),
        *((name, ctypes.c_long) for name in ("rows", "pieces")),
        *((name, ctypes.c_double) for name in ("fixed", "next")),
        *((name, ctypes.c_void_p) for name in ("time", "u", "x", "y", "state")),
        *((name, ctypes.c_long) for name in ("row", "piece", "status", "what")),
        ("reached", ctypes.c_double),
    )


class Replayer:
    """An FMU in this process that is run over logs; arguments as for :class:`Instance`.

    Its methods take and return what JSON holds; arrays are base64 of their doubles.
    """

    def __init__(self, folder: Path, interface: Interface, name: str) -> None:
        self._interface = interface
        self._exchange = interface.kind == "ModelExchange"
        self._engine: Instance = (Continuous if self._exchange else instance_of)(folder, interface, name)
        self._times: dict[str, Array] = {}
        self._n = sum(len(v.labels) for v in interface.states)
        self._inputs = sum(len(v.labels) for v in interface.inputs)
        self._outputs = sum(len(v.labels) for v in interface.outputs)
        self._plain = all_doubles((*interface.inputs, *interface.outputs))
        self._plain = self._plain and not any(v.discrete for v in interface.inputs) and not interface.clocks
        self._plain = self._plain and max(self._n, interface.indicators) <= _MOST
        self._library = self._built() if self._plain else None

    def log(self, key: str, time: str) -> None:
        """Keep the times of a log [s]."""
        self._times[key] = array_of(time)

    def initial(self, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Return the continuous states after initialisation."""
        if not isinstance(self._engine, Continuous):
            self._engine.start(0.0, parameters, inputs)
            return []
        self._engine.begin(0.0, parameters, inputs)
        return [float(x) for x in self._engine.states]

    def run(
        self,
        key: str,
        inputs: str,
        parameters: Sequence[float | None],
        states: Sequence[float] | None,
        pieces: int,
        added: str = "",
        numbers: Sequence[Sequence[float]] = (),
    ) -> str:
        """Return outputs and states at all rows of a log, base64 of shape (rows, outputs + states).

        Parameters
        ----------
        key : str
            Of :meth:`log`.
        inputs : str
            Base64 of shape (rows, inputs), held from row to row.
        parameters : sequence of float or None
            None: the FMU's own value.
        states : sequence of float, optional
            At the first row; by default the FMU's.
        pieces : int
            Steps from row to row.
        added : str, optional
            Base64 of a pickled :class:`.added.Added`.
        numbers : sequence of sequence of float, optional
            Values of the parameters of each of its Blocks.
        """
        time = self._times[key]
        u = np.ascontiguousarray(array_of(inputs).reshape(len(time), self._inputs))
        x, y = np.zeros((len(time), self._n)), np.zeros((len(time), self._outputs))
        engine = self._engine
        if isinstance(engine, Continuous):
            engine.begin(float(time[0]), parameters, u[0].tolist(), ticks=states is None)
            if states is not None:
                engine.at_event(float(time[0]), np.array(states, dtype=float), u[0])
            rates = _rates(engine, _law(added), numbers) if added else engine.derivatives
            _Exchange(engine, self, time, (u, x, y), pieces, rates).all()
        else:
            engine.start(float(time[0]), parameters, u[0].tolist())
            self._steps(engine, time, u, y, pieces)
        return text_of(np.hstack([y, x]))

    def close(self) -> None:
        """Free the instance."""
        self._engine.close()

    def _steps(self, engine: Instance, time: Array, u: Array, y: Array, pieces: int) -> None:
        """Run the steps of Co-Simulation."""
        if self._library is not None:
            job = self.job(time, u, np.zeros((len(time), 0)), y, np.zeros(0), pieces)
            engine._log.clear()
            found = self._library.hc_replay_steps(ctypes.byref(job))
            if found == _REFUSED:
                self.refuse(job)
            if found == _ENDED:
                y[job.row + 1 :] = y[job.row]
            return
        for k, t in enumerate(time.tolist()):
            y[k] = engine.outputs(u[k].tolist())
            length = float(time[k + 1]) - t if k + 1 < len(time) else 0.0
            fixed = self._interface.fixed_step
            count = math.floor(length / fixed + 0.5) if fixed else pieces if length else 0
            h = length / max(count, 1)
            for i in range(count):
                try:
                    engine.step(t + i * h, h, u[k].tolist())
                except RunEnded:
                    y[k + 1 :] = y[k]
                    return

    def _built(self) -> Any:
        source = (resources.files("hovercontrol") / "fmi" / "replay" / "replay.c").read_text("utf-8")
        try:
            library = load_library("fmu_replay", {"replay.c": source})
        except NoCompilerError:
            return None
        return library

    @property
    def library(self) -> Any:
        """The loops in C, or None."""
        return self._library

    def job(self, time: Array, u: Array, x: Array, y: Array, state: Array, pieces: int) -> _Job:
        """Return the arguments of a run in C; the arrays must outlive it."""
        interface, fmu = self._interface, self._engine._fmu
        two = interface.fmi == 2
        prefix = f"fmi{interface.fmi}"

        def call(name: str) -> int | None:
            return ctypes.cast(getattr(fmu.dll, prefix + name), ctypes.c_void_p).value

        self._kept = references(interface.inputs, two)[0], references(interface.outputs, two)[0]
        (into, n_in), (out, n_out) = self._kept
        job = _Job(
            fmi=interface.fmi,
            states=self._n,
            inputs=self._inputs,
            outputs=self._outputs,
            indicators=interface.indicators,
            input_references=ctypes.addressof(into),
            output_references=ctypes.addressof(out),
            input_count=n_in.value,
            output_count=n_out.value,
            rows=len(time),
            pieces=pieces,
            fixed=interface.fixed_step or 0.0,
            next=math.inf,
            time=time.ctypes.data,
            u=u.ctypes.data,
            x=x.ctypes.data,
            y=y.ctypes.data,
            state=state.ctypes.data,
        )
        component = fmu.component
        job.component = getattr(component, "value", component)
        get, put = ("GetReal", "SetReal") if two else ("GetFloat64", "SetFloat64")
        setattr(job, f"get{interface.fmi}", call(get))
        setattr(job, f"set{interface.fmi}", call(put))
        if self._exchange:
            job.set_time, job.set_states = call("SetTime"), call("SetContinuousStates")
            job.rates = call("GetDerivatives" if two else "GetContinuousStateDerivatives")
            job.indicate = call("GetEventIndicators") if interface.indicators else None
            setattr(job, f"complete{interface.fmi}", call("CompletedIntegratorStep"))
        else:
            setattr(job, f"step{interface.fmi}", call("DoStep"))
        return job

    def refuse(self, job: _Job) -> None:
        """Raise for a call that the FMU refused."""
        self._engine._fatal = job.status == STATUS.index("Fatal")
        label = STATUS[job.status] if job.status in range(len(STATUS)) else job.status
        name = _CALLS[job.what]
        words = self._engine._words()
        at = f" at t = {job.reached:.9g} s"
        raise FmuError(f"{name} returned fmi{self._interface.fmi}{label}{at}{words}")


class _Exchange:
    """One run of an FMU for Model Exchange over the rows."""

    def __init__(
        self,
        engine: Continuous,
        replayer: Replayer,
        time: Array,
        arrays: tuple[Array, Array, Array],
        pieces: int,
        rates: Callable[[float, Array, Array], Array],
    ) -> None:
        self._engine, self._replayer, self._time = engine, replayer, time
        (self._u, self._x, self._y), self._pieces, self._rates = arrays, pieces, rates
        self._held = replayer.library is None and not replayer._plain
        self._ticks = bool(replayer._interface.clocks)

    def all(self) -> None:
        state = np.ascontiguousarray(self._engine.states, dtype=float)
        library = self._replayer.library
        if library is None or self._rates is not self._engine.derivatives:
            self._slowly(state)
            return
        job = self._replayer.job(self._time, self._u, self._x, self._y, state, self._pieces)
        while True:
            job.next = self._engine.event.next
            if self._engine.event.ended:
                self._hold(job.row)
                return
            self._engine._log.clear()
            found = library.hc_replay_continuous(ctypes.byref(job))
            self._engine.forget()
            if found == _DONE:
                return
            if found == _REFUSED:
                self._replayer.refuse(job)
            if found == _ENDED:
                self._hold(job.row)
                return
            row, done = int(job.row), job.piece == self._pieces
            if done:  # the event follows a completed step
                self._event(float(job.reached), state, row)
                continue
            h = (self._time[row + 1] - self._time[row]) / self._pieces
            t = self._time[row] + job.piece * h
            state[:] = self._step(float(t), state.copy(), float(h), row)
            job.piece += 1

    def _slowly(self, state: Array) -> None:
        """Run in Python, where there is no compiler, inputs are not all real, or a law is added."""
        engine, time = self._engine, self._time
        for k, t in enumerate(time.tolist()):
            changed = self._held and k and (self._u[k] != self._u[k - 1]).any()
            if changed or (self._ticks and engine.event.next <= t + _rounding(t)):
                engine.at_event(t, state, self._u[k])
                state[:] = engine.states
            self._y[k] = engine.outputs_at(t, state, self._u[k])
            self._x[k] = state
            if engine.event.ended:
                self._hold(k)
                return
            if k + 1 == len(time):
                return
            h = (float(time[k + 1]) - t) / self._pieces
            for i in range(self._pieces):
                state[:] = self._step(t + i * h, state.copy(), h, k)

    def _hold(self, row: int) -> None:
        """Keep the values at the end of a run that the FMU ended."""
        self._y[row + 1 :], self._x[row + 1 :] = self._y[row], self._x[row]

    def _event(self, t: float, state: Array, row: int) -> None:
        self._engine.at_event(t, state.copy(), self._u[row])
        state[:] = self._engine.states

    def _runge_kutta(self, t: float, x: Array, h: float, u: Array) -> Array:
        """Return x(t + h); the same sums as in replay.c."""
        f = self._rates
        k1 = f(t, x, u)
        k2 = f(t + 0.5 * h, x + 0.5 * h * k1, u)
        k3 = f(t + 0.5 * h, x + 0.5 * h * k2, u)
        k4 = f(t + h, x + h * k3, u)
        return np.asarray(x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))

    def _step(self, begin: float, x: Array, length: float, row: int) -> Array:
        """Return the states after one step, passing the events in it."""
        engine, u, t, end = self._engine, self._u[row], begin, begin + length
        for _ in range(MOST_EVENTS):
            h = min(end, engine.event.next) - t
            if h > 0.0:
                z = engine.indicators(t, x, u) > 0.0
                new = self._runge_kutta(t, x, h, u)
                crossed = ((engine.indicators(t + h, new, u) > 0.0) != z).any()
                if crossed:
                    h = self._first(t, x, h, u, z)
                    new = self._runge_kutta(t, x, h, u)
                x, t = new, t + h
                engine.derivatives(t, x, u)
                asked, ended = engine.completed_step()
                if ended:
                    return x
                event = crossed or asked
            else:
                event = True
            over = t >= end - _rounding(end)
            late = over and self._ticks  # a tick at the end is done with the inputs of the next row
            if event or (t >= engine.event.next and not late):
                engine.at_event(t, x, u)
                x = engine.states.copy()
                if engine.event.ended:
                    return x
            if over and (late or engine.event.next > t):
                return x
        raise FmuError(f"more than {MOST_EVENTS} events at t = {t:.9g} s")

    def _first(self, t: float, x: Array, h: float, u: Array, z: NDArray[np.bool_]) -> float:
        """Return the first length of a step just past a change of an indicator's sign."""
        low, high = 0.0, h
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            new = self._runge_kutta(t, x, middle, u)
            if ((self._engine.indicators(t + middle, new, u) > 0.0) != z).any():
                high = middle
            else:
                low = middle
        return high


def _rounding(t: float) -> float:
    """Return what rounding may add to a time."""
    return 1e-12 * max(1.0, abs(t))


@lru_cache(maxsize=16)
def _law(text: str) -> Added:
    found: Added = pickle.loads(base64.b64decode(text))  # made by this package, in the parent
    return found


def _rates(
    engine: Continuous, added: Added, numbers: Sequence[Sequence[float]]
) -> Callable[[float, Array, Array], Array]:
    """Return the FMU's derivatives with laws added."""
    return lambda t, x, u: added.to(engine.derivatives(t, x, u), t, x, u, numbers)


def text_of(values: Array) -> str:
    """Return doubles as base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()


def array_of(text: str) -> Array:
    """Return doubles from base64."""
    return np.frombuffer(base64.b64decode(text), dtype="<f8").astype(float)
