"""Alarms of a monitor over time: when, what, how large, since when, and what else it may be.

After an alarm the evidence is collected for some seconds, which makes the name and the size sharper; longer
while there is a rival. A change of the model's own coefficient or a bias that has no rival is then put into
the monitor, and the tests restart. Any other change stays open: its size is followed until it has ended, or
is not significant any more. If its name is refuted meanwhile, what takes its place is another alarm. Two
changes at once are two alarms, settled together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from hovercontrol.blocks.block import Block
from hovercontrol.identification.monitor.feed import Tick, candidates_in, measured_of, parameter_of, unit_of
from hovercontrol.identification.monitor.monitor import named_effects
from hovercontrol.identification.monitor.notes import Note

#: Time after an alarm for which evidence is collected, in times of settling: 5 s for a craft.
HOLD = 2.5

#: While there is a rival, and the change has not ended, evidence is collected for at most this many times as
#: long.
LONGER = 3.0

#: Standard errors beyond which a change or a rate is significant: the probability by chance is 1 in 370.
SIGNIFICANT = 3.0


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
        ``"change"``, ``"bias"`` of a channel, ``"dead"`` sensor, or ``"unknown"`` for what no candidate
        explains: an acceleration (its name is that of the state), or an offset of a sensor (``NAME_bias``).
    change, std : float
        Change of the coefficient and its standard error; not a number for a dead sensor.
    unit : str
    since : float
        Estimated time of the onset [s].
    rivals : tuple of str
        Other candidates that the samples cannot tell apart from it, and ``unknown_NAME`` for a change that is
        in no candidate.
    evidence : float
        Twice the log-likelihood ratio.
    last : float
        When it was seen for the last time [s]; for a dead sensor, when its samples came back.
    rate, rate_std : float, optional
        Of the change per second, and its standard error.
    ended : float, optional
        When the change ended [s]; not a number while it has not.
    beside : str, optional
        Another change that the monitor found at once.

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
    rate: float = 0.0
    rate_std: float = math.inf
    ended: float = math.nan
    beside: str = ""

    def __str__(self) -> str:
        if self.kind == "dead":
            return f"{self.time:.1f} s: no samples of {self.name} since {self.since:.1f} s"
        unit, rate = "" if self.unit == "1" else f" {self.unit}", ""
        size = f"{_sized(self.change, self.std)}{unit}"
        said = {
            "change": f"{self.name} changed by {size}",
            "bias": f"{self.name} {size}",
            "unknown": f"no candidate explains the change: {_unknown(self.name, f' of {size}')}",
        }[self.kind]
        if self.grows:
            rate = f", growing by {_sized(self.rate, self.rate_std)}{unit} in 1 s"
        named = [n for n in self.rivals if not n.startswith("unknown_")]
        named += [f"{_unknown(n[8:])} that is no candidate" for n in self.rivals if n.startswith("unknown_")]
        rivals = f"; or {', '.join(named)}" if named else ""
        rivals = f"; at once with {self.beside}" if self.beside else rivals
        ended = f"; ended at {self.ended:.1f} s" if math.isfinite(self.ended) else ""
        return f"{self.time:.1f} s: {said} since {self.since:.1f} s{rate}{ended}{rivals}"

    @property
    def significant(self) -> bool:
        """Whether the change is more than chance."""
        return abs(self.change) > SIGNIFICANT * self.std

    @property
    def grows(self) -> bool:
        """Whether its rate is more than chance."""
        return abs(self.rate) > SIGNIFICANT * self.rate_std


def _unknown(name: str, size: str = "") -> str:
    sensor = name.endswith("_bias")
    return (
        f"an offset{size} of {name.removesuffix('_bias')}" if sensor else f"an unknown term{size} in {name}'"
    )


def _sized(value: float, std: float) -> str:
    digits = max(0, 1 - math.floor(math.log10(std))) if 0.0 < std < math.inf else 0
    return f"{value:.{digits}f} +- {std:.{digits}f}" if digits < 8 else f"{value:.3g}"


class Alarms:
    """Collects the alarms of a monitor, tick by tick.

    Parameters
    ----------
    block : Block
        The monitor.
    hold : float, optional
        Time after an alarm for which evidence is collected [s] (default: :data:`HOLD` times settling).

    Attributes
    ----------
    found : list of Alarm
        All alarms that are settled, in the order of their names' settling.
    open : Alarm or None
        A change that is followed.
    names : list of str
        Candidates of the monitor.
    reset_due : bool
        Whether the tests must restart at the next tick.
    silent : bool
        Whether no rows come.
    hold : float
        [s]
    """

    def __init__(self, block: Block, hold: float | None = None) -> None:
        self._places = {s.name: k for k, s in enumerate(block.outputs)}
        self.names, self._measured = candidates_in(block), measured_of(block)
        self._every = named_effects(block)
        self._units = {name: unit_of(block, name) for name in self._every}
        self.hold = hold or HOLD * parameter_of(block, "settle")
        self.found: list[Alarm] = []
        self.open: Alarm | None = None
        self._second: Alarm | None = None  # that has changed at once with the open one
        self._largest: Alarm  # the open one where it was most significant
        self.reset_due = False
        self._told = False  # whether the open one is the last of those found
        self._put: dict[str, int] = {}  # places of those that were put into the monitor
        self._dead: dict[str, int] = {}
        self._silence = parameter_of(block, "dead_after")
        self._time, self.silent = math.nan, False

    def tick(self, tick: Tick) -> Iterator[tuple[str, Alarm]]:
        """Take a tick; give events ``alarm``, ``named``, ``ended``, ``dead`` and ``back`` with alarms."""
        restarting, self.reset_due = self.reset_due, False
        if tick.begins:  # what was found before is not seen any more
            yield from self.end(self._time)
        self._time = tick.time
        yield from self._sensors(tick)
        which = round(float(tick.values[self._places["effect"]]))
        of_sensor = len(self.names) < which <= len(self.names) + len(self._measured)
        if restarting or not which or of_sensor:  # at a restart the outputs are still those before it
            return
        now, self._second = self._alarms(tick, which, tick.time if self.open is None else self.open.time)
        if self._told and self._is_another(now):
            self.open, now = None, replace(now, time=tick.time)
        if self.open is None:
            self.open = self._largest = now
            self._told = False
            yield "alarm", now
            return
        if math.isfinite(now.ended):  # of what has ended, the size that it had
            now = replace(now, change=self._largest.change, std=self._largest.std, rate=0.0)
        elif (
            now.significant
            and not now.grows
            and not (
                self._largest.significant
                and now.name == self._largest.name
                and abs(now.change) < abs(self._largest.change)
            )
        ):
            self._largest = now
        self.open = now
        if self._told:
            self.found[-1] = now
            wanes = now.kind != "unknown" and not now.significant  # an unknown one may pass through zero
            if math.isfinite(now.ended) or wanes:
                self.found[-1] = now = replace(now, ended=now.ended if math.isfinite(now.ended) else now.last)
                self.close()
                yield "ended", now
        elif tick.time - now.time >= self.hold * (LONGER if now.rivals and math.isnan(now.ended) else 1.0):
            yield from self._name(now)

    def _is_another(self, now: Alarm) -> bool:
        """Return whether a change is not the open one, or is found with another one at once."""
        before = self.open
        return before is not None and (now.name != before.name or now.beside not in ("", before.beside))

    def _name(self, now: Alarm) -> Iterator[tuple[str, Alarm]]:
        before = self._put.get(now.name)
        if before is not None and not [n for n in now.rivals if n in self.names]:  # is it taken back?
            was = self.found[before]
            if abs(was.change + now.change) < SIGNIFICANT * math.hypot(was.std, now.std):
                self.found[before] = replace(was, ended=now.since, last=now.last)
                self.took(now, now.change)
                del self._put[now.name]
                yield "ended", self.found[before]
                return
        self._told = True
        for one in (now,) if self._second is None else (self._second, now):
            self.found.append(one)
            yield "named", one
        if math.isfinite(now.ended):
            self.close()

    def end(self, time: float) -> Iterator[tuple[str, Alarm]]:
        """Settle a change whose evidence is being collected."""
        if self.open is not None and not self._told:
            yield from self._name(self.open)
        self.open = None

    def close(self) -> None:
        """Follow the open change no longer; the tests restart."""
        self.open, self.reset_due = None, True

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
        """Note that a change was put into the monitor, within its bounds, and restart the tests."""
        self.found = [replace(a, change=change) if a is alarm else a for a in self.found]
        self._put[alarm.name] = len(self.found) - 1
        self.close()

    def _alarms(self, tick: Tick, which: int, raised: float) -> tuple[Alarm, Alarm | None]:
        """Return the alarm, and that of a second change at once."""
        now = self._alarm(tick, which, raised)
        at, change, std = (
            float(tick.values[self._places[key]]) for key in ("second", "second_change", "second_change_std")
        )
        if not at:
            return now, None
        name = self._every[round(at) - 1]
        second = replace(
            now, name=name, kind=self._kind(name), change=change, std=std, unit=self._units[name],
            beside=now.name,
        )  # fmt: skip
        return replace(now, beside=name), second

    def _kind(self, name: str) -> str:
        biased = name.removesuffix("_bias") in self._measured and name.endswith("_bias")
        return "bias" if biased else "change"

    def _alarm(self, tick: Tick, which: int, raised: float) -> Alarm:
        def value(name: str) -> float:
            return float(tick.values[self._places[name]])

        name, unknown = self._every[which - 1], which > len(self.names)
        unknowns = [n for n in self._every if n.startswith("unknown_")]
        others = [n for n in (*self.names, *unknowns) if n != name]
        rivals = tuple(n for n in others if value(f"possible_{n}") > 0.5 and value("second") < 0.5)
        return Alarm(
            raised,
            name.removeprefix("unknown_") if unknown else name,
            "unknown" if unknown else self._kind(name),
            value("change"),
            value("change_std"),
            self._units[name],
            tick.time - value("since"),
            rivals,
            value("evidence"),
            tick.time,
            value("rate"),
            value("rate_std"),
            tick.time - value("held") if value("ended") > 0.5 else math.nan,
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
