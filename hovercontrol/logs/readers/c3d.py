"""C3D of motion capture, read by ezc3d: points ``marker.x`` and analog channels, each at its own rate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import c3d_script
from hovercontrol.logs.readers.apart import Apart
from hovercontrol.logs.readers.tables import Table, Tables, faults, unit_or_none


def c3d(file: Path) -> Tables:
    """Open a recording; a point that was not seen is missing.

    Raises
    ------
    InputError
        If ezc3d is missing, or the file is damaged or holds neither points nor analog channels.
    """
    with faults(file, "C3D"):
        about, arrays = Apart(file, c3d_script, "ezc3d", "C3D files").call("contents", str(file))
        found = {**about, **arrays}
        tables = [table for table in (_points(file, found), _analog(file, found)) if table]
    if not tables:
        raise InputError(f"{file}: a C3D file without points and analog channels")
    return Tables(file, tables)


def _points(file: Path, found: dict[str, Any]) -> Table | None:
    points, labels = found["points"], found["labels"]
    columns = {
        f"{label or f'point{k}'}.{axis}": points[a, k]
        for k, label in enumerate(labels[: points.shape[1]])
        for a, axis in enumerate("xyz")
    }
    if not columns or not points.shape[2]:
        return None
    unit = unit_or_none(next(iter(found["units"]), "mm")) or "mm"
    rate = found["rate"]
    return _table(file, "points", "time", columns, found["first"] / rate, rate, dict.fromkeys(columns, unit))


def _analog(file: Path, found: dict[str, Any]) -> Table | None:
    analog, labels = found["analogs"], found["analog_labels"]
    if analog.size == 0:
        return None
    columns = {label or f"analog{k}": analog[0, k] for k, label in enumerate(labels[: analog.shape[1]])}
    stated = found["analog_units"]
    units = {name: unit for name, text in zip(columns, stated, strict=False) if (unit := unit_or_none(text))}
    start = float(found["first"]) / found["rate"]
    return _table(file, "analog", "analog/time", columns, start, found["analog_rate"], units)


def _table(
    file: Path,
    name: str,
    clock: str,
    columns: dict[str, Any],
    start: float,
    rate: float,
    units: dict[str, str],
) -> Table:
    times = start + np.arange(len(next(iter(columns.values())))) / rate
    said = f"C3D ({name} at {rate:g} Hz)"
    return Table.of(file, name, {clock: times, **columns}, clock, {**units, clock: "s"}, said)
