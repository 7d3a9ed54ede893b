"""MAVLink telemetry logs (.tlog) of ground stations, with pymavlink's definitions: ``ATTITUDE/yaw``.

A frame follows its time of arrival [us since 1970]. Messages that say the time since boot have it, shifted to
the time of arrival, as their clock: delays of the radio link are not in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

#: Units of MAVLink's definitions that are multiples of others; pulses of servos stay in us.
_UNITS = {
    "degE7": (1e-7, "deg"), "degE5": (1e-5, "deg"), "cdegC": (0.01, ""), "deg/2": (2.0, "deg"),
    "m/s*5": (0.2, "m/s"), "m/s/s": (1.0, "m/s^2"), "us": (1.0, ""), "g": (1.0, ""), "mG": (1.0, ""),
}  # fmt: skip

_CLOCKS = {"time_boot_ms": 1000, "time_usec": 1, "time_us": 1}

RESTART = 10_000_000
"""Spread [us] of arrival less time since boot above which the vehicle was restarted."""

_START = 8
"""Bytes of the time of arrival before a frame."""


def mavlink(file: Path) -> Tables:
    """Open a log; messages of several senders or instances are ``NAME[system.component/instance]``.

    Raises
    ------
    InputError
        If pymavlink is missing, or the file holds no known message.
    """
    dialect = library(file, "pymavlink.dialects.v20.all", "MAVLink logs")
    raw = file.read_bytes()
    with faults(file, "MAVLink log"):
        groups, junk = _frames(raw, dialect.mavlink_map)
        data = np.frombuffer(raw, dtype=np.uint8)
        tables = []
        for number in sorted(groups, key=lambda key: str(dialect.mavlink_map[key].msgname)):
            form = dialect.mavlink_map[number]
            at, bad = _checked(data, np.array(groups[number], dtype=np.int64), int(form.crc_extra))
            junk += bad
            tables += [_table(file, data, form, own, label) for own, label in _senders(data, at, form)]
    if not tables:
        raise InputError(f"{file}: a MAVLink log without messages that are known")
    if junk:
        tables[0].said = "; ".join(filter(None, [tables[0].said, f"{junk:,} damaged frames left out"]))
    return Tables(file, tables)


def _frames(raw: bytes, known: Any) -> tuple[dict[int, list[int]], int]:
    """Return the places of the times of arrival before the frames, by number of the message."""
    groups: dict[int, list[int]] = {}
    at, end, junk, lost = 0, len(raw) - _START - 8, 0, False
    while at <= end:
        magic = raw[at + 8]
        if magic == 0xFD and at + 20 <= len(raw):
            size = 20 + raw[at + 9] + (13 if raw[at + 10] & 1 else 0)
            number = int.from_bytes(raw[at + 15 : at + 18], "little")
        elif magic == 0xFE:
            size, number = 16 + raw[at + 9], raw[at + 13]
        else:
            size = 0
        if not size or raw[at] or at + size > len(raw) or (lost and number not in known):
            junk, lost, at = junk + (not lost), True, at + 1
            continue
        if number in known:
            groups.setdefault(number, []).append(at)
        at, lost = at + size, False
    return groups, junk


def _checked(data: Any, at: Any, extra: int) -> tuple[Any, int]:
    """Return the places of the frames whose checksum is right, and the number of the others."""
    # CRC-16/MCRF4XX (X.25) over the frame without its first byte, and the byte `extra` of the definition.
    table = np.array([_crc_of_byte(k) for k in range(256)], dtype=np.uint16)
    two = data[at + 8] == 0xFD
    size = data[at + 9].astype(np.int64) + np.where(two, 9, 5)
    right = np.zeros(at.size, dtype=bool)
    for length in np.unique(size):
        rows = np.flatnonzero(size == length)
        crc = np.full(rows.size, 0xFFFF, dtype=np.uint16)
        for k in range(int(length)):
            crc = (crc >> 8) ^ table[(crc ^ data[at[rows] + 9 + k]) & 0xFF]
        crc = (crc >> 8) ^ table[(crc ^ extra) & 0xFF]
        after = at[rows] + 9 + length
        right[rows] = (data[after] == crc & 0xFF) & (data[after + 1] == crc >> 8)
    return at[right], int((~right).sum())


def _crc_of_byte(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ (0x8408 if byte & 1 else 0)
    return byte


def _senders(data: Any, at: Any, form: Any) -> Iterator[tuple[Any, str]]:
    """Yield the places of each sender's and instance's messages, and its label."""
    if not at.size:
        return
    two = data[at + 8] == 0xFD
    sender = np.where(two, data[at + 13], data[at + 11]) * 256.0 + np.where(two, data[at + 14], data[at + 12])
    fields = _fields(form)
    instance = np.zeros(at.size)
    if form.instance_field in fields:
        instance = _decoded(data, at, *fields[form.instance_field]).astype(float)
    senders, instances = np.unique(sender), np.unique(instance)
    for one in senders:
        for k in instances:
            rows = (sender == one) & (instance == k)
            label = [f"{int(one) // 256}.{int(one) % 256}"] if senders.size > 1 else []
            label += [f"{int(k)}"] if instances.size > 1 else []
            if rows.any():
                yield at[rows], f"[{'/'.join(label)}]" if label else ""


def _fields(form: Any) -> dict[str, tuple[int, str]]:
    """Return place within the payload and type of each number."""
    found: dict[str, tuple[int, str]] = {}
    place, codes = 0, form.native_format.decode().lstrip("<")
    for name, code, count in zip(form.ordered_fieldnames, codes, form.array_lengths, strict=True):
        size = np.dtype(f"<{code}").itemsize if code not in "cs" else 1
        for k in range(max(count, 1)):
            if code not in "cs":
                found[f"{name}[{k}]" if count else name] = (place, f"<{code}")
            place += size
    return found


def _decoded(data: Any, at: Any, place: int, code: str) -> Any:
    """Return one field of messages; MAVLink 2 leaves out zeros at the end of a payload."""
    two = data[at + 8] == 0xFD
    begin = at + np.where(two, 18, 14) + place
    size = data[at + 9].astype(np.int64)
    width = np.dtype(code).itemsize
    there = np.arange(place, place + width)[None, :] < size[:, None]
    index = np.minimum(begin[:, None] + np.arange(width), data.size - 1)
    part = np.where(there, data[index], np.uint8(0))
    return np.ascontiguousarray(part).view(np.dtype(code))[:, 0]


def _arrival(data: Any, at: Any) -> Any:
    return np.ascontiguousarray(data[at[:, None] + np.arange(_START)]).view(">i8")[:, 0].astype(np.int64)


def _table(file: Path, data: Any, form: Any, at: Any, label: str) -> Table:
    name = f"{form.msgname}{label}"
    fields, units = _fields(form), {}
    scales: dict[str, float] = {}
    for field in fields:
        stated = str(form.fieldunits_by_name.get(field.partition("[")[0], ""))
        scale, unit = _UNITS.get(stated, (1.0, unit_or_none(stated)))
        scales[field] = scale
        if unit:
            units[f"{name}/{field}"] = unit
    known = {f"{name}/time": _arrival(data, at)}
    clock, said = f"{name}/time", ""
    boot = next((field for field in _CLOCKS if field in fields), "")
    if boot:
        since = _decoded(data, at, *fields[boot]).astype(np.int64) * _CLOCKS[boot]
        late = known[clock] - since
        if since.any() and np.ptp(late) < RESTART:
            known[f"{name}/clock"], clock = since + late.min(), f"{name}/clock"
        else:
            said = f"{name}: {boot} starts again: time of arrival used"
    units |= dict.fromkeys(known, "us")
    measured = {field for field in fields if form.fieldunits_by_name.get(field.partition("[")[0])}

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {n: known[n] if n in known else values(n.removeprefix(f"{name}/")) for n in names}

    def values(field: str) -> Any:
        found = _decoded(data, at, *fields[field])
        found = found.astype(found.dtype.newbyteorder("="))
        if field in measured and found.dtype.kind in "iu" and found.dtype.itemsize in (2, 4):
            # the largest number of a measured field means that its value is unknown (common.xml, "invalid")
            unknown = found == np.iinfo(found.dtype).max
            found = np.where(unknown, np.nan, found) if unknown.any() else found
        if found.dtype.kind == "u" and found.dtype.itemsize == 8:
            found = found.astype(np.int64)
        return found if scales[field] == 1.0 else found * scales[field]

    header = [*known, *(f"{name}/{field}" for field in fields)]
    return Table(file, name, header, len(at), load, clock, units, said)
