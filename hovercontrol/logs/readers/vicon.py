"""CSV exports of Vicon (Nexus, Tracker): sections of segments, trajectories and devices with their own rates.

A section consists of its name, its rate [Hz], a row of objects, a row of axes, a row of units, and rows of
frame, subframe and numbers. Rotations are rotation vectors (RX, RY, RZ) or quaternions (with RW).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables

SECTIONS = ("Segments", "Trajectories", "Joints", "Model Outputs", "Devices", "Objects")
MOST_SUBFRAMES = 10_000
"""Samples of a device within one frame; a number above is none."""

_AXES = {"TX": "x", "TY": "y", "TZ": "z", "RX": "rx", "RY": "ry", "RZ": "rz", "RW": "qw"}


def vicon(file: Path) -> Table | Tables:
    """Open an export; columns are named ``time``, ``Body.x``, ``Body.rx``, ``Body:Marker.x``.

    Raises
    ------
    InputError
        If a section has no rate or no rows.
    """
    text = file.read_bytes().decode("utf-8-sig", errors="replace").replace("\r\n", "\n")
    starts = sorted(at for name in SECTIONS for at in _places(text, name))
    ends = [*starts[1:], len(text)]
    used: set[str] = set()
    tables = []
    for start, end in zip(starts, ends, strict=True):
        table = _section(file, text[start:end], text.count("\n", 0, start) + 1, used)
        tables.append(table)
        used.update(table.header)
    return tables[0] if len(tables) == 1 else Tables(file, tables)


def _places(text: str, name: str) -> list[int]:
    """Return the positions in the text at which sections of this name begin."""
    found, at = [], text.find(name)
    while at >= 0:
        end = text.find("\n", at)
        alone = not text[at + len(name) : end].strip(', "') if end >= 0 else False
        if alone and (at == 0 or text[at - 1] == "\n"):
            found.append(at)
        at = text.find(name, at + 1)
    return found


def _section(file: Path, text: str, line: int, used: set[str]) -> Table:
    section = text[: text.find("\n")].strip(', "')
    lines = text.split("\n", 5)
    try:
        rate = float(lines[1].split(",")[0])
        objects, axes, units = (next(csv.reader([row]), []) for row in lines[2:5])
    except (IndexError, ValueError, csv.Error):
        raise InputError(
            f"{file}: line {line + 1}: {section}: expected a rate [Hz], and rows of names and units"
        ) from None
    if not rate > 0.0 or len(lines) < 6 or not lines[5].strip():
        raise InputError(f"{file}: line {line + 1}: {section}: expected a positive rate and rows of numbers")
    names, stated = _columns(objects, axes, units)
    header = [f"{section}/{name}" if name in used else name for name in names]
    clock = f"{section}/time" if "time" in used else "time"
    data = _numbers(file, lines[5], len(axes), line + 5)
    rows = len(data[0])
    sub = data[1] if axes[1:2] and "sub" in axes[1].lower() else np.zeros(rows)
    subframes = 1 + int(np.max(sub, initial=0.0, where=np.isfinite(sub) & (sub < MOST_SUBFRAMES)))
    columns: dict[str, Any] = {clock: (data[0] * subframes + sub) / rate}
    columns |= {name: data[k] for k, name in enumerate(header) if name}
    own = {header[k]: unit for k, unit in stated.items()}
    table = Table.of(file, section, columns, clock, own, f"Vicon export ({section} at {rate:g} Hz)")
    table.line = line + 5
    return table


def _columns(
    objects: Sequence[str], axes: Sequence[str], units: Sequence[str]
) -> tuple[list[str], Mapping[int, str]]:
    """Return names and units of columns; an object's name is above the first of its columns."""
    names: list[str] = []
    stated: dict[int, str] = {}
    body = ""
    quaternion = "RW" in [axis.strip() for axis in axes]
    for k, axis in enumerate(cell.strip() for cell in axes):
        said = objects[k].strip() if k < len(objects) else ""
        body = said or body
        subject, _, part = body.rpartition(" ")[2].partition(":")
        short = subject if part in ("", subject) else f"{subject}:{part}"
        label = _AXES.get(axis, axis.lower())
        if quaternion and label.startswith("r"):
            label = f"q{label[1:]}"
        name = f"{short}.{label}" if k > 1 and short and axis else ("" if k < 2 else label)
        names.append("" if name in names else name)
        unit = units[k].strip() if k < len(units) else ""
        if unit and name and not label.startswith("q"):
            stated[k] = unit.replace("²", "^2").replace("°", "deg")
    return names, stated


def _numbers(file: Path, body: str, width: int, line: int) -> list[Any]:
    """Return the columns of a section's rows; blank or missing cells are NaN."""
    try:
        read = pyarrow.csv.ReadOptions(column_names=[str(k) for k in range(width)])
        convert = pyarrow.csv.ConvertOptions(column_types={str(k): pa.float64() for k in range(width)})
        table = pyarrow.csv.read_csv(io.BytesIO(body.encode()), read_options=read, convert_options=convert)
        return [column.to_numpy() for column in table.columns]
    except pa.ArrowException:
        pass
    rows = []
    for k, row in enumerate(csv.reader(body.splitlines())):
        if not any(cell.strip() for cell in row):
            continue
        try:
            cells = [float(cell) if cell.strip() else np.nan for cell in row[:width]]
        except ValueError:
            wrong = next(cell for cell in row if cell.strip() and not _is_number(cell))
            raise InputError(f"{file}: line {line + k}: expected a number, found {wrong[:40]!r}") from None
        rows.append(cells + [np.nan] * (width - len(cells)))
    return list(np.array(rows, dtype=float).T)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
