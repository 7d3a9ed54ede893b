"""Follow a table of rows that still grows: alarms as they come, as lines of JSON."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from hovercontrol.core.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.plain_json import plain
from hovercontrol.logs.column_units import column_of, conversion_to_si
from hovercontrol.logs.readers.dialect import without_units
from hovercontrol.monitor.alarms import Alarms
from hovercontrol.monitor.feed import Feed, Tick
from hovercontrol.monitor.replay import alarm_json, settle, threshold_of

#: Time between two looks at a file that does not grow [s].
PAUSE = 0.05

#: Rows without a number as time at the start after which the table is refused; a row of units is one.
NO_TIME = 5

#: Separators of columns, tried in this order.
SEPARATORS = ("\t", ";", ",")


class Rows:
    """Rows of a table of text with a header, line by line.

    Parameters
    ----------
    names : sequence of str
        Signals to read; `time` is read as well.
    columns : mapping of str to str
        Column of the table for a signal, with its unit: as ``--columns``.
    units : mapping of str to str
        Units of the signals.
    source : str
        For error lines.

    Attributes
    ----------
    bad : int
        Rows left out because their time is not a number.
    """

    def __init__(
        self, names: Sequence[str], columns: Mapping[str, str], units: Mapping[str, str], source: str
    ) -> None:
        self._names, self._columns, self._units = ["time", *names], columns, {"time": "s", **units}
        self._source, self.bad = source, 0
        self._places: dict[str, tuple[int, float, float]] = {}
        self._begun = False

    def row(self, line: str) -> tuple[float, dict[str, float]] | None:
        """Return the time [s] and the signals of a line; None for the header, a comment or a bad row."""
        line = line.strip().removeprefix("\ufeff")
        if not line or line.startswith("#"):
            return None
        if not self._places:
            self._header(line)
            return None
        cells = line.split(self._separator)
        found = {}
        for name, (place, factor, offset) in self._places.items():
            try:
                cell = cells[place] if self._separator == "," else cells[place].replace(",", ".")
                found[name] = factor * float(cell) + offset
            except (ValueError, IndexError):
                found[name] = math.nan
        when = found.pop("time")
        if not math.isfinite(when):
            self.bad += 1
            if not self._begun and self.bad == NO_TIME:
                raise InputError(
                    f"{self._source}: first {NO_TIME} rows, time: expected a number, found {line[:40]!r}"
                )
            return None
        self._begun = True
        return when, found

    def _header(self, line: str) -> None:
        self._separator = next((s for s in SEPARATORS if s in line), ",")
        given = [cell.strip().strip('"').strip() for cell in line.split(self._separator)]
        header, units = without_units(given)
        for name in self._names:
            column, unit = column_of(self._columns[name], header) if name in self._columns else (name, "")
            if column not in header:
                raise InputError(
                    f"{self._source}: no column {column!r} for {name!r} in its header"
                    f"{did_you_mean(column, header)}"
                )
            unit = unit or units.get(column, "")
            linear = conversion_to_si(name, unit, self._units.get(name, "")) if unit else (1.0, 0.0)
            self._places[name] = (header.index(column), *linear)


def lines_of(stream: TextIO) -> Iterator[str]:
    """Give the lines of a stream as they come, to its end."""
    yield from iter(stream.readline, "")


def growing_lines(path: Path) -> Iterator[str]:
    """Give the lines of a file and those appended to it, without end; an emptied file begins anew."""
    part = ""
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        while True:
            piece = file.readline()
            if piece.endswith("\n"):
                yield part + piece
                part = ""
            elif piece:
                part += piece
            else:
                if path.exists() and path.stat().st_size < file.tell():
                    file.seek(0)
                    part = ""
                time.sleep(PAUSE)


def follow(
    watch: Block, lines: Iterator[str], columns: Mapping[str, str], source: str, hold: float
) -> Iterator[dict[str, Any]]:
    """Give events while rows come: ``start``, ``alarm``, ``named``, ``dead`` and ``back``.

    Parameters
    ----------
    watch : Block
        A monitor.
    lines : iterator of str
        Of a table with a header.
    columns : mapping of str to str
        As ``--columns``.
    source : str
        For error lines.
    hold : float
        Time after an alarm for which evidence is collected [s].
    """
    feed, alarms = Feed(watch), Alarms(watch, hold)
    inputs = [*feed.measured, *feed.commands]
    rows = Rows(inputs, columns, {s.name: s.unit for s in watch.inputs}, source)
    yield {
        "event": "start",
        "monitor": watch.name,
        "columns": ["time", *inputs],
        "candidates": list(alarms.names),
        "period": watch.period,
        "threshold": threshold_of(watch),
    }
    last: Tick | None = None
    try:
        for line in lines:
            row = rows.row(line)
            if row is None:
                continue
            for last in feed.rows(*row):
                yield from _events(feed, alarms, last)
    except KeyboardInterrupt:
        pass
    for last in feed.end():
        yield from _events(feed, alarms, last)
    if last is not None:
        for event, alarm in alarms.end(last.time):
            yield {"event": event, **alarm_json(alarm)}
    yield {
        "event": "end",
        "alarms": len(alarms.found),
        "late_rows": feed.late,
        "bad_rows": rows.bad,
        "restarts": feed.restarts,
    }


def _events(feed: Feed, alarms: Alarms, tick: Tick) -> Iterator[dict[str, Any]]:
    for event, alarm in alarms.tick(tick):
        yield {"event": event, **alarm_json(settle(feed, alarms, event, alarm))}
    if alarms.reset_due:
        feed.reset()


def json_line(event: Mapping[str, Any]) -> str:
    """Return an event as one line of JSON."""
    return json.dumps(plain(event), allow_nan=False, ensure_ascii=False)
