"""Time from stamps: seconds and nanoseconds in two columns, dates, and counts since an epoch.

A float of 1.7e9 s has a resolution of 0.2 us. Stamps are therefore integers [ns] until the first stamp has
been subtracted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.blocks.units import conversion_factor
from hovercontrol.logs.log import Floats
from hovercontrol.logs.source import Source


@dataclass(frozen=True)
class StampCriteria:
    """Thresholds for a time that counts from an epoch.

    Set by hand, tested in tests/logs/test_stamps.py.

    Attributes
    ----------
    epoch : float
        Smallest time [s] that counts from an epoch: 3 years, longer than any log.
    earliest, latest : float
        Range of times [s] since 1970, 2001 to 2100, from which the unit is inferred if none is given.
    """

    epoch: float = 1e8
    earliest: float = 978307200.0
    latest: float = 4102444800.0


#: The values in use.
STAMPS = StampCriteria()

#: A day [ns].
DAY = 86_400 * 10**9

#: Power of ten from each unit of a stamp to nanoseconds.
PLACES = {"s": 9, "ms": 6, "us": 3, "ns": 0}

#: Units of whole parts of a stamp [ns].
WHOLE = {"week": 7 * DAY, "day": DAY}

#: Suffixes of column names that give the unit of a part of a stamp.
_NAMED = (
    ("ns", r"(nsecs?|nanosecs?|nanoseconds?|ns)"),
    ("us", r"(usecs?|microsec(ond)?s?|us)"),
    ("ms", r"(msecs?|ms)"),
    ("week", r"(weeks?|wn|wno)"),
)
_DAY = re.compile(r"\d{4}-\d\d-\d\d")
_DAYS = re.compile(r"(?P<days>-?\d+) days? \+?(?P<clock>\d\d:\d\d:\d\d.*)")
_EUROPEAN = r"^(\d\d)\.(\d\d)\.(\d{4})[ T]"
_ZONE = re.compile(r"(Z|[-+]\d\d:?\d\d)$")


def needs_stamps(source: Source, name: str, unit: str) -> bool:
    """Return whether a column of time is text, or counts from an epoch.

    Parameters
    ----------
    name, unit : str
        Name and unit of the column; the unit is empty if none is given.
    """
    kind = source.kind(name)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_timestamp(kind):
        return True
    if unit.lstrip("-") not in ("", *PLACES):
        return False
    if not (pa.types.is_decimal(kind) or pa.types.is_integer(kind) or pa.types.is_float64(kind)):
        return False
    first = _first(source, name)
    return first is not None and abs(float(first)) * 10.0 ** (PLACES.get(unit, 9) - 9) >= STAMPS.epoch


def _first(source: Source, name: str) -> Any:
    """Return the first value of a column of numbers, or None if there is none."""
    for batch in source.batches([name], [name]):
        for value in batch.column(0).drop_null()[:1]:
            return value.as_py()
    return None


@dataclass
class Stamps:
    """Converts the stamps of a log to seconds since its first row.

    Attributes
    ----------
    file : Path
        For error messages.
    source : Source
    parts : list of tuple of str
        Columns and units whose sum is the stamp; the unit is empty if none is given.
    origin : int
        The stamp of the first row [ns]; None until rows have been read.
    """

    file: Path
    source: Source
    parts: list[tuple[str, str]]
    origin: int | None = None
    said: str = ""
    _units: list[str] = field(init=False)
    _last: int | None = None  # the last time of day [ns]

    def __post_init__(self) -> None:
        self._units = [self._unit(name, unit) for name, unit in self.parts]

    def seconds(self, given: list[pa.Array], rows: range) -> Floats:
        """Return the time [s] since the first row; NaN where a stamp is missing."""
        total, there = np.zeros(len(given[0]), dtype=np.int64), np.ones(len(given[0]), dtype=bool)
        for (name, _), unit, column in zip(self.parts, self._units, given, strict=True):
            there &= np.asarray(column.is_valid())
            total += self._nanoseconds(name, unit, column, rows.start)
        if self.origin is None and there.any():
            self.origin = int(total[there][0])
        time = (total - (self.origin or 0)) / 1e9
        time[~there] = np.nan
        return np.asarray(time)

    def _unit(self, name: str, unit: str) -> str:
        """Return the unit of a part; if none is given, infer it from its name or from the resulting year."""
        if unit and unit not in PLACES:
            if len(self.parts) > 1 and unit not in WHOLE:
                known = ", ".join((*PLACES, *WHOLE))
                raise ArgumentError(
                    f"{self.file}: time: expected one of {known} for {name!r}, found {unit!r}"
                )
            conversion_factor(unit, "s")
        if unit:
            return unit
        if len(self.parts) > 1:
            return next((u for u, end in _NAMED if re.search(rf"(^|[^a-z]|[a-z]){end}$", name.lower())), "s")
        kind = self.source.kind(name)
        if not (pa.types.is_decimal(kind) or pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            return "s"
        first = float(_first(self.source, name) or 0.0)
        for guess, places in PLACES.items():
            if STAMPS.earliest <= first * 10.0 ** (places - 9) <= STAMPS.latest:
                if guess != "s":
                    self.said = f"{name} in {guess} since 1970"
                return guess
        return "s"

    def _nanoseconds(self, name: str, unit: str, column: pa.Array, row: int) -> Any:
        kind = column.type
        if len(self.parts) > 1 and unit in WHOLE:
            return _integers(column.cast(pa.float64(), safe=False).cast(pa.int64())) * WHOLE[unit]
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            return self._dates(name, column, row)
        if pa.types.is_timestamp(kind):
            return _integers(column.cast(pa.timestamp("ns", kind.tz)).cast(pa.int64()))
        places = PLACES.get(unit, 9)
        if pa.types.is_decimal(kind):
            scaled = column.cast(pa.decimal128(38, places), safe=False)
            low = np.frombuffer(scaled.buffers()[1], dtype=np.int64)[::2]
            return np.where(
                np.asarray(scaled.is_valid()), low[scaled.offset : scaled.offset + len(scaled)], 0
            )
        if pa.types.is_integer(kind):
            return _integers(column.cast(pa.int64())) * 10**places
        values = np.nan_to_num(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))
        whole = np.floor(values)
        return whole.astype(np.int64) * 10**places + np.rint((values - whole) * 10**places).astype(np.int64)

    def _dates(self, name: str, column: pa.Array, row: int) -> Any:
        """Return dates in ISO 8601 format, or times of day, as nanoseconds since 1970."""
        text = pc.replace_substring(pc.utf8_trim_whitespace(column), ",", ".")
        text = pc.replace_substring_regex(text, _EUROPEAN, r"\3-\2-\1T")
        first = next((v.as_py() for v in text.drop_null()[:1]), "")
        if _DAYS.match(first):  # a duration, as pandas writes it: 1 days 00:00:00.5
            parts = pc.extract_regex(text, f"^{_DAYS.pattern}$")
            if parts.null_count == text.null_count:
                clock = pc.binary_join_element_wise("1970-01-01T", parts.field("clock"), "")
                days = DAY * _integers(parts.field("days").cast(pa.int64()))
                return days + _integers(clock.cast(pa.timestamp("ns")).cast(pa.int64()))
        day = bool(_DAY.match(first))
        if not day:
            text = pc.binary_join_element_wise("1970-01-01T", text, "")
        try:
            zone = "UTC" if _ZONE.search(first) and day else None
            found = _integers(text.cast(pa.timestamp("ns", zone)).cast(pa.int64()))
            return found if day else self._past_midnight(found, np.asarray(column.is_valid()))
        except pa.ArrowException:
            for k, value in enumerate(text):
                try:
                    pa.scalar(value.as_py()).cast(pa.timestamp("ns", zone))
                except pa.ArrowException:
                    where, found = self.source.place(row + k, name)
                    raise InputError(
                        f"{self.file}: {where}, column {name!r}: expected a time as ISO 8601 writes it, "
                        f"2026-01-31T12:00:00.5 (or a number), found {found[:40]!r}"
                    ) from None
            raise

    def _past_midnight(self, found: Any, there: Any) -> Any:
        """Return times of day [ns] that go on after midnight: a fall by over half a day is a new day."""
        found = found.copy()
        known = found[there]
        if not known.size:
            return found
        before = np.append(known[0] if self._last is None else self._last % DAY, known[:-1])
        days = (self._last or 0) // DAY + np.cumsum(before - known > DAY // 2)
        found[there] = known + DAY * days
        self._last = int(found[there][-1])
        return found


def _integers(column: pa.Array) -> Any:
    return column.fill_null(0).to_numpy(zero_copy_only=False)
