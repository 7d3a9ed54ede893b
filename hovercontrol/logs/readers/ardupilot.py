"""ArduPilot's dataflash logs (.BIN), indexed by pymavlink: ``ATT/Yaw``, instances ``IMU[0]/GyrZ``.

Time is in us since boot.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

#: Messages about the log itself.
ABOUT = ("FMT", "FMTU", "UNIT", "MULT")

CLOCKS = {"TimeUS": "us", "TimeMS": "ms"}

#: Units under the names that the log uses; servo pulses are in us, not in s.
_UNITS = {
    **dict.fromkeys(("us", "µs", "μs"), ""),
    "degheading": "deg",
    "deglatitude": "deg",
    "deglongitude": "deg",
    "m/s/s": "m/s^2",
    "°C": "degC",
}

_FORMAT = b"\xa3\x95\x80"
"""How a message begins that describes another."""

_HEAD = 3
"""Bytes before the values of a message."""


def ardupilot(file: Path) -> Tables:
    """Open a log.

    Raises
    ------
    InputError
        If pymavlink is missing, or the file is damaged or holds no message with a time.
    """
    reader = library(file, "pymavlink.DFReader", "ArduPilot logs")

    class Index(reader.DFReader_binary):  # type: ignore[name-defined]
        """Index of the messages without a GPS clock, which would need a pass through all messages."""

        def init_clock(self) -> None:
            self.clock = reader.DFReaderClock()

        def init_arrays_fast(self, progress_callback: Any = None) -> None:
            self.init_arrays(progress_callback)  # the fast one writes to standard error, bypassing Python

    with faults(file, "ArduPilot log"):
        _check_lengths(file)
        index = Index(str(file))
        raw = np.memmap(file, dtype=np.uint8, mode="r")
        tables = [
            table
            for number, form in sorted(index.formats.items(), key=lambda pair: str(pair[1].name))
            if form.name not in ABOUT
            for table in _tables(file, raw, form, index.offsets[number], reader.FORMAT_TO_STRUCT)
        ]
        index.close()
    if not tables:
        raise InputError(f"{file}: an ArduPilot log without messages that have a time")
    return Tables(file, tables)


def _check_lengths(file: Path) -> None:
    """Raise if a format states a message length of zero; the search for the next message would not end."""
    with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        at = raw.find(_FORMAT)
        while at >= 0:
            if raw[at + 4 : at + 5] and raw[at + 4] <= _HEAD:
                raise InputError(
                    f"{file}: byte {at}: expected messages of over {_HEAD} bytes, found {raw[at + 4]}"
                )
            at = raw.find(_FORMAT, at + 1)


def _tables(file: Path, raw: Any, form: Any, offsets: Any, structs: Mapping[str, Any]) -> list[Table]:
    """Return the table of a message, or one for each of its instances."""
    clock = next((name for name in form.columns if name in CLOCKS), None)
    at = np.asarray(offsets, dtype=np.int64)
    at = at[at + form.len <= len(raw)]
    if clock is None or not at.size:
        return []
    places: dict[str, tuple[int, str, float]] = {}
    here = _HEAD
    for name, kind in zip(form.columns, form.format, strict=False):
        code, scale, _ = structs[kind]
        if not code.endswith("s"):
            places[name] = (here, code, scale or 1.0)
        here += struct.calcsize(f"<{code}")
    if here > form.len or clock not in places:
        return []
    units = {
        name: unit
        for name in places
        if (unit := unit_of(str(form.get_unit(name) or "") if form.units else ""))
    }
    if form.instance_field not in places:
        return [_table(file, raw, str(form.name), clock, at, places, units)]
    instance = _decoded(raw, at, *places[form.instance_field])
    return [
        _table(file, raw, f"{form.name}[{int(k)}]", clock, at[instance == k], places, units)
        for k in np.unique(instance)
    ]


def _table(
    file: Path, raw: Any, topic: str, clock: str, at: Any, places: Mapping[str, Any], units: Mapping[str, str]
) -> Table:
    def load(names: Sequence[str]) -> dict[str, Any]:
        return {name: _decoded(raw, at, *places[name.rpartition("/")[2]]) for name in names}

    stated = {f"{topic}/{name}": unit for name, unit in units.items()} | {f"{topic}/{clock}": CLOCKS[clock]}
    return Table(
        file, topic, [f"{topic}/{name}" for name in places], len(at), load, f"{topic}/{clock}", stated
    )


def _decoded(raw: Any, at: Any, offset: int, code: str, scale: float) -> Any:
    """Return one field of all messages that begin at the given offsets."""
    kind = np.dtype(f"<{code}")
    part = raw[(at + offset)[:, None] + np.arange(kind.itemsize)]
    values = np.ascontiguousarray(part).view(kind)[:, 0]
    if kind.kind == "u" and kind.itemsize == 8:
        return values.astype(np.int64)
    return values if scale == 1.0 else values * scale


def unit_of(label: str) -> str:
    """Return the unit for the label of one in a log, or an empty text if there is no valid unit."""
    return unit_or_none(_UNITS.get(label, label))
