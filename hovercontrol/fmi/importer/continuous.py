"""A running instance of an FMU for Model Exchange: its equations at a point, and its events."""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.fmi.importer.access import Some
from hovercontrol.fmi.importer.instance import MOST_UPDATES, STATUS, FmuError, Instance
from hovercontrol.fmi.importer.interface import Interface, Variable
from hovercontrol.fmi.importer.point import Read, all_doubles, point_of


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
        self.states = np.zeros(self._n)
        self.event = Event(math.inf, False)
        self._unclocked = Some(interface.outputs, [v for v in interface.outputs if not v.clocks])
        self._held = [s for v in interface.outputs for s in (v.start or (0.0,) * len(v.labels))]
        self._counts = [0] * len(interface.clocks)
        self._first = 0.0

    def begin(
        self,
        time: float,
        parameters: Sequence[float | None],
        inputs: Sequence[float],
        ticks: bool = True,
    ) -> None:
        """Begin with these parameters (None: the FMU's value) and inputs, in Continuous-Time Mode.

        With `ticks` false, clocks that are due at this time tick at the next event.
        """
        self._first, self._counts = time, [0] * len(self._counts)
        self.start(time, parameters, inputs)
        with self._faults():
            self._bind()
            if ticks:
                self._tick(time, inputs)
            self._update()
        self._point.begin(time, np.array(inputs, dtype=float))

    def at_event(self, time: float, x: Array, u: Array) -> None:
        """Pass an event at this point; the states may change."""
        self._point.set(time, x, self._point.inputs_now(u))
        with self._faults():
            self._fmu.enterEventMode()
            self._set_inputs(u)
            self._tick(time, u.tolist())
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
        if not interface.directional or interface.clocks or not all_doubles((*inputs, *interface.outputs)):
            return None
        self._point.set(time, x, u)
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
        clocks = zip(self._interface.clocks, self._counts, strict=True)
        ticks = (clock.time(self._first, k) for clock, k in clocks)
        self.event = Event(min([*ticks, following if has_next else math.inf]), bool(ended))
        if ended:
            return
        fmu.enterContinuousTimeMode()
        self._point.forget_states()
        buffer = (ctypes.c_double * self._n)()
        if self._n:
            fmu.getContinuousStates(buffer, self._n)
        self.states = np.array(buffer, dtype=float)

    def forget(self) -> None:
        """Set time, states and inputs at the next point, since other calls have set others."""
        self._point.forget()

    def _bind(self) -> None:
        """Prepare the calls of the right-hand side for this instance."""
        self._point = point_of(self._fmu, self._interface, self._refused, self._jump)
        self.derivatives, self.indicators = self._point.rates, self._point.indicators
        self.outputs_at: Read = self._point.outputs or self._outputs_slowly

    def _outputs_slowly(self, time: float, x: Array, u: Array) -> Array:
        self._point.set(time, x, u)
        with self._faults():
            return np.array(self._read())

    def _jump(self, u: Array) -> None:
        """Set inputs that change at events only."""
        with self._faults():
            self._fmu.enterEventMode()
            self._set_inputs(u)
            self._update()

    def _tick(self, time: float, inputs: Sequence[float]) -> None:
        """In Event Mode: the clocks that are due tick; clocked outputs are held until the next tick."""
        clocks = self._interface.clocks
        due = [n for n, clock in enumerate(clocks) if clock.due(self._first, self._counts[n], time)]
        if not due:
            return
        references = [clocks[n].reference for n in due]
        self._fmu.setClock(references, [True] * len(due))
        for n in due:
            self._counts[n] += 1
        groups = self._interface.inputs, self._interface.outputs
        clocked = [[v for v in group if set(v.clocks) & set(references)] for group in groups]
        Some(groups[0], clocked[0]).set(self._fmu, inputs)
        Some(groups[1], clocked[1]).get(self._fmu, 3, self._held)

    def _set_inputs(self, u: Array) -> None:
        self._inputs.set(self._fmu, u.tolist())
        self._point.has_inputs(u)

    def _read(self) -> list[float]:
        self._unclocked.get(self._fmu, self._interface.fmi, self._held)
        return list(self._held)

    def _refused(self, status: int, name: str) -> NoReturn:
        self.forget()
        self._fatal = status == STATUS.index("Fatal")
        label = STATUS[status] if status in range(len(STATUS)) else status
        raise FmuError(f"{name} returned fmi{self._interface.fmi}{label}{self._words()}")


def _starts(variables: Sequence[Variable]) -> list[int]:
    """Return the place of each variable's first element among all elements."""
    return [0, *itertools.accumulate(len(v.labels) for v in variables)][: len(variables)]
