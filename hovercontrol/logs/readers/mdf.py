"""MDF (ASAM, versions 3 and 4), read by asammdf: one table per channel group, on its master channel.

Samples whose invalidation bit is set are missing. Labels of raw values are read by :mod:`.labels`, frames of
CAN by the database beside the file (:mod:`.can`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.can import EXTENDED, Frames, Key, Numbers, decoded
from hovercontrol.logs.readers.labels import labelled
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

LARGEST_RATIO = 1032
"""Largest ratio of data to compressed data (deflate, RFC 1951: 258 bytes by two bits)."""


def mdf(file: Path) -> Tables:
    """Open a measurement; channels keep their names, or ``group/name`` if two groups have the same name.

    Raises
    ------
    InputError
        If asammdf is missing, or the file is damaged or contains no channel.
    """
    module = library(file, "asammdf", "MDF files")
    with faults(file, "MDF"):
        measured = module.MDF(str(file))
        bus = [k for k, group in enumerate(measured.groups) if _is_bus(group)]
        groups = [_Group(file, measured, k, group) for k, group in enumerate(measured.groups) if k not in bus]
        for k, group in enumerate(groups):
            if any(other.name == group.name for other in groups[:k]):
                group.name = f"{group.name}[{k}]"
        shared = Counter(name for group in groups for name in group.channels)
        tables = [group.table(file, {n for n in shared if shared[n] > 1}) for group in groups]
    tables = [table for table in tables if table.rows and len(table.header) > 1]
    try:
        tables += decoded(file, lambda numbers: _frames(measured, bus, numbers)) if bus else []
    except InputError as error:
        if not tables:
            raise
        tables[0].said = str(error).removeprefix(f"{file}: ")
    if not tables:
        raise InputError(f"{file}: an MDF file without channels of numbers")
    return Tables(file, tables)


def _is_bus(group: Any) -> bool:
    """Return whether a group has frames of CAN (ASAM MDF, Bus Logging)."""
    return any(c.name in ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame") for c in group.channels)


def _frames(measured: Any, bus: Sequence[int], numbers: Numbers) -> tuple[dict[Key, Frames], str]:
    """Return the frames in groups of a measurement whose arbitration ids are known."""
    pieces: dict[Key, list[Frames]] = {}
    for group in bus:
        names = {c.name for c in measured.groups[group].channels}
        if "CAN_DataFrame.ID" not in names or not measured.groups[group].channel_group.cycles_nr:
            continue

        def part(name: str, group: int = group, names: set[str] = names) -> Any:
            full = f"CAN_DataFrame.{name}"
            return measured.get(full, group=group, raw=True).samples if full in names else None

        ids, extended, data = part("ID").astype(np.int64), part("IDE"), part("DataBytes")
        wide = ids >= EXTENDED if extended is None else np.asarray(extended) > 0
        ids = ids % EXTENDED + np.where(wide, EXTENDED, 0)
        lengths, channels = part("DataLength"), part("BusChannel")
        lengths = np.full(len(ids), data.shape[1]) if lengths is None else lengths
        channels = np.zeros(len(ids), dtype=int) if channels is None else channels
        times = np.asarray(measured.get_master(group))
        found: dict[Key, list[int]] = {}
        for number in np.unique(ids).tolist():
            if message := numbers[number]:
                for channel in np.unique(channels[ids == number]).tolist():
                    found.setdefault((*message, str(channel)), []).append(number)
        for key, own in found.items():
            rows = np.isin(ids, own) & (channels == int(key[2]))
            pieces.setdefault(key, []).append(Frames(times[rows], data[rows], lengths[rows]))
    return {key: _in_order(own) for key, own in pieces.items()}, ""


def _in_order(pieces: Sequence[Frames]) -> Frames:
    width = max(piece.data.shape[1] for piece in pieces)
    times, lengths = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("times", "lengths"))
    data = np.concatenate([np.pad(p.data, ((0, 0), (0, width - p.data.shape[1]))) for p in pieces])
    order = np.argsort(times, kind="stable")
    return Frames(times[order], data[order], lengths[order])


class _Group:
    """A group of channels, with their position in the file by name."""

    def __init__(self, file: Path, measured: Any, number: int, group: Any) -> None:
        self.measured, self.number = measured, number
        self.rows = int(group.channel_group.cycles_nr)
        width = int(group.channel_group.samples_byte_nr)
        if self.rows * width > LARGEST_RATIO * file.stat().st_size:
            raise InputError(f"{file}: group {number} states {self.rows:,} rows of {width:,} bytes: damaged")
        said = str(getattr(group.channel_group, "acq_name", "") or "").strip()
        self.name = said or f"group{number}"
        master = measured.masters_db.get(number)
        self.master = group.channels[master] if master is not None else None
        self.channels = {
            c.name: k for k, c in enumerate(group.channels) if k != master and _is_number(c, measured)
        }
        self.units = {c.name: unit for c in group.channels if (unit := _unit(c))}
        self.said: dict[str, str] = {}

    def table(self, file: Path, shared: set[str]) -> Table:
        """Return the group's table; names in `shared` occur in several groups."""
        called = {(f"{self.name}/{name}" if name in shared else name): k for name, k in self.channels.items()}
        own = dict(zip(called, self.channels, strict=True))
        units = {name: self.units[own[name]] for name in called if own[name] in self.units}
        if self._is_timed():
            master, clock, said = f"{self.name}/time", f"{self.name}/time", ""
            units[master] = "s"
        else:
            name = str(self.master.name) if self.master is not None else "index"
            master, clock, said = f"{self.name}/{name}", "", f"its master channel {name!r} is not a time"
            units |= {master: self.units[name]} if name in self.units else {}

        def load(names: Sequence[str]) -> dict[str, Any]:
            found = {name: self._values(name, called.get(name)) for name in names}
            table.said = "; ".join([*filter(None, [said]), *self.said.values()])
            return found

        table = Table(file, self.name, [master, *called], self.rows, load, clock, units, said)
        return table

    def _is_timed(self) -> bool:
        """Return whether the master channel is time, not an angle, a distance or an index.

        MDF 4.1, channel block: cn_sync_type 1 is time, 2 an angle, 3 a distance, 4 an index. In MDF 3 a
        master is always time.
        """
        return self.master is not None and getattr(self.master, "sync_type", 1) == 1

    def _values(self, name: str, channel: int | None) -> Any:
        if channel is None:
            return np.asarray(self.measured.get_master(self.number))
        where = {"group": self.number, "index": channel, "ignore_invalidation_bits": True}
        raw = self.measured.get(**where, raw=True)
        labels = list(_labels(raw.conversion))
        if labels:
            own = raw.conversion.referenced_blocks.get("default_addr")
            scaled = hasattr(own, "convert") and (getattr(own, "a", 0.0), getattr(own, "b", 0.0)) != (
                1.0,
                0.0,
            )
            numbers = own.convert(raw.samples) if hasattr(own, "convert") else raw.samples
            bits = int(self.measured.groups[self.number].channels[channel].bit_count)
            values, said = labelled(raw.samples, numbers, labels, bits, scaled=scaled)
            if said:
                self.said[name] = f"labels of {name}: {', '.join(said)}"
        else:
            values = np.asarray(self.measured.get(**where).samples)
            values = values if values.dtype.kind in "biuf" else np.asarray(raw.samples)
        values = values.astype(np.uint8) if values.dtype.kind == "b" else values
        values = values.astype(values.dtype.newbyteorder("="))
        invalid = raw.invalidation_bits
        if invalid is not None and np.any(invalid):
            values = np.where(np.asarray(invalid, dtype=bool), np.nan, values)
        return values


def _labels(conversion: Any) -> Iterator[tuple[float, float, str]]:
    """Yield first value, last value and text of each label of a conversion."""
    blocks = getattr(conversion, "referenced_blocks", None) or {}
    for k in range(len(blocks)):
        text = blocks.get(f"text_{k}")
        if not isinstance(text, bytes) or not text:
            continue
        at = getattr(conversion, f"val_{k}", getattr(conversion, f"param_val_{k}", None))  # MDF 4, MDF 3
        low, high = getattr(conversion, f"lower_{k}", at), getattr(conversion, f"upper_{k}", at)
        if low is not None and high is not None:
            yield float(low), float(high), text.decode("utf-8", errors="replace").strip("\0 ")


def _is_number(channel: Any, measured: Any) -> bool:
    """Return whether a channel contains integers or floats; type codes differ between versions of MDF."""
    kind = int(channel.data_type)
    return kind <= 5 if str(measured.version) >= "4" else kind not in (7, 8)


def _unit(channel: Any) -> str:
    """Return the unit that the file states for a channel, or an empty text if there is no valid unit."""
    text = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "") or ""
    return unit_or_none(text.decode("latin-1") if isinstance(text, bytes) else str(text))
