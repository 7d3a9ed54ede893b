"""A running instance of an FMU for Model Exchange: its equations at a point, and its events.

The calls of the right-hand side go to the FMU's library itself with arguments made once: FMPy's wrappers take
several times as long.
"""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hovercontrol.fmi.importer.instance import STATUS, FmuError, Instance, Values
from hovercontrol.fmi.importer.interface import Interface, Variable

Array = NDArray[np.float64]
Point = Callable[[float, Array, Array], Array]

#: Updates of the discrete states at one instant; more is an FMU whose event iteration does not end.
MOST_UPDATES = 1000
_DOUBLES = ("Real", "Float64")


class Event(NamedTuple):
    """What an FMU says after an event: when the next one is due [s], and whether it ends the run."""

    next: float
    ended: bool


class Continuous(Instance):
    """An FMU for Model Exchange in this process; arguments and errors as for :class:`Instance`.

    Attributes
    ----------
    states : ndarray
        The continuous states after :meth:`begin`.
    event : Event
        What the FMU said at its last event.
    derivatives, outputs_at, indicators : callable
        Of time [s], states and inputs; set by :meth:`begin`.
    """

    def __init__(self, folder: Path, interface: Interface, name: str) -> None:
        super().__init__(folder, interface, name)
        self._n = sum(len(v.labels) for v in interface.states)
        self._discrete = any(v.discrete for v in interface.inputs)
        self.states = np.zeros(self._n)
        self.event = Event(math.inf, False)

    def begin(self, time: float, parameters: Sequence[float | None], inputs: Sequence[float]) -> None:
        """Begin with these parameters (None: the FMU's value) and inputs, in Continuous-Time Mode."""
        self.start(time, parameters, inputs)
        with self._faults():
            self._bind()
            self._update()
        self._time, self._x, self._u = time, b"", np.array(inputs, dtype=float).tobytes()

    def at_event(self, time: float, x: Array, u: Array) -> None:
        """Pass an event at this point; the states may change."""
        self._set(time, x, self._u_now(u))
        with self._faults():
            self._fmu.enterEventMode()
            self._set_inputs(u)
            self._update()

    def completed_step(self) -> tuple[bool, bool]:
        """Tell the FMU that a step of the integration is complete: (an event follows, the run ends)."""
        with self._faults():
            found: tuple[bool, bool] = self._fmu.completedIntegratorStep()
            return found

    def partials(self, time: float, x: Array, u: Array) -> list[Array] | None:
        """Return the matrices A, B, C and D by directional derivatives, or None if it does not give them."""
        interface = self._interface
        inputs = interface.inputs
        if not interface.directional or any(v.kind not in _DOUBLES for v in (*inputs, *interface.outputs)):
            return None
        self._set(time, x, u)
        states = {v.reference: k for v, k in zip(interface.states, _starts(interface.states), strict=True)}
        computed = [v for v in interface.outputs if v.reference not in states]
        unknowns = [*interface.derivatives, *computed]
        with self._faults():
            table = np.hstack([self._columns(unknowns, known) for known in (interface.states, inputs)])
        a, rest = table[: self._n], table[self._n :]
        places = dict(zip((v.reference for v in computed), _starts(computed), strict=True))
        rows = [np.zeros((0, table.shape[1]))]
        for v in interface.outputs:
            size = len(v.labels)
            if v.reference in states:
                rows.append(np.eye(size, table.shape[1], states[v.reference]))
            else:
                rows.append(rest[places[v.reference] : places[v.reference] + size])
        c, n = np.vstack(rows), self._n
        return [a[:, :n], a[:, n:], c[:, :n], c[:, n:]]

    def _columns(self, unknowns: Sequence[Variable], knowns: Sequence[Variable]) -> Array:
        rows, columns = (sum(len(v.labels) for v in group) for group in (unknowns, knowns))
        of, by = [v.reference for v in unknowns], [v.reference for v in knowns]
        table = np.zeros((rows, columns))
        for k, seed in enumerate(np.eye(columns)):
            more = (rows,) if self._interface.fmi == 3 else ()
            table[:, k] = self._fmu.getDirectionalDerivative(of, by, seed.tolist(), *more)
        return table

    def _update(self) -> None:
        """In Event Mode: update the discrete states, and go on to Continuous-Time Mode."""
        fmu, two = self._fmu, self._interface.fmi == 2
        for _ in range(MOST_UPDATES):
            again, ended, _, _, has_next, following = (
                fmu.newDiscreteStates() if two else fmu.updateDiscreteStates()
            )
            if ended or not again:
                break
        else:
            raise FmuError(f"its event iteration did not end after {MOST_UPDATES} updates{self._words()}")
        self.event = Event(following if has_next else math.inf, bool(ended))
        if ended:
            return
        fmu.enterContinuousTimeMode()
        self._x = b""
        buffer = (ctypes.c_double * self._n)()
        if self._n:
            fmu.getContinuousStates(buffer, self._n)
        self.states = np.array(buffer, dtype=float)

    def _bind(self) -> None:
        """Prepare the calls of the right-hand side for this instance."""
        fmu, interface, two = self._fmu, self._interface, self._interface.fmi == 2
        # Without giving up Python's lock at each call: a right-hand side takes less time than that.
        library = ctypes.PyDLL(fmu.dll._name, handle=fmu.dll._handle)
        self._component = ctypes.c_void_p(fmu.component)
        prefix = f"fmi{interface.fmi}"
        self._clock, self._size = ctypes.c_double(), ctypes.c_size_t(self._n)
        self._call_time = library[f"{prefix}SetTime"]
        self._call_states = library[f"{prefix}SetContinuousStates"]
        self._plain = not self._discrete and all(v.kind in _DOUBLES for v in interface.inputs)
        self._call_inputs = library["fmi2SetReal" if two else "fmi3SetFloat64"]
        self._input_arguments = _references(interface.inputs, two)
        rates = library["fmi2GetDerivatives" if two else "fmi3GetContinuousStateDerivatives"]
        self.derivatives = self._reader(rates, (), self._n, self._size)
        indicators = library[f"{prefix}GetEventIndicators"]
        count = ctypes.c_size_t(interface.indicators)
        self.indicators = self._reader(indicators, (), interface.indicators, count)
        self.outputs_at: Point = self._outputs_slowly
        if all(v.kind in _DOUBLES for v in interface.outputs):
            first, last = _references(interface.outputs, two)
            get = library["fmi2GetReal" if two else "fmi3GetFloat64"]
            self.outputs_at = self._reader(get, first, self._outputs.size, *last)

    def _reader(self, call: Any, before: tuple[Any, ...], n: int, *after: Any) -> Point:
        """Return a function of a point that sets it and reads n numbers by one call."""
        buffer = (ctypes.c_double * n)()
        values: Array = np.ctypeslib.as_array(buffer)
        arguments = (self._component, *before, buffer, *after)
        put, name, put_states = self._set, call.__name__, self._call_states
        component, size, copy = self._component, self._size, values.copy

        def read(time: float, x: Array, u: Array) -> Array:
            if time == self._time and u.tobytes() == self._u:  # states alone have changed
                key = x.tobytes()
                if key != self._x:
                    self._x = key
                    if (status := put_states(component, key, size)) > 1:
                        self._refused(status, "SetContinuousStates")
            else:
                put(time, x, u)
            if n and (status := call(*arguments)) > 1:
                self._refused(status, name)
            return copy()

        return read

    def _outputs_slowly(self, time: float, x: Array, u: Array) -> Array:
        self._set(time, x, u)
        with self._faults():
            return np.array(self._read())

    def _set(self, time: float, x: Array, u: Array) -> None:
        """Set a point; what has not changed is not set again."""
        if time != self._time:
            self._clock.value = self._time = time
            if (status := self._call_time(self._component, self._clock)) > 1:
                self._refused(status, "SetTime")
            self._x = b""
        key = x.tobytes()
        if key != self._x:
            self._x = key
            if self._n and (status := self._call_states(self._component, key, self._size)) > 1:
                self._refused(status, "SetContinuousStates")
        key = u.tobytes()
        if key != self._u:
            self._u = key
            if self._plain:
                first, last = self._input_arguments
                if (status := self._call_inputs(self._component, *first, key, *last)) > 1:
                    self._refused(status, "Set inputs")
            else:
                self._jump(u)

    def _jump(self, u: Array) -> None:
        """Set inputs that change at events only."""
        with self._faults():
            self._fmu.enterEventMode()
            self._set_inputs(u)
            self._update()

    def _set_inputs(self, u: Array) -> None:
        self._inputs.set(self._fmu, u.tolist())
        self._u = u.tobytes()

    def _u_now(self, u: Array) -> Array:
        """Return the inputs before an event: those that change at events only are set in it."""
        return u if self._plain else np.frombuffer(self._u)

    def _refused(self, status: int, name: str) -> None:
        self._x = self._u = b""
        self._time = math.nan
        self._fatal = status == STATUS.index("Fatal")
        label = STATUS[status] if status in range(len(STATUS)) else status
        raise FmuError(f"{name} returned fmi{self._interface.fmi}{label}{self._words()}")


def _starts(variables: Sequence[Variable]) -> list[int]:
    """Return the place of each variable's first element among all elements."""
    return [0, *itertools.accumulate(len(v.labels) for v in variables)][: len(variables)]


def _references(variables: Sequence[Variable], two: bool) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the arguments before and after the values of a call that sets or gets variables."""
    references = (ctypes.c_uint32 * len(variables))(*(v.reference for v in variables))
    count = ctypes.c_size_t(len(variables))
    size = ctypes.c_size_t(Values(variables).size)
    return (references, count), (() if two else (size,))
