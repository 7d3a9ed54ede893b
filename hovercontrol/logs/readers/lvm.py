"""LabVIEW measurement files (.lvm), read by lvm-read: ``time`` and the channels of each segment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none


def lvm(file: Path) -> Tables:
    """Open a measurement; segments after the first have ``segment1/`` before their names.

    Raises
    ------
    InputError
        If lvm-read is missing, or the file is damaged or contains no numbers.
    """
    module = library(file, "lvm_read", "LVM files", "logs-all", package="lvm-read")
    with faults(file, "LVM"):
        found = module.read(str(file), read_from_pickle=False, dump_file=False)
        segments = [found[k] for k in range(int(found["Segments"]))]
        tables = [_table(file, k, segment) for k, segment in enumerate(segments) if len(segment["data"])]
    if not tables:
        raise InputError(f"{file}: an LVM file without numbers")
    return Tables(file, tables)


def _table(file: Path, number: int, segment: Any) -> Table:
    data = np.atleast_2d(np.asarray(segment["data"], dtype=float))
    count = int(segment["Channels"])
    names = [str(name) for name in segment["Channel names"]]
    prefix = f"segment{number}/" if number else ""
    several = data.shape[1] >= 2 * count and str(segment.get("X_Columns", "")).strip() == "Multi"
    has_time = data.shape[1] > count
    columns: dict[str, Any] = {}
    if has_time:
        columns["time"] = data[:, 0]
    else:
        step, start = (float(np.ravel(segment[key])[0]) for key in ("Delta_X", "X0"))
        columns["time"] = start + step * np.arange(len(data))
    for k in range(count):
        name = names[k + has_time] if len(names) > count and names[0] == "X_Value" else names[k]
        columns[name or f"channel{k}"] = data[:, 2 * k + 1] if several else data[:, k + has_time]
    columns = {f"{prefix}{name}": values for name, values in columns.items()}
    stated = np.ravel(segment.get("Y_Unit_Label", [])).tolist()
    units = {
        name: unit
        for name, text in zip(list(columns)[1:], stated, strict=False)
        if (unit := unit_or_none(str(text)))
    }
    clock = f"{prefix}time"

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {name: columns[name] for name in names}

    return Table(file, f"segment {number}", list(columns), len(data), load, clock, units | {clock: "s"})
