"""C3D of motion capture, read by ezc3d: points ``marker.x`` and analog channels, each at its own rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none


def c3d(file: Path) -> Tables:
    """Open a recording; a point that was not seen is missing.

    Raises
    ------
    InputError
        If ezc3d is missing, or the file is damaged or holds neither points nor analog channels.
    """
    module = library(file, "ezc3d", "C3D files", "logs-all")
    with faults(file, "C3D"):
        found = module.c3d(str(file))
        about, header = found["parameters"], found["header"]
        tables = [
            table
            for table in (
                _points(file, found["data"], about, header),
                _analog(file, found["data"], about, header),
            )
            if table
        ]
    if not tables:
        raise InputError(f"{file}: a C3D file without points and analog channels")
    return Tables(file, tables)


def _points(file: Path, data: Any, about: Any, header: Any) -> Table | None:
    points = np.asarray(data["points"])[:3]
    labels = [str(name).strip() for name in about["POINT"]["LABELS"]["value"]]
    unit = next(iter(about["POINT"].get("UNITS", {}).get("value", [])), "mm")
    columns = {
        f"{label or f'point{k}'}.{axis}": points[a, k]
        for k, label in enumerate(labels[: points.shape[1]])
        for a, axis in enumerate("xyz")
    }
    if not columns or not points.shape[2]:
        return None
    first, rate = int(header["points"]["first_frame"]), float(header["points"]["frame_rate"])
    units = dict.fromkeys(columns, unit_or_none(str(unit)) or "mm")
    return _table(file, "points", "time", columns, first / rate, rate, units)


def _analog(file: Path, data: Any, about: Any, header: Any) -> Table | None:
    analog = np.asarray(data["analogs"])
    if analog.size == 0:
        return None
    labels = [str(name).strip() for name in about["ANALOG"]["LABELS"]["value"]]
    stated = about["ANALOG"].get("UNITS", {}).get("value", [])
    columns = {label or f"analog{k}": analog[0, k] for k, label in enumerate(labels[: analog.shape[1]])}
    units = {
        name: unit for name, text in zip(columns, stated, strict=False) if (unit := unit_or_none(str(text)))
    }
    rate = float(header["analogs"]["frame_rate"])
    start = int(header["points"]["first_frame"]) / float(header["points"]["frame_rate"])
    return _table(file, "analog", "analog/time", columns, start, rate, units)


def _table(
    file: Path,
    name: str,
    clock: str,
    columns: dict[str, Any],
    start: float,
    rate: float,
    units: dict[str, str],
) -> Table:
    rows = len(next(iter(columns.values())))
    every = {clock: start + np.arange(rows) / rate, **columns}

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {n: every[n] for n in names}

    table = Table(file, name, list(every), rows, load, clock, {**units, clock: "s"})
    table.said = f"C3D ({name} at {rate:g} Hz)"
    return table
