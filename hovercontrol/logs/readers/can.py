"""CAN frames (BLF, ASC, TRC, candump), read by python-can and decoded by a database beside the file.

The database (DBC, KCD, SYM, ARXML) is the one in the folder of the log with its name, or the only one there.
A message is a table: ``Motion/Speed``. A message of J1939 is that of its parameter group (PGN), from any
source address; ``EEC1[0x03]`` tells the addresses apart if several send it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.labels import labelled, reserved
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

DATABASES = (".dbc", ".kcd", ".sym", ".arxml")

#: How the files begin, and python-can's reader of each.
_READERS = (
    (b"LOGG", "BLFReader"),
    (b";$FILEVERSION", "TRCReader"),
    (b"(", "CanutilsLogReader"),
    (b"", "ASCReader"),
)

EXTENDED = 2**31
"""Bit of an arbitration id of 29 bits, to tell it from one of 11 bits."""

_NULL = 0xFE
"""Source address that nobody has (SAE J1939-81); databases write it for any address."""

#: Identifies a table: the message, its source address (-1: not J1939), the channel.
Key = tuple[str, int, str]


@dataclass(frozen=True)
class Frames:
    """Frames of a message: times [ns, or floats in s], contents (n, width) as bytes, and their lengths."""

    times: Any
    data: Any
    lengths: Any


def can(file: Path) -> Tables:
    """Open a log of CAN frames; messages of several channels are ``NAME[channel]``.

    Raises
    ------
    InputError
        If python-can or cantools is missing, there is no database, or no frame is one of its messages.
    """
    module = library(file, "can", "CAN logs", "logs-all", package="python-can")
    with file.open("rb") as stream:
        start = stream.read(16)
        first = stream.read(256)
    reader = getattr(module, next(name for begin, name in _READERS if start.startswith(begin)))
    if reader is module.ASCReader and b"timestamps relative" in first:
        raise InputError(
            f"{file}: CAN frames: expected absolute timestamps, found those relative to the event before: "
            "export the log with absolute ones"
        )
    return Tables(file, decoded(file, lambda numbers: _frames(reader(str(file)), numbers)))


def decoded(file: Path, read: Callable[[Numbers], tuple[Mapping[Key, Frames], str]]) -> list[Table]:
    """Return the tables of frames, by the database beside the file.

    Parameters
    ----------
    read : callable
        Returns the frames whose number is known, and why the file ends early, if it does.

    Raises
    ------
    InputError
        If cantools is missing, there is no database, or no frame is one of its messages.
    """
    tools = library(file, "cantools", "CAN databases", "logs-all")
    base = database(file)
    with faults(file, "CAN log"):
        known = tools.database.load_file(str(base), strict=False)
        messages = {message.name: message for message in known.messages}
        frames, broken = read(Numbers(known.messages, tools.j1939.pgn_from_frame_id))
        tables = [
            _table(file, messages[key[0]], _label(key, frames), frames[key], j1939=key[1] >= 0)
            for key in sorted(frames)
        ]
    if not tables:
        raise InputError(f"{file}: expected messages of {base.name}, found none of them among the frames")
    tables[0].said = "; ".join(filter(None, [f"messages of {base.name}", broken]))
    return tables


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


class Numbers(dict[int, tuple[str, int] | None]):
    """The message and the source address (-1: not J1939) of an arbitration id, None if it is unknown."""

    def __init__(self, messages: Sequence[Any], group_of: Callable[[int], int]) -> None:
        super().__init__()
        self.group_of = group_of
        own = [m for m in messages if _is_j1939(m)]
        count = Counter(group_of(m.frame_id) for m in own)
        self.groups = {pgn: m.name for m in own if count[pgn := group_of(m.frame_id)] == 1}
        for m in messages:
            number = m.frame_id | (EXTENDED if m.is_extended_frame else 0)
            self[number] = (m.name, m.frame_id & 0xFF if m in own else -1)

    def __missing__(self, number: int) -> tuple[str, int] | None:
        name = self.groups.get(self.group_of(number - EXTENDED)) if number >= EXTENDED else None
        self[number] = (name, number & 0xFF) if name else None
        return self[number]


def _is_j1939(message: Any) -> bool:
    return message.is_extended_frame and (message.protocol == "j1939" or message.frame_id & 0xFF == _NULL)


def _label(key: Key, keys: Collection[Key]) -> str:
    """Return what tells the tables of a message apart: ``[channel]``, ``[0x03]``."""
    name, source, channel = key
    several = len({other[2] for other in keys}) > 1
    sources = len({other[1] for other in keys if other[0] == name}) > 1
    return (f"[{channel}]" if several else "") + (f"[0x{source:02X}]" if sources else "")


def _frames(reader: Any, numbers: Numbers) -> tuple[dict[Key, Frames], str]:
    """Return times [ns] and contents by message, and why the file ends early, if it does."""
    times: dict[Key, list[float]] = {}
    data: dict[Key, list[bytes]] = {}
    broken = ""
    try:
        for frame in reader:
            found = numbers[frame.arbitration_id | (EXTENDED if frame.is_extended_id else 0)]
            if found and not frame.is_error_frame and not frame.is_remote_frame:
                key = (*found, str(frame.channel))
                times.setdefault(key, []).append(frame.timestamp)
                data.setdefault(key, []).append(bytes(frame.data))
    except Exception as error:  # what python-can raises at a break
        if not times:
            raise
        broken = f"up to a break: {str(error)[:80]}"
    finally:
        reader.stop()
    return {
        key: Frames(np.rint(np.array(own) * 1e9).astype(np.int64), *_matrix(data[key]))
        for key, own in times.items()
    }, broken


def _matrix(data: list[bytes]) -> tuple[Any, Any]:
    lengths = np.array([len(one) for one in data])
    width = int(lengths.max())
    joined = b"".join(one.ljust(width, b"\0") for one in data)
    return np.frombuffer(joined, dtype=np.uint8).reshape(-1, width), lengths


def _table(file: Path, message: Any, label: str, frames: Frames, *, j1939: bool) -> Table:
    name = f"{message.name}{label}"
    signals = {f"{name}/{signal.name}": signal for signal in message.signals}
    units = {key: unit for key, s in signals.items() if (unit := unit_or_none(s.unit or ""))}
    clock = f"{name}/time"
    switch = next((s for s in message.signals if s.is_multiplexer), None)

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {key: frames.times if key == clock else values(signals[key]) for key in names}

    def values(signal: Any) -> Any:
        raw, known = _raw(frames, signal)
        found = raw * float(signal.scale) + float(signal.offset)
        scaled = (float(signal.scale), float(signal.offset)) != (1.0, 0.0)
        labels = [(float(k), float(k), str(text)) for k, text in (signal.choices or {}).items()]
        if j1939 and (unavailable := _unavailable(signal)):
            labels.append((*unavailable, "not available (J1939)"))
        found, said = labelled(raw, found, labels, int(signal.length), scaled=scaled)
        if said:
            table.said = "; ".join(filter(None, [table.said, f"labels of {signal.name}: {', '.join(said)}"]))
        if signal.multiplexer_ids and switch is not None and signal is not switch:
            known &= np.isin(_raw(frames, switch)[0], signal.multiplexer_ids)
        return np.where(known, found, np.nan)

    unit = "ns" if frames.times.dtype.kind == "i" else "s"
    table = Table(file, name, [clock, *signals], len(frames.times), load, clock, units | {clock: unit})
    return table


def _unavailable(signal: Any) -> tuple[float, float] | None:
    """Return the raw values that J1939 reserves, or None if the database says that they are measurements."""
    if signal.is_float or signal.is_signed or signal.length < 2:
        return None
    first, last = reserved(int(signal.length))
    stated = signal.minimum is not None and signal.maximum is not None and signal.maximum > signal.minimum
    if stated and signal.maximum >= first * float(signal.scale) + float(signal.offset):
        return None
    return first, last


def _raw(frames: Frames, signal: Any) -> tuple[Any, Any]:
    """Return the raw values of a signal, and which frames are long enough to have it.

    Big-endian bits go down within a byte, then to the next.
    """
    start, length = int(signal.start), int(signal.length)
    if signal.byte_order == "little_endian":
        places = [start + k for k in range(length)]
    else:
        first = 8 * (start // 8) + 7 - start % 8  # counted from the highest bit of the first byte
        places = [8 * (k // 8) + 7 - k % 8 for k in range(first, first + length)][::-1]
    found = np.zeros(len(frames.data), dtype=np.uint64)
    known = frames.lengths > max(places) // 8
    for k, bit in enumerate(places if known.any() else ()):
        column = frames.data[:, bit // 8]
        found |= ((column >> np.uint8(bit % 8)) & np.uint8(1)).astype(np.uint64) << np.uint64(k)
    if signal.is_float:
        return found.astype(f"<u{length // 8}").view(f"<f{length // 8}").astype(float), known
    if signal.is_signed:
        negative = (found >> np.uint64(length - 1)) == 1
        return found.astype(np.int64).astype(float) - np.where(negative, 2.0**length, 0.0), known
    return found.astype(float), known
