"""Follow a table of rows that still grows: alarms as they come, as lines of JSON."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from hovercontrol.base.errors import InputError
from hovercontrol.base.plain_json import plain
from hovercontrol.blocks.block import Block
from hovercontrol.identification.monitor.alarms import Alarms
from hovercontrol.identification.monitor.clock import CHAIN
from hovercontrol.identification.monitor.feed import Feed, Tick
from hovercontrol.identification.monitor.notes import Note
from hovercontrol.identification.monitor.replay import alarm_json, events, threshold_of
from hovercontrol.identification.monitor.rows import Rows

Event = dict[str, Any]


def follow(
    watch: Block,
    lines: Iterable[str | Note | None],
    columns: Mapping[str, str],
    source: str,
    hold: float | None,
    *,
    missing: Sequence[float] = (),
    sizes: Mapping[str, float] | None = None,
    step: float | None = None,
) -> Iterator[Event]:
    """Give events while rows come; ``hovercontrol schema monitor_event`` lists them.

    Parameters
    ----------
    watch : Block
        A monitor.
    lines : iterable of str, Note or None
        Of a table with a header; None while no line comes.
    columns : mapping of str to str
        As ``--columns``.
    source : str
        For error lines.
    hold : float, optional
        Time after an alarm for which evidence is collected [s]; None as for a replay.
    missing : sequence of float, optional
        Numbers that stand for a missing value.
    sizes, step : optional
        As for :class:`~hovercontrol.identification.monitor.feed.Feed`.

    Raises
    ------
    InputError
        If there is no header with the columns, or no row that can be used.
    """
    one = _Following(watch, columns, source, hold, missing, sizes, step)
    yield {
        "event": "start",
        "monitor": watch.name,
        "columns": ["time", *one.inputs],
        "candidates": list(one.alarms.names),
        "period": watch.period,
        "threshold": threshold_of(watch),
    }
    try:
        for line in lines:
            yield from one.take(line)
        one.check()
    except KeyboardInterrupt:
        pass
    yield from one.end()


class _Following:
    """A monitor fed with lines."""

    def __init__(
        self,
        watch: Block,
        columns: Mapping[str, str],
        source: str,
        hold: float | None,
        missing: Sequence[float],
        sizes: Mapping[str, float] | None,
        step: float | None,
    ) -> None:
        self.feed, self.alarms = Feed(watch, sizes, step), Alarms(watch, hold)
        self.inputs = [*self.feed.measured, *self.feed.commands]
        units = {s.name: s.unit for s in watch.inputs}
        self._rows = Rows(self.inputs, columns, units, source, missing)
        self._source = source
        self._last: Tick | None = None
        self._step = step or float(watch.period or 0.0)
        self._patience = self.feed.silence + CHAIN * self._step
        self._heard, self._unused = time.monotonic(), 0

    def take(self, line: str | Note | None) -> Iterator[Event]:
        """Take a line, or that none came; give what there is to say."""
        before = self.feed.clock.last
        for found in self._rows.take(line) if isinstance(line, str) else (line,):
            if isinstance(found, Note):
                yield note_json(found)
            elif found is not None:
                self.feed.clock.in_seconds = self._rows.in_seconds
                yield from self._say(self.feed.rows(*found))
        if self.feed.clock.last is not before:
            self._heard, self._unused = time.monotonic(), 0
        else:
            self._unused += isinstance(line, str)
            yield from self._wait()

    def check(self) -> None:
        """Raise if the table ended without a header, or all of its rows were left out."""
        self._rows.end()
        if self.feed.clock.last is None and (self.bad or self.feed.clock.late.total):
            raise InputError(
                f"{self._source}: no row can be used: {self.bad} are damaged, and the times of "
                f"{self.feed.clock.late.total} do not go on"
            )

    @property
    def bad(self) -> int:
        """Number of rows with values that are left out."""
        return self._rows.bad.total + self.feed.bad.total

    def end(self) -> Iterator[Event]:
        """Give what is left, and the counts."""
        yield from self._say(self.feed.end())
        if self._last is not None:
            for event, alarm in self.alarms.end(self._last.time):
                yield {"event": event, **alarm_json(alarm)}
        yield {
            "event": "end",
            "alarms": len(self.alarms.found),
            "late_rows": self.feed.clock.late.total,
            "bad_rows": self.bad,
            "restarts": self.feed.restarts,
        }

    def _say(self, found: Iterable[Tick | Note]) -> Iterator[Event]:
        ticks = False
        for one in found:
            for event, alarm in events(self.feed, self.alarms, one):
                yield {"event": event, **alarm_json(alarm)}
            if isinstance(one, Tick):
                self._last, ticks = one, True
            elif not one.name:
                yield note_json(one)
        if ticks:
            self.alarms.heard()

    def _wait(self) -> Iterator[Event]:
        """Say that every sensor is dead if no row could be used for too long: by time, or by their number."""
        passed = max(time.monotonic() - self._heard, self._unused * self._step)
        if passed >= self._patience and not self.alarms.silent:
            last = math.nan if self.feed.clock.last is None else self.feed.clock.last.time
            for event, alarm in self.alarms.quiet(last + passed, last):
                yield {"event": event, **alarm_json(alarm)}


def note_json(note: Note) -> Event:
    """Return a note for JSON."""
    return {"event": note.event, "time": note.time, "text": note.text, "rows": note.rows}


def json_line(event: Mapping[str, Any]) -> str:
    """Return an event as one line of JSON."""
    return json.dumps(plain(event), allow_nan=False, ensure_ascii=False)
