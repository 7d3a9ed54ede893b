"""An FMU for Co-Simulation whose clocks tick, by FMI 3.0 with event mode (chapters Clocks and Event Mode).

A tick at time t enters Event Mode, activates the clocks, sets the inputs, reads the clocked outputs and
updates the discrete states; clocked outputs are held until the next tick. Steps end at ticks.

The tick at the instant reached is done with the inputs of the step before. If outputs are asked for with
other inputs, or the next step has others, the state before the tick is restored and the tick is repeated.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fmpy.fmi1 import FMICallException  # type: ignore[import-untyped]

from hovercontrol.fmi.importer.access import Some
from hovercontrol.fmi.importer.clocks import Clock
from hovercontrol.fmi.importer.instance import MOST_UPDATES, FmuError, Instance
from hovercontrol.fmi.importer.interface import Interface


def instance_of(folder: Path, interface: Interface, name: str) -> Instance:
    """Return an FMU for Co-Simulation in this process; its clocks tick if it has any."""
    return (Ticking if interface.clocks else Instance)(folder, interface, name)


class _Now(NamedTuple):
    """What is known at an instant, before its tick: ticks so far, outputs, discrete inputs, next event."""

    counts: tuple[int, ...]
    outputs: tuple[float, ...]
    discrete: tuple[float, ...] | None
    next: float
    due: tuple[Clock, ...]


class Ticking(Instance):
    """An FMU with clocks in this process; arguments and errors as for :class:`Instance`."""

    def __init__(self, folder: Path, interface: Interface, name: str) -> None:
        self._before: Any = None  # the FMU's state before the tick at the present instant
        self._owned = False  # whether that state is freed here
        self._ticked: list[float] | None = None  # the inputs of the tick at the present instant
        self._known: dict[int, _Now] = {}
        super().__init__(folder, interface, name)
        inputs, outputs = interface.inputs, interface.outputs
        free = [v for v in inputs if not v.clocks and not v.discrete]
        discrete = [v for v in inputs if not v.clocks and v.discrete]
        self._continuous, self._discrete = Some(inputs, free), Some(inputs, discrete)
        self._unclocked = Some(outputs, [v for v in outputs if not v.clocks])
        self._options = {"eventModeUsed": True}

    def start(self, time: float, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Begin a run; clocks without a shift tick at its start."""
        with self._faults():
            self._fresh()
            self._set_parameters(parameters)
            self._fmu.enterInitializationMode(tolerance=self._interface.tolerance, startTime=time)
            self._inputs.set(self._fmu, inputs)
            self._fmu.exitInitializationMode()
            self._initialised, self._start = True, time
            starts = [s for v in self._interface.outputs for s in (v.start or (0.0,) * len(v.labels))]
            counts = (0,) * len(self._interface.clocks)
            self._now = _Now(counts, tuple(starts), tuple(self._discrete.of(inputs)), math.inf, ())
            self._update()
            self._fmu.enterStepMode()
            self._arrive(time, inputs)
            return self._read()

    def outputs(self, inputs: Sequence[float]) -> list[float]:
        """Set the inputs and read the outputs; a tick at this instant is repeated if they are others."""
        with self._faults():
            self._put(inputs)
            return self._read()

    def step(self, time: float, step: float, inputs: Sequence[float]) -> list[float]:
        """Advance in time, from tick to tick."""
        with self._faults():
            self._put(inputs)
            self._release()
            end, t = time + step, time
            for _ in range(MOST_UPDATES):
                ahead = [clock.time(self._start, k) for clock, k in self._counted()]
                reached = min([end, *(at for at in (*ahead, self._now.next) if at > t)])
                if end - reached < 1e-9 * step:
                    reached = end
                event, ended, early, last = self._fmu.doStep(t, reached - t, False)
                if ended:
                    raise self._ended(last)
                if early:
                    raise FmuError(f"it returned early from the step, at t = {last:.9g} s{self._words()}")
                t = reached
                if event or t >= self._now.next:
                    self._event((), inputs)
                if t == end:
                    break
                self._arrive(t, inputs)
                self._release()
            else:
                raise FmuError(f"more than {MOST_UPDATES} events in a step, at t = {t:.9g} s")
            self._arrive(end, inputs)
            return self._read()

    def save(self) -> int:
        """Keep the state at this instant, before its tick."""
        with self._faults():
            handle = next(self._handles)
            if self._owned:  # the copy before the tick is the handle's from here on
                self._states[handle], self._known[handle], self._owned = self._before, self._at, False
                return handle
            if self._before is not None:
                self._fmu.setFMUState(self._before)
                self._now, self._ticked = self._at, None
            self._states[handle], self._known[handle] = self._fmu.getFMUState(), self._now
            return handle

    def restore(self, handle: int) -> None:
        """Return to a state; its tick follows with the inputs."""
        with self._faults():
            self._release()
            self._fmu.setFMUState(self._states[handle])
            self._now = self._at = self._known[handle]
            if self._at.due:
                self._before, self._ticked = self._states[handle], None

    def drop(self, handle: int) -> None:
        """Keep a state no longer."""
        state = self._states.pop(handle)
        del self._known[handle]
        if state is self._before:
            self._owned = True
            return
        with self._faults():
            self._fmu.freeFMUState(state)

    def _drop_all(self, fmu: Any) -> None:
        if self._before is not None and self._owned:
            with contextlib.suppress(FMICallException):
                fmu.freeFMUState(self._before)
        self._before, self._owned = None, False
        self._known.clear()
        super()._drop_all(fmu)

    def _counted(self) -> list[tuple[Clock, int]]:
        return list(zip(self._interface.clocks, self._now.counts, strict=True))

    def _arrive(self, time: float, inputs: Sequence[float]) -> None:
        """At an instant: the clocks that are due tick."""
        due = tuple(clock for clock, k in self._counted() if clock.due(self._start, k, time))
        self._now = self._at = self._now._replace(due=due)
        if due:
            self._before, self._owned = self._fmu.getFMUState(), True
            self._tick(inputs)

    def _tick(self, inputs: Sequence[float]) -> None:
        due = self._at.due
        self._event(due, inputs)
        self._ticked = list(inputs)
        counts = tuple(k + (clock in due) for clock, k in self._counted())
        self._now = self._now._replace(counts=counts, due=())

    def _put(self, inputs: Sequence[float]) -> None:
        """Set the inputs at the present instant."""
        if self._before is not None and self._ticked != list(inputs):
            self._fmu.setFMUState(self._before)
            self._now = self._at
            self._tick(inputs)
        elif tuple(self._discrete.of(inputs)) != self._now.discrete:
            self._event((), inputs)
        else:
            self._continuous.set(self._fmu, inputs)

    def _release(self) -> None:
        """Leave the instant: its tick is not repeated."""
        if self._before is not None and self._owned:
            self._fmu.freeFMUState(self._before)
        self._before, self._owned = None, False
        self._at = self._now

    def _event(self, active: Sequence[Clock], inputs: Sequence[float]) -> None:
        """Pass an event, with these clocks active."""
        fmu, references = self._fmu, [clock.reference for clock in active]
        fmu.enterEventMode()
        if active:
            fmu.setClock(references, [True] * len(active))
        self._continuous.set(fmu, inputs)
        self._discrete.set(fmu, inputs)
        clocked = [[v for v in group if set(v.clocks) & set(references)] for group in
                   (self._interface.inputs, self._interface.outputs)]  # fmt: skip
        Some(self._interface.inputs, clocked[0]).set(fmu, inputs)
        values = list(self._now.outputs)
        Some(self._interface.outputs, clocked[1]).get(fmu, 3, values)
        self._now = self._now._replace(outputs=tuple(values), discrete=tuple(self._discrete.of(inputs)))
        self._update()
        fmu.enterStepMode()

    def _update(self) -> None:
        """In Event Mode: update the discrete states."""
        for _ in range(MOST_UPDATES):
            again, ended, _, _, has_next, following = self._fmu.updateDiscreteStates()
            if ended:
                raise self._ended(self._start)
            if not again:
                break
        else:
            raise FmuError(f"its event iteration did not end after {MOST_UPDATES} updates{self._words()}")
        self._now = self._now._replace(next=following if has_next else math.inf)

    def _read(self) -> list[float]:
        values = list(self._now.outputs)
        self._unclocked.get(self._fmu, 3, values)
        return values
