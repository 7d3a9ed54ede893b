"""Rows of a log to ticks of a monitor, one by one: a log that is read, or one that still grows.

Row i belongs to the tick ``k = round((t_i - t_0)/T)`` of the period T. The ticks follow the clock of the
rows: each row moves t_0 by a part of ``t_i - t_0 - k T``. Ticks without a row are lost samples; of several
rows at one tick each signal has the value nearest in time. Commands hold until the next one. What the stamps
of rows mean is decided by :mod:`.clock`, and which rows are used without a command by :mod:`.commands`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.reasons import StoppedError
from hovercontrol.craft.effects import effect_class, effect_names
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.identification.monitor.clock import Clock, Row
from hovercontrol.identification.monitor.commands import Commands
from hovercontrol.identification.monitor.notes import Note, Tally

#: A value that is this many times the largest of the reference log is damaged, or in another unit.
FAR = 1000.0

#: Part of the time between a row and its tick by which the ticks follow: jitter is averaged over 16 rows.
FOLLOWS = 1.0 / 16.0


@dataclass(frozen=True)
class Tick:
    """What a monitor says at a tick.

    Attributes
    ----------
    time : float
        Time of the tick [s], on the clock of the rows.
    values : ndarray
        Outputs of the monitor, in its order.
    begins : bool
        Whether the monitor has just started, or started anew.
    seen : frozenset of str
        Signals with a value at this tick.
    """

    time: float
    values: Array
    begins: bool = False
    seen: frozenset[str] = frozenset()


class Feed:
    """A monitor in machine code, fed with rows.

    Parameters
    ----------
    block : Block
        From :func:`~hovercontrol.identification.monitor.monitor.monitor`.
    sizes : mapping of str to float, optional
        Largest absolute values of signals in a reference log; values of more than :data:`FAR` times as much
        are left out.
    step : float, optional
        Usual time between two rows [s] (default: the period).

    Attributes
    ----------
    clock : Clock
        It counts the rows left out because of their stamps, as ``clock.late.total``.
    bad : Tally
        Rows with values that are left out.
    restarts : int
        Starts anew: after a gap of more than 30 s, when the clock begins again, when a lost command is back,
        and when the equations of the monitor give no number.
    """

    def __init__(
        self, block: Block, sizes: Mapping[str, float] | None = None, step: float | None = None
    ) -> None:
        if not is_monitor(block):
            raise InputError(f"replay: {block.name!r} is not a monitor: expected a Block of hc.monitor")
        self.block, self.bad, self.restarts = block, Tally(), 0
        self._compiled = block.compile()
        self._period = float(block.period or 0.0)
        inputs = [s.name for s in block.inputs]
        self._places = {name: k for k, name in enumerate(inputs)}
        self._fresh = {n: n.removeprefix("fresh_") for n in inputs if n == "fresh" or n.startswith("fresh_")}
        self.measured = measured_of(block)
        self.commands = [
            n for n in inputs if n not in self.measured and n not in self._fresh and n != "reset"
        ]
        self.clock = Clock(self._period, step or self._period)
        self.silence = parameter_of(block, "dead_after")
        self._known = Commands(self.commands, self.silence + self._period)
        self._farthest = {name: FAR * size for name, size in (sizes or {}).items()}
        self._commanded = set(self.commands)
        self._own = {key.rpartition(".")[2]: key for key in self._compiled.block.default_parameters}
        self._own = {n: self._own[n] for n in candidates_in(block) if n in self._own}
        self._bounds = {
            key: (float(p.lower), float(p.upper))
            for p in self._compiled.block.parameters
            for key in self._own.values()
            if p.name == key
        }
        self._params: dict[str, float] = {}
        self._estimates = {
            s.description.removeprefix("estimate of "): s.name
            for s in self._compiled.block.states
            if s.description.startswith("estimate of ")
        }
        self._learnt: dict[str, float] = {}
        self._bias = dict.fromkeys(self.measured, 0.0)
        self._reset = False
        self._running, self._begin_of = False, 0.0
        self._rows: dict[str, tuple[float, float]] = {}
        self._later: dict[str, float] = {}
        self._tick, self._begun = 0, False
        with suppress(StoppedError):
            self._compiled.start().step(None, self._period)  # builds what the first row would wait for

    def reset(self) -> None:
        """Restart the tests at the next tick."""
        self._reset = True

    def holds(self, name: str) -> bool:
        """Return whether a change can be put into the monitor: of an own coefficient, or a bias."""
        estimated = name in self._estimates and name in candidates_in(self.block)
        return name.removesuffix("_bias") in self._bias or name in self._own or estimated

    def adopt(self, name: str, change: float) -> float:
        """Put a change that it :meth:`holds` into the monitor.

        Returns
        -------
        float
            The change, limited to the bounds of the coefficient.
        """
        if name.endswith("_bias") and name.removesuffix("_bias") in self._bias:
            self._bias[name.removesuffix("_bias")] += change
        elif name in self._own:
            key = self._own[name]
            lower, upper = self._bounds[key]
            before = self._runner.params[key]
            self._params[key] = min(max(before + change, lower), upper)
            self._runner.set(params={key: self._params[key]})
            return self._params[key] - before
        else:  # an uncertain coefficient
            key = self._estimates[name]
            at = [s.name for s in self._compiled.block.states].index(key)
            self._learnt[key] = float(self._runner.state[at]) + change
            self._runner.set(state={key: self._learnt[key]})
        return change

    def rows(self, time: float, values: Mapping[str, float]) -> Iterator[Tick | Note]:
        """Take a row; give the ticks before it that are complete, and notes on what is wrong with rows.

        Parameters
        ----------
        time : float
            Its stamp [s]; a number.
        values : mapping of str to float
            Measured channels and commands by name; not a number where there is none.
        """
        far = [n for n, value in values.items() if abs(value) > self._farthest.get(n, math.inf)]
        for name in far:
            if count := self.bad.add(name):
                size = self._farthest[name] / FAR
                text = f"{name} = {values[name]:.4g}: over {FAR:g} times the {size:.4g} of the reference log"
                yield Note("bad", f"{text}, so it is left out", self._time, count)
        yield from self._take(self.clock.take(time, {**values, **dict.fromkeys(far, math.nan)}))

    def end(self) -> Iterator[Tick | Note]:
        """Give the ticks of the last rows."""
        yield from self._take(self.clock.end())
        yield from self._finish()

    @property
    def knows_dispersion(self) -> bool:
        """Whether the monitor knows the dispersion of its scores."""
        return any(p.name.rpartition(".")[2].startswith("dispersion_") for p in self.block.parameters)

    @property
    def knows_errors(self) -> bool:
        """Whether the monitor knows the dispersion of its scores, or errors of a coefficient."""
        return self.knows_dispersion or not self._estimates.keys().isdisjoint(candidates_in(self.block))

    @property
    def _time(self) -> float:
        return math.nan if self.clock.last is None else self.clock.last.time

    def _take(self, rows: Iterable[Row | Note]) -> Iterator[Tick | Note]:
        for placed in rows:
            for row in self._known.take(placed) if isinstance(placed, Row) else (placed,):
                if isinstance(row, Note):
                    yield row
                else:
                    yield from self._feed(row)

    def _feed(self, row: Row) -> Iterator[Tick | Note]:
        if row.begins and self._begun:
            yield from self._finish()
            self._running, self.restarts = False, self.restarts + 1
        if not self._running:
            self._begin(row.time, row.values)
        tick, before = round((row.time - self._begin_of) / self._period), self.restarts
        while self.restarts == before and self._tick < tick:
            if self._rows:
                yield from self._step()
            else:
                yield from self._unseen(tick, row)
        if self.restarts != before:  # the equations gave no number
            yield from self._feed(row)
            return
        late = row.time - self._begin_of - tick * self._period
        self._begin_of += max(FOLLOWS, 1.0 / self._count) * late
        self._count += 1
        away = abs(late)
        for name, value in row.values.items():
            if math.isfinite(value):
                if name in self._commanded:
                    self._later[name] = value
                if name not in self._rows or away < self._rows[name][0]:
                    self._rows[name] = (away, value)

    def _finish(self) -> Iterator[Tick | Note]:
        if self._running and self._rows:
            yield from self._step()

    def _unseen(self, tick: int, row: Row) -> Iterator[Tick | Note]:
        """Give the ticks without a row before a tick, at which a row has come.

        If a command differs after them, it changed at one of the n + 1 ticks, nobody knows which. With x0 and
        x1 the predictions by the command before and after, and d = x1 - x0, the prediction has the mean
        (x0 + x1)/2 and a covariance that is larger by d d' (n + 2)/(12 n), that of n + 1 equal chances.
        """
        n, before = tick - self._tick, self.restarts
        held = {name: self._held[self._places[name]] for name in self.commands}
        new = {name: row.values.get(name, math.nan) for name in self.commands}
        differ = {name: value for name, value in new.items() if math.isfinite(value) and value != held[name]}
        x0, x1 = (self._predicted(n, some) for some in ({}, differ)) if differ else ({}, {})
        for _ in range(n):
            if self.restarts == before:
                yield from self._step()
        if not differ or self.restarts != before:
            return
        names = list(self._estimates.values())
        d = [x1[name] - x0[name] for name in names]
        state = {name: x0[name] + away / 2 for name, away in zip(names, d, strict=True)}
        for i in range(len(d)):
            for j in range(i, len(d)):
                key = f"{names[i].rpartition('xhat')[0]}P[{i},{j}]"
                state[key] = x0[key] + d[i] * d[j] * (n + 2) / (12 * n)
        self._runner.set(state=state)

    def _predicted(self, ticks: int, commands: Mapping[str, float]) -> dict[str, float]:
        """Return the monitor's states after ticks without a row, by these commands; it stays as it is."""
        saved, inputs = self._runner.save(), self._held.copy()
        for name in self._fresh:
            inputs[self._places[name]] = 0.0
        for name, value in commands.items():
            inputs[self._places[name]] = value
        for _ in range(ticks):
            self._runner.set(inputs=inputs)
            states = self._runner.state
            self._runner.step(None, self._period)
        self._runner.restore(saved)
        return dict(zip(self._runner.state_labels, states.tolist(), strict=True))

    def _begin(self, time: float, values: Mapping[str, float]) -> None:
        at = self._learnt | {
            self._estimates[name]: values[name] - self._bias[name]
            for name in self.measured
            if name in self._estimates and math.isfinite(values.get(name, math.nan))
        }
        self._begin_of, self._count, self._tick, self._rows = time, 1, 0, {}
        self._later = {}
        self._held = np.array([s.start for s in self.block.inputs])
        for name, place in self._places.items():
            if name in self.measured and name in values and math.isfinite(values[name]):
                self._held[place] = values[name] - self._bias[name]
        self._runner, self._begun, self._first = self._compiled.start(at, self._params), True, True
        self._running = True

    def _step(self) -> Iterator[Tick | Note]:
        for name, (_, value) in self._rows.items():
            if name in self._places:
                self._held[self._places[name]] = value - self._bias.get(name, 0.0)
        for name, channel in self._fresh.items():
            seen = channel in self._rows if name != "fresh" else all(n in self._rows for n in self.measured)
            self._held[self._places[name]] = float(seen)
        self._held[self._places["reset"]] = float(self._reset)
        self._reset = False
        time = self._begin_of + self._tick * self._period
        try:
            self._runner.set(inputs=self._held)
            values = self._runner.outputs
            self._runner.step(None, self._period)
            finite = not np.isnan(values).any()
        except StoppedError:
            finite = False
        for name, value in self._later.items():
            self._held[self._places[name]] = value
        there = frozenset(self._rows)
        self._tick, self._rows, self._later = self._tick + 1, {}, {}
        if finite:
            begins, self._first = self._first, False
            yield Tick(time, values, begins, there)
        else:
            self._running, self.restarts = False, self.restarts + 1
            text = "the equations of the monitor give no number: it starts anew"
            yield Note("restart", text, time, self.restarts)


def is_monitor(block: Block) -> bool:
    """Return whether a Block has the signals of a monitor."""
    outputs, inputs = {s.name for s in block.outputs}, {s.name for s in block.inputs}
    return bool(block.period) and {"alarm", "effect", "evidence", "since"} <= outputs and "reset" in inputs


def measured_of(block: Block) -> list[str]:
    """Return the measured channels of a monitor."""
    return [s.name.removeprefix("dead_") for s in block.outputs if s.name.startswith("dead_")]


def candidates_in(block: Block) -> list[str]:
    """Return the candidates of a monitor."""
    named = [s.name.removeprefix("possible_") for s in block.outputs if s.name.startswith("possible_")]
    return [name for name in named if not name.startswith("unknown_")]


def unit_of(block: Block, candidate: str) -> str:
    """Return the unit of a candidate's coefficient."""
    scale = {p.name.rpartition(".")[2]: p.unit for p in block.parameters}
    if f"scale_{candidate}" in scale:
        return scale[f"scale_{candidate}"]
    inputs = {s.name: s.unit for s in block.inputs}
    for cls in map(effect_class, effect_names()):
        scaling = [k for k, n in cls.numbers.items() if not math.isnan(n.neutral)]
        for key in scaling:
            if candidate == cls.parameter(key) or (candidate == cls.name and len(scaling) == 1):
                try:
                    return resolved_unit(cls.numbers[key].unit, inputs)
                except InputError:
                    return cls.numbers[key].unit
    return "1"


def parameter_of(watch: Block, name: str) -> float:
    """Return the value of one of a monitor's own parameters."""
    return float(next(p.start for p in watch.parameters if p.name.rpartition(".")[2] == name))
