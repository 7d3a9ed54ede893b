"""CAN frames (BLF, ASC, TRC, candump), read by python-can and decoded by a database beside the file.

The database (DBC, KCD, SYM, ARXML) is the one in the folder of the log with its name, or the only one there.
A message is a table: ``Motion/Speed``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.labels import labelled
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

DATABASES = (".dbc", ".kcd", ".sym", ".arxml")

#: How the files begin, and python-can's reader of each.
_READERS = (
    (b"LOGG", "BLFReader"),
    (b";$FILEVERSION", "TRCReader"),
    (b"(", "CanutilsLogReader"),
    (b"", "ASCReader"),
)

_MOST = 2**31
"""Bit of an arbitration id of 29 bits, to tell it from one of 11 bits."""


def can(file: Path) -> Tables:
    """Open a log of CAN frames; messages of several channels are ``NAME[channel]``.

    Raises
    ------
    InputError
        If python-can or cantools is missing, there is no database, or no frame is one of its messages.
    """
    module = library(file, "can", "CAN logs", "logs-all", package="python-can")
    tools = library(file, "cantools", "CAN databases", "logs-all")
    base = database(file)
    with file.open("rb") as stream:
        start = stream.read(16)
    reader = getattr(module, next(name for begin, name in _READERS if start.startswith(begin)))
    with faults(file, "CAN log"):
        known = tools.database.load_file(str(base), strict=False)
        messages = {m.frame_id | (_MOST if m.is_extended_frame else 0): m for m in known.messages}
        frames, broken = _frames(reader(str(file)), messages)
        channels = {channel for _, channel in frames}
        tables = [
            _table(file, messages[number], f"[{channel}]" if len(channels) > 1 else "", *each)
            for (number, channel), each in sorted(frames.items(), key=str)
        ]
    if not tables:
        raise InputError(f"{file}: expected messages of {base.name}, found none of them among the frames")
    tables[0].said = "; ".join(filter(None, [f"messages of {base.name}", broken]))
    return Tables(file, tables)


def database(file: Path) -> Path:
    """Return the database of CAN messages that belongs to a log.

    Raises
    ------
    InputError
        If there is none, or several of which none has the log's name.
    """
    found = sorted(f for f in file.resolve().parent.iterdir() if f.suffix.lower() in DATABASES)
    named = [f for f in found if f.stem == file.stem]
    if len(named or found) != 1:
        what = ", ".join(f.name for f in found[:5]) or "none"
        raise InputError(
            f"{file}: CAN frames: expected their database beside the file, {file.stem}.dbc, found {what}"
        )
    return (named or found)[0]


def _frames(reader: Any, messages: dict[int, Any]) -> tuple[dict[tuple[int, str], tuple[Any, Any]], str]:
    """Return times [ns] and contents by message and channel, and why the file ends early, if it does."""
    times: dict[tuple[int, str], list[float]] = {}
    data: dict[tuple[int, str], list[bytes]] = {}
    broken = ""
    try:
        for frame in reader:
            number = frame.arbitration_id | (_MOST if frame.is_extended_id else 0)
            if number in messages and not frame.is_error_frame and not frame.is_remote_frame:
                key = (number, str(frame.channel))
                times.setdefault(key, []).append(frame.timestamp)
                data.setdefault(key, []).append(bytes(frame.data))
    except Exception as error:  # what python-can raises at a break
        if not times:
            raise
        broken = f"up to a break: {str(error)[:80]}"
    finally:
        reader.stop()
    return {
        key: (np.rint(np.array(own) * 1e9).astype(np.int64), _matrix(data[key])) for key, own in times.items()
    }, broken


def _matrix(data: list[bytes]) -> Any:
    width = max(8, *(len(one) for one in data))
    return np.frombuffer(b"".join(one.ljust(width, b"\0") for one in data), dtype=np.uint8).reshape(-1, width)


def _table(file: Path, message: Any, label: str, times: Any, data: Any) -> Table:
    name = f"{message.name}{label}"
    signals = {f"{name}/{signal.name}": signal for signal in message.signals}
    units = {key: unit for key, s in signals.items() if (unit := unit_or_none(s.unit or ""))}
    clock = f"{name}/time"
    switch = next((s for s in message.signals if s.is_multiplexer), None)

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {key: times if key == clock else values(signals[key]) for key in names}

    def values(signal: Any) -> Any:
        raw = _raw(data, signal)
        found = raw * float(signal.scale) + float(signal.offset)
        scaled = (float(signal.scale), float(signal.offset)) != (1.0, 0.0)
        labels = [(float(k), float(k), str(text)) for k, text in (signal.choices or {}).items()]
        found, said = labelled(raw, found, labels, int(signal.length), scaled=scaled)
        if said:
            table.said = "; ".join(filter(None, [table.said, f"labels of {signal.name}: {', '.join(said)}"]))
        if signal.multiplexer_ids and switch is not None and signal is not switch:
            found[~np.isin(_raw(data, switch), signal.multiplexer_ids)] = np.nan
        return found

    table = Table(file, name, [clock, *signals], len(times), load, clock, units | {clock: "ns"})
    return table


def _raw(data: Any, signal: Any) -> Any:
    """Return the raw values of a signal; big-endian bits go down within a byte, then to the next."""
    start, length = int(signal.start), int(signal.length)
    if signal.byte_order == "little_endian":
        places = [start + k for k in range(length)]
    else:
        first = 8 * (start // 8) + 7 - start % 8  # counted from the highest bit of the first byte
        places = [8 * (k // 8) + 7 - k % 8 for k in range(first, first + length)][::-1]
    found = np.zeros(len(data), dtype=np.uint64)
    for k, bit in enumerate(places):
        found |= ((data[:, bit // 8] >> np.uint8(bit % 8)) & np.uint8(1)).astype(np.uint64) << np.uint64(k)
    if signal.is_float:
        return found.astype(f"<u{length // 8}").view(f"<f{length // 8}").astype(float)
    if signal.is_signed:
        negative = (found >> np.uint64(length - 1)) == 1
        return found.astype(np.int64).astype(float) - np.where(negative, 2.0**length, 0.0)
    return found.astype(float)
