"""MDF (ASAM, versions 3 and 4), read by asammdf: one table per channel group, on its master channel.

Samples whose invalidation bit is set are missing. Labels of raw values are read by :mod:`.labels`, frames of
CAN by the database beside the file (:mod:`.can`).
"""

from __future__ import annotations

import weakref
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import mdf_script
from hovercontrol.logs.readers.apart import Apart
from hovercontrol.logs.readers.can import EXTENDED, Frames, Key, Numbers, decoded
from hovercontrol.logs.readers.labels import labelled
from hovercontrol.logs.readers.tables import Table, Tables, faults, unit_or_none

LARGEST_RATIO = 1032
"""Largest ratio of data to compressed data (deflate, RFC 1951: 258 bytes by two bits)."""


def mdf(file: Path) -> Tables:
    """Open a measurement; channels keep their names, or ``group/name`` if two groups have the same name.

    Raises
    ------
    InputError
        If asammdf is missing, or the file is damaged or contains no channel.
    """
    with faults(file, "MDF"):
        library = Apart(file, mdf_script, "asammdf", "MDF files", "logs")
        found, _ = library.call("structure", str(file))
        for k, group in enumerate(found):
            if group["rows"] * group["width"] > LARGEST_RATIO * file.stat().st_size:
                raise InputError(
                    f"{file}: group {k} states {group['rows']:,} rows of {group['width']:,} bytes: damaged"
                )
        bus = [k for k, group in enumerate(found) if _is_bus(group)]
        groups = [_Group(library, k, group) for k, group in enumerate(found) if k not in bus]
        for k, own in enumerate(groups):
            if any(other.name == own.name for other in groups[:k]):
                own.name = f"{own.name}[{own.number}]"
        shared = Counter(name for own in groups for name in own.channels)
        tables = [own.table(file, {n for n in shared if shared[n] > 1}) for own in groups]
    tables = [table for table in tables if table.rows and len(table.header) > 1]
    try:
        full = [k for k in bus if found[k]["rows"] and "CAN_DataFrame.ID" in found[k]["all"]]
        tables += decoded(file, lambda numbers: (_frames(library, full, numbers), "")) if bus else []
    except InputError as error:
        if not tables:
            raise
        tables[0].said = str(error).removeprefix(f"{file}: ")
    if not tables:
        raise InputError(f"{file}: an MDF file without channels of numbers")
    return Tables(file, tables)


class _Group:
    """A group of channels, with their position in the file by name."""

    def __init__(self, library: Apart, number: int, about: Mapping[str, Any]) -> None:
        self.library, self.number, self.about = library, number, about
        self.name = about["name"] or f"group{number}"
        self.channels = {name: k for name, k, _ in about["channels"]}
        self.units = {name: unit for name, _, text in about["channels"] if (unit := unit_or_none(text))}
        self.said: dict[str, str] = {}

    def table(self, file: Path, shared: set[str]) -> Table:
        """Return the group's table; names in `shared` occur in several groups.

        MDF 4.1, channel block: cn_sync_type 1 is time, 2 an angle, 3 a distance, 4 an index. In MDF 3 a
        master is always time.
        """
        called = {(f"{self.name}/{name}" if name in shared else name): k for name, k in self.channels.items()}
        short = dict(zip(called, self.channels, strict=True))
        units = {name: self.units[short[name]] for name in called if short[name] in self.units}
        if self.about["timed"]:
            master, clock, said = f"{self.name}/time", f"{self.name}/time", ""
            units[master] = "s"
        else:
            name = self.about["master"]
            master, clock, said = f"{self.name}/{name}", "", f"its master channel {name!r} is not a time"
            units |= {master: unit} if (unit := unit_or_none(self.about["unit"])) else {}

        def load(names: Sequence[str]) -> dict[str, Any]:
            about, arrays = self.library.call("values", self.number, [called.get(name) for name in names])
            found = {
                name: self._values(
                    name, about[n], arrays[f"{n}"], arrays.get(f"{n} raw"), arrays.get(f"{n} invalid")
                )
                for n, name in enumerate(names)
            }
            own.said = "; ".join([*filter(None, [said]), *self.said.values()])
            return found

        rows = self.about["rows"]
        table = Table(file, self.name, [master, *called], rows, load, clock, units, said)
        own = weakref.proxy(table)  # no circle: the process ends with the last table
        return table

    def _values(self, name: str, about: Mapping[str, Any], values: Any, raw: Any, invalid: Any) -> Any:
        """Return the numbers of a channel: labels as they mean, invalid samples missing."""
        if raw is not None:
            values, said = labelled(raw, values, about["labels"], about["bits"], scaled=about["scaled"])
            if said:
                self.said[name] = f"labels of {name}: {', '.join(said)}"
        values = values.astype(np.uint8) if values.dtype.kind == "b" else values
        values = values.astype(values.dtype.newbyteorder("="))
        if len(values) != self.about["rows"]:
            raise ValueError(f"channel {name!r} has {len(values):,} of {self.about['rows']:,} samples")
        return values if invalid is None else np.where(invalid, np.nan, values)


def _is_bus(group: Mapping[str, Any]) -> bool:
    """Return whether a group has frames of CAN (ASAM MDF, Bus Logging)."""
    return not {"CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"}.isdisjoint(group["all"])


def _frames(library: Apart, groups: Sequence[int], numbers: Numbers) -> dict[Key, Frames]:
    """Return the frames in groups of a measurement whose arbitration ids are known."""
    pieces: dict[Key, list[Frames]] = {}
    for group in groups:
        _, part = library.call("frames", group)
        ids, data = part["ids"].astype(np.int64), part["data"]
        wide = part["extended"] > 0 if "extended" in part else ids >= EXTENDED
        ids = ids % EXTENDED + np.where(wide, EXTENDED, 0)
        lengths = part.get("lengths", np.full(len(ids), data.shape[1]))
        channels = part.get("channels", np.zeros(len(ids), dtype=int))
        found: dict[Key, list[int]] = {}
        for number in np.unique(ids).tolist():
            if message := numbers[number]:
                for channel in np.unique(channels[ids == number]).tolist():
                    found.setdefault((*message, str(channel)), []).append(number)
        for key, own in found.items():
            rows = np.isin(ids, own) & (channels == int(key[2]))
            pieces.setdefault(key, []).append(Frames(part["times"][rows], data[rows], lengths[rows]))
    return {key: _in_order(own) for key, own in pieces.items()}


def _in_order(pieces: Sequence[Frames]) -> Frames:
    width = max(piece.data.shape[1] for piece in pieces)
    times, lengths = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("times", "lengths"))
    data = np.concatenate([np.pad(p.data, ((0, 0), (0, width - p.data.shape[1]))) for p in pieces])
    order = np.argsort(times, kind="stable")
    return Frames(times[order], data[order], lengths[order])
