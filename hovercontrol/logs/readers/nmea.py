"""NMEA 0183 of GNSS receivers and compasses: ``RMC/lat``, ``HDT/heading``; a table for each kind of sentence.

Fields are those of NMEA 0183 (IEC 61162-1). A sentence without a time has that of the last sentence with one.
Courses are over ground: they are no heading.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables

_DAY = 86_400 * 10**9

_KNOT = 1852.0 / 3600.0

#: Fields of each kind of sentence: name, place after the kind, unit, factor. Times and positions are apart.
_FIELDS = {
    "RMC": (("speed", 7, "m/s", _KNOT), ("course", 8, "deg", 1.0)),
    "GGA": (("quality", 6, "", 1.0), ("satellites", 7, "", 1.0), ("altitude", 9, "m", 1.0)),
    "GLL": (),
    "VTG": (("course", 1, "deg", 1.0), ("speed", 7, "m/s", 1.0 / 3.6)),
    "HDT": (("heading", 1, "deg", 1.0),),
    "THS": (("heading", 1, "deg", 1.0),),
    "HDM": (("magnetic_heading", 1, "deg", 1.0),),
    "HDG": (("magnetic_heading", 1, "deg", 1.0),),
    "ROT": (("rate", 1, "deg/min", 1.0),),
    "VHW": (("heading", 1, "deg", 1.0), ("water_speed", 5, "m/s", _KNOT)),
    "DBT": (("depth", 3, "m", 1.0),),
    "MWV": (("wind_angle", 1, "deg", 1.0), ("wind_speed", 3, "", 1.0)),
    "RSA": (("rudder", 1, "deg", 1.0),),
    "RPM": (("speed", 3, "rpm", 1.0),),
}  # fmt: skip

#: Place of the time, of the latitude, and of the status in sentences that have them.
_TIMES = {"RMC": 1, "GGA": 1, "GLL": 5, "ZDA": 1}
_LATITUDES = {"RMC": 3, "GGA": 2, "GLL": 1}
_STATUS = {
    "RMC": (2, "V"),
    "GGA": (6, "0"),
    "GLL": (6, "V"),
    "ROT": (2, "V"),
    "THS": (2, "V"),
    "RSA": (2, "V"),
}


def nmea(file: Path) -> Tables:
    """Open a log of sentences; those with a wrong checksum are left out.

    Raises
    ------
    InputError
        If there is no sentence of a known kind after one with a time.
    """
    rows: dict[str, list[list[float]]] = {}
    times: dict[str, list[int]] = {}
    day, clock, damaged = 0, -1, 0
    with file.open("rb") as stream:
        for line in stream:
            begin = line.find(b"$")
            if begin < 0:
                continue
            body, star, check = line[begin + 1 :].strip().partition(b"*")
            if star and _checksum(body) != check[:2].upper():
                damaged += 1
                continue
            cells = body.decode("latin-1").split(",")
            kind = cells[0][-3:]
            cells += [""] * (12 - len(cells))
            day = _date(kind, cells, day)
            if kind in _TIMES and (found := _time(cells[_TIMES[kind]])) >= 0:
                clock = _later(clock, day + found)
            if kind in _FIELDS and clock >= 0:
                rows.setdefault(kind, []).append(_row(kind, cells))
                times.setdefault(kind, []).append(clock)
    if not rows:
        raise InputError(f"{file}: NMEA: expected sentences with times and positions, found none")
    tables = [_table(file, kind, np.array(own), np.array(times[kind])) for kind, own in sorted(rows.items())]
    if damaged:
        tables[0].said = f"{damaged:,} sentences with a wrong checksum left out"
    return Tables(file, tables)


def _checksum(body: bytes) -> bytes:
    found = int.from_bytes(body, "big")
    for bits in (512, 256, 128, 64, 32, 16, 8):  # the exclusive or of up to 128 bytes, folded in halves
        found ^= found >> bits
    return b"%02X" % (found & 0xFF)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _date(kind: str, cells: Sequence[str], before: int) -> int:
    """Return the day [ns since 1970] that a sentence states, else that of the one before."""
    text = cells[9] if kind == "RMC" else "".join(cells[2:5]) if kind == "ZDA" else ""
    try:
        year = int(text[4:8])
        whole = date(year if year > 99 else 2000 + year, int(text[2:4]), int(text[:2]))
    except ValueError:
        return before
    return (whole - date(1970, 1, 1)).days * _DAY


def _time(text: str) -> int:
    """Return the time of day [ns], or -1 if there is none."""
    if not re.fullmatch(r"\d{6}(\.\d*)?", text, re.ASCII):
        return -1
    seconds = 3600 * int(text[:2]) + 60 * int(text[2:4]) + int(text[4:6])
    return seconds * 10**9 + round(_number(f"0{text[6:] or '.0'}") * 1e9)


def _later(before: int, now: int) -> int:
    """Return a time that is after midnight of the next day if it would lie half a day back."""
    return now + _DAY if before >= 0 and before - now > _DAY // 2 and before - now < 3 * _DAY // 2 else now


def _row(kind: str, cells: Sequence[str]) -> list[float]:
    place, bad = _STATUS.get(kind, (0, ""))
    void = bool(place) and cells[place] == bad
    row = [np.nan if void else _number(cells[k]) * factor for _, k, _, factor in _FIELDS[kind]]
    if kind in _LATITUDES:
        k = _LATITUDES[kind]
        row += (
            [np.nan] * 2 if void else [_degrees(cells[k], cells[k + 1]), _degrees(cells[k + 2], cells[k + 3])]
        )
    return row


def _degrees(text: str, side: str) -> float:
    """Return ``5400.1230, N`` (degrees and minutes) in degrees."""
    whole, minutes = divmod(_number(text), 100.0)
    return (-1.0 if side in ("S", "W") else 1.0) * (whole + minutes / 60.0)


def _table(file: Path, kind: str, data: Any, times: Any) -> Table:
    fields = [(name, unit) for name, _, unit, _ in _FIELDS[kind]]
    fields += [("lat", "deg"), ("lon", "deg")] if kind in _LATITUDES else []
    clock = f"{kind}/time"
    new = np.concatenate([[True], np.diff(times) != 0])  # a sentence that is repeated within its time
    columns: dict[str, Any] = {clock: times[new]}
    columns |= {f"{kind}/{name}": data[new, k] for k, (name, _) in enumerate(fields)}
    units = {f"{kind}/{name}": unit for name, unit in fields if unit} | {clock: "ns"}
    return Table.of(file, kind, columns, clock, units)
