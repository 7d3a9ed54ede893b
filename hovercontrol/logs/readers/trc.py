"""TRC of motion capture (OpenSim, Cortex): points ``marker.x`` in the unit of the header."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, unit_or_none


def trc(file: Path) -> Table:
    """Open a recording: a header of five lines, then rows of frame, time and coordinates.

    Raises
    ------
    InputError
        If the header or a row is damaged.
    """
    lines = file.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    try:
        about = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
        markers = [name.strip() for name in lines[3].split("\t")[2:] if name.strip()]
    except IndexError:
        raise InputError(f"{file}: a TRC file: expected a header of five lines") from None
    unit = unit_or_none(about.get("Units", "mm")) or "mm"
    names = ["frame", "time", *(f"{marker}.{axis}" for marker in markers for axis in "xyz")]
    rows = []
    for number, line in enumerate(lines[5:], 6):
        cells = line.split("\t")
        if not line.strip():
            continue
        try:
            row = [float(cell) if cell.strip() else np.nan for cell in cells[: len(names)]]
        except ValueError:
            if number == len(lines):  # the recorder lost its power
                break
            raise InputError(
                f"{file}: line {number}: expected numbers, found {line.strip()[:40]!r}"
            ) from None
        rows.append(row + [np.nan] * (len(names) - len(row)))
    if not rows or not markers:
        raise InputError(f"{file}: a TRC file: expected names of markers and rows of numbers, found none")
    data = dict(zip(names, np.array(rows).T, strict=True))
    units = dict.fromkeys(names[2:], unit) | {"time": "s"}
    table = Table.of(file, "points", data, "time", units)
    table.line, table.said = 7, f"TRC ({', '.join(markers[:8])}; lengths in {unit})"
    return table
