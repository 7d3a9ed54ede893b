"""TSV exports of Qualisys Track Manager: bodies (6D) ``boat.x`` ... ``boat.yaw``, markers (3D) ``bow.x``.

Lengths are in mm and angles in degrees, as QTM exports them (QTM manual, TSV file formats). A body or marker
that was not found, with a negative residual or at 0, 0, 0, is missing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, faults

_ANGLES = ("roll", "pitch", "yaw")


def qualisys(file: Path) -> Table:
    """Open an export; without a column of time the rows are at its FREQUENCY.

    Raises
    ------
    InputError
        If the header lacks the names of bodies or markers, or the rows are damaged.
    """
    about, first, head = _header(file)
    titled = any(cell and not _is_number(cell) for cell in head)
    kind = " ".join(about.get("DATA_INCLUDED", []))
    owners = about.get("BODY_NAMES" if kind == "6D" else "MARKER_NAMES", [])
    if not owners:
        raise InputError(
            f"{file}: a TSV export of Qualisys: expected 6D or 3D with names of bodies or markers, "
            f"found DATA_INCLUDED {kind!r}"
        )
    with faults(file, "Qualisys TSV"):
        cells, broken = _numbers(file, first + titled)
        lead = [n.lower() for n in head[:2]] if titled and head[0].lower() == "frame" else []
        angles = [name.lower() for name in about.get("BODY_EULER_ANGLES", [])] or list(_ANGLES)
        own = list("xyz")
        if kind == "6D":
            own += [*angles, "residual", *(f"rot[{k}]" for k in range(9))]
        columns = _named(cells, lead, owners, own)
        if "time" not in columns:
            columns = {"time": np.arange(len(cells[0])) / float(about["FREQUENCY"][0]), **columns}
    units = {name: "mm" for name in columns if name.endswith((".x", ".y", ".z", ".residual"))}
    units |= {name: "deg" for name in columns if name.rpartition(".")[2] in angles and "." in name}
    said = f"Qualisys TSV ({kind} of {', '.join(owners[:8])}; mm, deg)"
    if broken:
        said += f"; {broken} rows of another width left out"
    return Table.of(file, "points", columns, "time", units | {"time": "s"}, said)


def _header(file: Path) -> tuple[dict[str, list[str]], int, list[str]]:
    """Return the values in the header by their keys, the number of its lines, and the cells below it."""
    about: dict[str, list[str]] = {}
    with file.open(encoding="utf-8-sig", errors="replace") as stream:
        for number, line in enumerate(stream):
            cells = [cell.strip() for cell in line.split("\t")]
            if not cells[0].isupper():
                return about, number, cells
            about[cells[0]] = [cell for cell in cells[1:] if cell]
    return about, 0, []


def _numbers(file: Path, first: int) -> tuple[list[Any], int]:
    """Return the columns that have a number, and how many rows have another number of cells."""
    broken = []

    def leave_out(row: Any) -> str:
        broken.append(row.number)
        return "skip"

    text = pyarrow.csv.read_csv(
        file,
        read_options=pyarrow.csv.ReadOptions(skip_rows=first, autogenerate_column_names=True),
        parse_options=pyarrow.csv.ParseOptions(delimiter="\t", invalid_row_handler=leave_out),
        convert_options=pyarrow.csv.ConvertOptions(null_values=["", "NULL", "NaN"]),
    )
    found = [column for column in text.columns if column.null_count < len(column)]
    return [np.array(column.cast("float64").to_numpy()) for column in found], len(broken)


def _named(cells: list[Any], lead: list[str], owners: list[str], own: list[str]) -> dict[str, Any]:
    """Return columns by name; those of bodies and markers that were not found are missing."""
    names = [*lead, *(f"{owner}.{part}" for owner in owners for part in own)]
    if len(names) != len(cells):
        raise ValueError(f"expected {len(names)} columns of {', '.join(owners[:8])}, found {len(cells)}")
    columns = dict(zip(names, cells, strict=True))
    for owner in owners:
        lost = np.all([columns[f"{owner}.{axis}"] == 0.0 for axis in "xyz"], axis=0)
        lost |= columns.get(f"{owner}.residual", np.zeros(1)) < 0.0
        for part in own:
            columns[f"{owner}.{part}"][lost] = np.nan
    return columns


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "NULL"
    return True
