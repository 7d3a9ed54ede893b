"""FIT of sports watches and marine GNSS receivers, read by fitdecode: ``record/position_lat``.

Each kind of message with a time is a table. Positions are converted from semicircles to degrees. The heading
of ``gps_metadata`` is named ``course``: a receiver measures the direction in which it moves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

EPOCH = 631_065_600
"""Unix time [s] of FIT's zero, 31 December 1989."""

_ABSOLUTE = 0x10000000
"""Times below this are seconds since the device was switched on (FIT profile, date_time)."""

_UNITS = {"semicircles": "deg", "degrees": "deg", "C": "degC", "watts": "W"}

_SEMICIRCLE = 180.0 / 2**31


def fit(file: Path) -> Tables:
    """Open an activity; an element of an array is named ``velocity[0]``.

    Raises
    ------
    InputError
        If fitdecode is missing, or no message has a time and a number.
    """
    module = library(file, "fitdecode", "FIT files", "logs-all")
    rows: dict[str, list[tuple[int, dict[str, float]]]] = {}
    units: dict[str, str] = {}
    said = ""
    strict = {"check_crc": module.CrcCheck.RAISE, "error_handling": module.ErrorHandling.IGNORE}
    with faults(file, "FIT"), module.FitReader(str(file), **strict) as reader:
        try:
            for message in reader:
                if message.frame_type == module.FIT_FRAME_DATA:
                    time, values = _message(message, units)
                    if time is not None and values:
                        rows.setdefault(message.name, []).append((time, values))
        except module.FitError as error:  # the device lost its power
            if not rows:
                raise
            said = f"FIT up to a break: {error}"
    if not rows:
        raise InputError(f"{file}: a FIT file: expected messages with a time and numbers, found none")
    return Tables(file, [_table(file, name, own, units, said) for name, own in rows.items()])


def _message(message: Any, units: dict[str, str]) -> tuple[int | None, dict[str, float]]:
    """Return the time [ns] and the numbers of a message; fill in units."""
    time: int | None = None
    values: dict[str, float] = {}
    for field in message.fields:
        if field.name == "timestamp" and isinstance(field.raw_value, int):
            seconds = field.raw_value
            time = 10**9 * (seconds + EPOCH if seconds >= _ABSOLUTE else seconds)
        elif field.name == "timestamp_ms" and time is not None and isinstance(field.value, int):
            time += 10**6 * field.value
        else:
            values |= _numbers(message.name, field, units)
    return time, values


def _numbers(kind: str, field: Any, units: dict[str, str]) -> dict[str, float]:
    several = isinstance(field.value, tuple | list)
    found = {}
    for k, value in enumerate(field.value if several else [field.value]):
        if isinstance(value, int | float):
            short = "course" if (kind, field.name) == ("gps_metadata", "heading") else field.name
            name = f"{kind}/{short}[{k}]" if several else f"{kind}/{short}"
            found[name] = value * _SEMICIRCLE if field.units == "semicircles" else float(value)
            if unit := unit_or_none(_UNITS.get(field.units, field.units or "")):
                units[name] = unit
    return found


def _table(
    file: Path, name: str, rows: list[tuple[int, dict[str, float]]], units: dict[str, str], said: str
) -> Table:
    clock = f"{name}/time"
    header = list(dict.fromkeys(key for _, values in rows for key in values))
    columns: dict[str, Any] = {clock: np.array([time for time, _ in rows])}
    columns |= {key: np.array([values.get(key, np.nan) for _, values in rows]) for key in header}
    return Table.of(file, name, columns, clock, units | {clock: "ns"}, said)
