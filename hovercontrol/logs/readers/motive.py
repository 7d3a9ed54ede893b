"""CSV exports of Motive (OptiTrack): rigid bodies and markers; lost samples are blank.

Rotations are quaternions, or Euler angles about axes of the body in the order of the header's Rotation Type
(NatNet SDK, Eul_FromQuat with EulOrdXYZr; Motive documentation, Data Export: CSV).

The header contains the properties of the take, then rows of types, names, IDs, kinds (Rotation, Position)
and axes.
"""

from __future__ import annotations

import csv
from pathlib import Path

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.csv import CsvSource
from hovercontrol.logs.readers.dialect import HEAD, Dialect

_LENGTHS = {"meters": "m", "centimeters": "cm", "millimeters": "mm", "inches": "inch", "feet": "ft"}


def motive(file: Path) -> CsvSource:
    """Open an export; columns are named ``time``, ``Body.x``, ``Body.qx`` or ``Body.rx``.

    Raises
    ------
    InputError
        If the rows of names are missing.
    """
    with file.open("rb") as stream:
        text = stream.read(8 * HEAD).decode("utf-8-sig", errors="replace")
    lines = text.splitlines()
    try:
        rows = list(csv.reader(lines[:40]))
    except csv.Error as error:
        raise InputError(f"{file}: not readable as a Motive export: {error}") from None
    take = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    at = next((k for k, row in enumerate(rows) if row and row[0].strip().lower() == "frame"), 0)
    heads = [row for row in rows[1:at] if any(cell.strip() for cell in row)]
    labels = {row[1].strip().lower(): row for row in heads if len(row) > 1 and row[1].strip()}
    if not labels and len(heads) > 2:  # rows without their titles: types, names, IDs ...
        labels = {"name": heads[1]}
    if not at or "name" not in labels or len(heads) < 2:
        raise InputError(
            f"{file}: a Motive export: expected rows of names above a row that begins with Frame"
        )
    axes, kinds, bodies = rows[at], heads[-1], labels["name"]
    length = _LENGTHS.get(take.get("Length Units", "Meters").strip().lower(), "m")
    width = max(len(rows[at + 1]) if len(rows) > at + 1 else 0, len(axes))
    quaternion = any(axis.strip() == "W" for axis in axes)
    names, units, seen = ["frame", "time"], ["", "s"], {"frame", "time"}
    for k in range(2, width):
        name, unit = _column(_cell(bodies, k), _cell(kinds, k), _cell(axes, k), quaternion, length)
        name = "" if name in seen else name
        seen.add(name)
        names.append(name)
        units.append(unit if name else "")
    source = CsvSource(
        file,
        Dialect(
            header=_line(lines, "frame"),
            first=_line(lines, "frame") + 1,
            names=tuple(names),
            units=tuple(units),
        ),
    )
    found = dict.fromkeys(name.rpartition(".")[0] for name in names if name.endswith(".x"))
    order = take.get("Rotation Type", "").strip().lower()
    source.euler = "" if quaternion else order if sorted(order) == ["x", "y", "z"] else "xyz"
    source.said = f"Motive export ({', '.join(list(found)[:8]) or 'no bodies'}; lengths in {length})"
    return source


def _cell(row: list[str], k: int) -> str:
    return row[k].strip() if k < len(row) else ""


def _column(body: str, kind: str, axis: str, quaternion: bool, length: str) -> tuple[str, str]:
    """Return name and unit of a column."""
    body = body.strip('"')
    if kind == "Rotation":
        return (f"{body}.q{axis.lower()}", "") if quaternion else (f"{body}.r{axis.lower()}", "deg")
    if kind == "Position":
        return f"{body}.{axis.lower()}", length
    return (
        (f"{body}.{kind.lower().replace(' ', '_')}", length if "Error" in kind else "")
        if body and kind
        else ("", "")
    )


def _line(lines: list[str], begin: str) -> int:
    """Return the line of the axes (rows and lines differ if a name contains a line break)."""
    return next(k for k, line in enumerate(lines) if line.lower().lstrip('"').startswith(begin))
