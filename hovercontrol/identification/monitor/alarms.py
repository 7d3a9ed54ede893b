"""Alarms of a monitor over time: when, what, how large, since when, and what else it may be.

After an alarm the evidence is collected for some seconds, which makes the name and the size sharper. Then
the tests restart: a change of the model's own coefficient or a bias that has no rival is put into the monitor
first; any other change stays, and when the tests find it again it is the same alarm, seen once more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from hovercontrol.blocks.block import Block
from hovercontrol.identification.monitor.feed import Tick, candidates_in, measured_of, parameter_of, unit_of
from hovercontrol.identification.monitor.notes import Note

#: Time after an alarm for which evidence is collected before the tests restart [s].
HOLD = 5.0

#: While there is a rival, evidence is collected for at most this many times as long.
LONGER = 3.0


@dataclass(frozen=True)
class Alarm:
    """One alarm.

    Attributes
    ----------
    time : float
        When it was raised [s].
    name : str
        Of the candidate, or of the channel of a dead sensor or a lost command.
    kind : str
        ``"change"``, ``"bias"`` of a channel, or ``"dead"`` sensor.
    change, std : float
        Change of the coefficient and its standard error; not a number for a dead sensor.
    unit : str
    since : float
        Estimated time of the onset [s].
    rivals : tuple of str
        Other candidates that the samples cannot tell apart from it.
    evidence : float
        Twice the log-likelihood ratio.
    last : float
        When it was seen for the last time [s]; for a dead sensor, when its samples came back.

    Examples
    --------
    >>> print(Alarm(31.2, "surge_linear_drag", "change", 0.3, 0.02, "1/s", 30.5, (), 60.0, 36.2))
    31.2 s: surge_linear_drag changed by 0.300 +- 0.020 1/s since 30.5 s
    """

    time: float
    name: str
    kind: str
    change: float
    std: float
    unit: str
    since: float
    rivals: tuple[str, ...]
    evidence: float
    last: float

    def __str__(self) -> str:
        if self.kind == "dead":
            return f"{self.time:.1f} s: no samples of {self.name} since {self.since:.1f} s"
        digits = 0 if not self.std > 0 else max(0, 1 - math.floor(math.log10(self.std)))
        size = f"{self.change:.{digits}f} +- {self.std:.{digits}f}" if digits < 8 else f"{self.change:.3g}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        said = (
            f"{self.name} changed by {size}{unit}" if self.kind == "change" else f"{self.name} {size}{unit}"
        )
        rivals = f"; or {', '.join(self.rivals)}" if self.rivals else ""
        return f"{self.time:.1f} s: {said} since {self.since:.1f} s{rivals}"

    @property
    def names(self) -> set[str]:
        """The name and its rivals."""
        return {self.name, *self.rivals}


class Alarms:
    """Collects the alarms of a monitor, tick by tick.

    Parameters
    ----------
    block : Block
        The monitor.
    hold : float, optional
        Time after an alarm for which evidence is collected [s].

    Attributes
    ----------
    found : list of Alarm
        All alarms that are settled, in the order of their names' settling.
    open : Alarm or None
        A change whose evidence is being collected.
    names : list of str
        Candidates of the monitor.
    reset_due : bool
        Whether the tests must restart at the next tick.
    silent : bool
        Whether no rows come.
    """

    def __init__(self, block: Block, hold: float = HOLD) -> None:
        self._places = {s.name: k for k, s in enumerate(block.outputs)}
        self.names, self._measured = candidates_in(block), measured_of(block)
        self._units = {name: unit_of(block, name) for name in self.names}
        self._hold = hold
        self.found: list[Alarm] = []
        self.open: Alarm | None = None
        self.reset_due = False
        self._dead: dict[str, int] = {}
        self._silence = parameter_of(block, "dead_after")
        self._time, self.silent = math.nan, False

    def tick(self, tick: Tick) -> Iterator[tuple[str, Alarm]]:
        """Take a tick; give events ``alarm``, ``named``, ``dead`` and ``back`` with their alarms."""
        restarting, self.reset_due = self.reset_due, False
        if tick.begins:  # what was found before is not seen any more
            yield from self.end(self._time)
        self._time = tick.time
        yield from self._sensors(tick)
        if restarting:  # the outputs of this tick are still those before the restart
            return
        which = round(float(tick.values[self._places["effect"]]))
        changed = 1 <= which <= len(self.names)
        if self.open is None and changed:
            self.open = self._alarm(tick, which, tick.time)
            if not (self.found and self.found[-1].rivals and self.open.name in self.found[-1].names):
                yield "alarm", self.open
        elif self.open is not None and changed:
            self.open = self._alarm(tick, which, self.open.time)
        longer = LONGER if self.open is not None and self.open.rivals else 1.0
        if self.open is not None and tick.time - self.open.time >= longer * self._hold:
            yield from self.end(tick.time)
            self.reset_due = True

    def end(self, time: float) -> Iterator[tuple[str, Alarm]]:
        """Settle a change whose evidence is being collected."""
        if self.open is None:
            return
        now, self.open = self.open, None
        earlier = [k for k, a in enumerate(self.found) if a.kind != "dead"]
        if earlier and self.found[earlier[-1]].rivals:  # it was not put into the monitor, and is still there
            before = self.found[earlier[-1]]
            if now.names & before.names:
                left = now.names & before.names
                name = now.name if now.name in left else before.name
                sized = now if name == now.name else before
                self.found[earlier[-1]] = replace(
                    before, name=name, kind=sized.kind, change=sized.change, std=sized.std, unit=sized.unit,
                    rivals=tuple(n for n in self.names if n in left and n != name), last=time,
                )  # fmt: skip
                if left < before.names:
                    yield "named", self.found[earlier[-1]]
                return
        self.found.append(now)
        yield "named", now

    def quiet(self, time: float, since: float) -> Iterator[tuple[str, Alarm]]:
        """Report that no rows come any more: every sensor is dead, until rows come again.

        Parameters
        ----------
        time, since : float
            Now, and when the last one came, on the clock of the rows [s]; not a number before the first row.
        """
        self.silent = True
        for name in self._measured:
            if name not in self._dead:
                yield self._died(name, time, since)

    def heard(self) -> None:
        """Report that rows come again: from the next tick on the samples decide."""
        self.silent = False

    def command(self, note: Note) -> Iterator[tuple[str, Alarm]]:
        """Take a note; if a command is lost or back, give the event ``dead`` or ``back`` with its alarm."""
        if note.event == "dead":
            yield self._died(note.name, note.time, note.since)
        elif note.event == "back":
            yield self._returned(note.name, note.time)

    def took(self, alarm: Alarm, change: float) -> None:
        """Correct the size of an alarm to the change that was put into the monitor, within its bounds."""
        self.found = [replace(a, change=change) if a is alarm else a for a in self.found]

    def _alarm(self, tick: Tick, which: int, raised: float) -> Alarm:
        def value(name: str) -> float:
            return float(tick.values[self._places[name]])

        name = self.names[which - 1]
        rivals = tuple(n for n in self.names if n != name and value(f"possible_{n}") > 0.5)
        biased = name.removesuffix("_bias") in self._measured and name.endswith("_bias")
        return Alarm(
            raised,
            name,
            "bias" if biased else "change",
            value("change"),
            value("change_std"),
            self._units[name],
            tick.time - value("since"),
            rivals,
            value("evidence"),
            tick.time,
        )

    def _sensors(self, tick: Tick) -> Iterator[tuple[str, Alarm]]:
        for name in self._measured:
            dead = tick.values[self._places[f"dead_{name}"]] > 0.5
            if dead and name not in self._dead:
                yield self._died(name, tick.time, tick.time - self._silence)
            elif dead:
                k = self._dead[name]
                self.found[k] = replace(self.found[k], last=tick.time)
            elif name in self._dead and name in tick.seen and not self.silent:
                yield self._returned(name, tick.time)

    def _died(self, name: str, time: float, since: float) -> tuple[str, Alarm]:
        self._dead[name] = len(self.found)
        nan = math.nan
        self.found.append(Alarm(time, name, "dead", nan, nan, "", since, (), nan, time))
        return "dead", self.found[-1]

    def _returned(self, name: str, time: float) -> tuple[str, Alarm]:
        k = self._dead.pop(name)
        self.found[k] = replace(self.found[k], last=time)
        return "back", self.found[k]
