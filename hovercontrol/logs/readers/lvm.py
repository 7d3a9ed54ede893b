"""LabVIEW measurement files (.lvm), read by lvm-read: ``time`` and the channels.

Segments with the same channels follow each other in one table. If each channel has times of its own
(``X_Columns Multi``) that differ, each is a table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

#: Times and channels, by name and unit, of a part of a segment that has one clock.
_Part = tuple[Any, dict[tuple[str, str], Any]]


def lvm(file: Path) -> Tables:
    """Open a measurement; the channels of further tables have ``segment1/`` before their names.

    Raises
    ------
    InputError
        If lvm-read is missing, or the file is damaged or contains no numbers.
    """
    module = library(file, "lvm_read", "LVM files", "logs-all", package="lvm-read")
    with faults(file, "LVM"):
        found = module.read(str(file), read_from_pickle=False, dump_file=False)
        segments = [found[k] for k in range(int(found["Segments"]))]
        joined: dict[tuple[tuple[str, str], ...], list[_Part]] = {}
        for part in (part for s in segments if len(s["data"]) for part in _parts(s)):
            joined.setdefault(tuple(part[1]), []).append(part)
        tables = [_table(file, k, parts) for k, parts in enumerate(joined.values())]
    if not tables:
        raise InputError(f"{file}: an LVM file without numbers")
    return Tables(file, tables)


def _parts(segment: Mapping[str, Any]) -> list[_Part]:
    """Return the channels of a segment with their times, those with equal times together."""
    data = np.atleast_2d(np.asarray(segment["data"], dtype=float))
    names = [str(name) for name in segment["Channel names"]][: data.shape[1]]
    if "X_Value" not in names:  # X_Columns No
        names = ["X_Value", *names][: data.shape[1]] if data.shape[1] > int(segment["Channels"]) else names
    labels = [str(text) for text in np.ravel(segment.get("Y_Unit_Label", []))]
    parts: list[_Part] = []
    stated = None
    for k, name in enumerate(names):
        if name == "X_Value":
            stated = data[:, k] if np.isfinite(data[:, k]).any() else None
            continue
        if name == "Comment":
            continue
        at = k - 1 if names[0] == "X_Value" else k
        if stated is None:
            step, start = (np.ravel(segment[key]) for key in ("Delta_X", "X0"))
            times = start[min(at, start.size - 1)] + step[min(at, step.size - 1)] * np.arange(len(data))
        else:
            times = stated
        unit = unit_or_none(labels[at]) if at < len(labels) else ""
        part = next((p for p in parts if np.array_equal(p[0], times)), None)
        if part is None:
            parts.append(part := (times, {}))
        part[1][name or f"channel{k}", unit] = data[:, k]
    return parts


def _table(file: Path, number: int, parts: Sequence[_Part]) -> Table:
    prefix = f"segment{number}/" if number else ""
    clock = f"{prefix}time"
    columns = {clock: np.concatenate([times for times, _ in parts])}
    columns |= {
        f"{prefix}{name}": np.concatenate([own[name, unit] for _, own in parts]) for name, unit in parts[0][1]
    }
    units = {f"{prefix}{name}": unit for name, unit in parts[0][1] if unit}
    return Table.of(file, f"segment {number}", columns, clock, units | {clock: "s"})
