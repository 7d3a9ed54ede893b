"""Rows of a table of text, line by line as they come: header, units, numbers, and what is none of them."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from hovercontrol.base.errors import InputError, did_you_mean, shown
from hovercontrol.identification.monitor.notes import Note, Tally
from hovercontrol.logs.column_units import column_of, conversion_to_si
from hovercontrol.logs.readers.csv import NO_NUMBER
from hovercontrol.logs.readers.dialect import (
    COMMENTS,
    SEPARATORS,
    Dialect,
    is_comment,
    units_below,
    without_units,
)

#: Lines without the header, and rows without a number as time, after which a table is refused.
NO_HEADER, NO_TIME = 50, 5


@dataclass(frozen=True)
class _Header:
    """A line of names, cut at one separator: names as written, without their units, and the units."""

    separator: str
    written: tuple[str, ...]
    names: tuple[str, ...]
    units: Mapping[str, str]


class Rows:
    """Rows of a table of text with a header, line by line.

    A line with the names of all columns that are read is a header wherever it stands: a logger may start
    again in the same file or pipe.

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
    missing : sequence of float, optional
        Numbers that stand for a missing value.

    Attributes
    ----------
    bad : Tally
        Rows that are left out, or have a cell that is left out.
    in_seconds : bool
        Whether `columns` gives the unit of time.
    """

    def __init__(
        self,
        names: Sequence[str],
        columns: Mapping[str, str],
        units: Mapping[str, str],
        source: str,
        missing: Sequence[float] = (),
    ) -> None:
        self._names, self._columns, self._units = ["time", *names], columns, {"time": "s", **units}
        self._source, self._missing, self.bad = source, missing, Tally()
        self.in_seconds = False
        self._header: _Header | None = None
        self._places: dict[str, tuple[int, float, float]] = {}
        self._lines, self._below, self._time = 0, False, math.nan

    def take(self, line: str) -> Iterator[tuple[float, dict[str, float]] | Note]:
        """Give the stamp and the signals of a line, and notes on what is wrong with it.

        Raises
        ------
        InputError
            If there is no header with the columns, or the first rows have no number as time.
        """
        line = line.removeprefix("\ufeff").strip("\0\r\n")
        if not line.strip():
            return
        self._lines += 1
        comment = is_comment(line)
        text = line.lstrip("".join(COMMENTS) + " ") if comment else line
        if self._header is None:
            self._first(text, comment)
            return
        cells = _cells(line, self._header.separator)
        units = units_below(self._header.written, cells) if self._below and not comment else ()
        self._below = self._below and comment
        if units:
            self._use(self._header, dict(zip(self._header.names, units, strict=True)))
            return
        fault = "a comment" if comment else self._fault(cells)
        if fault and self._has(again := self._best(text)) == len(self._names):
            yield from self._again(again)
        elif fault:
            yield from () if comment else self._left_out(fault, line)
        else:
            yield from self._numbers(cells)

    def end(self) -> None:
        """Raise if the table ended without a header."""
        if self._header is None:
            raise InputError(f"{self._source}: expected a header with {self._wanted()}, found none")

    # ---- the header ----------------------------------------------------------------------------------

    def _wanted(self) -> str:
        return shown([self._columns.get(name, name) for name in self._names])

    def _column(self, name: str, header: _Header) -> tuple[str, str]:
        said = self._columns.get(name)
        return (name, "") if said is None else column_of(said, header.names)

    def _has(self, header: _Header) -> int:
        """Return how many of the columns a header has."""
        return sum(self._column(name, header)[0] in header.names for name in self._names)

    def _best(self, line: str) -> _Header:
        """Return a line as a header, cut at the separator that gives most of the columns, or most names."""
        found = []
        for separator in SEPARATORS:
            written = tuple(cell.strip() for cell in _cells(line, separator))
            names, units = without_units(written)
            found.append(_Header(separator, written, tuple(names), units))
        return max(found, key=lambda header: (self._has(header), len(header.names)))

    def _first(self, line: str, comment: bool) -> None:
        """Look for the header: the first line with all columns. Lines above it may hold other text."""
        header = self._best(line)
        has = self._has(header)
        row = sum(_number(cell, header.separator) is not None for cell in header.written) > 1
        if has == len(self._names) or (has and not comment):
            self._use(header, header.units)
        elif (row and not comment) or self._lines == NO_HEADER:
            raise InputError(f"{self._source}: expected a header with {self._wanted()}, found {line[:40]!r}")

    def _again(self, header: _Header) -> Iterator[Note]:
        """Read a further header."""
        before, self._header, self._places = self._header, header, {}
        try:
            self._use(header, header.units)
        except InputError as error:
            yield Note("header", f"{error}: the rows below it are left out", self._time)
            return
        if before is None or header.written != before.written:
            yield Note("header", f"another header: {', '.join(header.names)[:200]}", self._time)

    def _use(self, header: _Header, units: Mapping[str, str]) -> None:
        places = {}
        for name in self._names:
            column, unit = self._column(name, header)
            if header.names.count(column) != 1:
                twice = column in header.names
                found = f"{'two columns' if twice else 'no column'} {column!r} for {name!r} in its header"
                near = "" if twice else did_you_mean(column, header.names)
                raise InputError(f"{self._source}: {found}{near}")
            if name == "time":
                self.in_seconds = bool(unit)
            stated = units.get(column, "")
            unit = f"-{stated}" if unit == "-" else unit or stated
            linear = conversion_to_si(name, unit, self._units.get(name, "")) if unit else (1.0, 0.0)
            places[name] = (header.names.index(column), *linear)
        self._header, self._places, self._below = header, places, True

    # ---- rows ----------------------------------------------------------------------------------------

    def _fault(self, cells: list[str]) -> str:
        """Return why a line is no row; empty if it is one."""
        assert self._header is not None
        count = len(self._header.written)
        if not self._places:
            return "the header above cannot be used"
        if len(cells) < count or any(cell.strip() for cell in cells[count:]):
            return f"expected {count} values as in the header, found {len(cells)}"
        used = [cells[k].strip() for k, _, _ in self._places.values()]
        if any(not cell.isprintable() or "\ufffd" in cell for cell in used):
            return "bytes that are not text"
        return "" if math.isfinite(self._stamp(cells)) else "time: expected a number"

    def _stamp(self, cells: list[str]) -> float:
        """Return the time of a row [s]; a date is one since 1970, of UTC if it names no zone."""
        assert self._header is not None
        place, factor, offset = self._places["time"]
        number = _number(cells[place], self._header.separator)
        if number is not None:
            return factor * number + offset
        try:
            date = datetime.fromisoformat(cells[place].strip())
        except ValueError:
            return math.nan
        return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()

    def _left_out(self, fault: str, line: str) -> Iterator[Note]:
        if count := self.bad.add(fault):
            yield Note("bad", f"row left out: {fault}: {line[:40]!r}", self._time, count)
        if math.isnan(self._time) and fault.startswith("time") and self.bad.total >= NO_TIME:
            raise InputError(
                f"{self._source}: first {NO_TIME} rows, time: expected a number, found {line[:40]!r}"
            )

    def _numbers(self, cells: list[str]) -> Iterator[tuple[float, dict[str, float]] | Note]:
        assert self._header is not None
        self._time, found = self._stamp(cells), {}
        for name, (place, factor, offset) in self._places.items():
            if name == "time":
                continue
            number = _number(cells[place], self._header.separator)
            if number is None or math.isinf(number):
                if count := self.bad.add(name):
                    text = f"column {self._header.names[place]!r}: expected a number, found"
                    yield Note("bad", f"{text} {cells[place].strip()[:40]!r}", self._time, count)
                number = math.nan
            found[name] = math.nan if number in self._missing else factor * number + offset
        yield self._time, found


def _cells(line: str, separator: str) -> list[str]:
    try:
        return Dialect(separator=separator).cells(line)
    except csv.Error:  # a quote that does not end
        return [line]


def _number(cell: str, separator: str) -> float | None:
    """Return the number of a cell; NaN if it stands for a missing one, None if it is no number."""
    text = cell.strip()
    if text in NO_NUMBER:
        return math.nan
    if separator != ",":
        text = text.replace(",", ".")
    if not text.isascii() or "_" in text:  # Python's numbers are more than a log's
        return None
    try:
        return float(text)
    except ValueError:
        return None
