"""ArduPilot's logs as text (.log): ``ATT/Yaw``, instances ``IMU[0]/GyrZ``, times in us since boot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.ardupilot import ABOUT, CLOCKS, unit_of
from hovercontrol.logs.readers.tables import Table, Tables


def ardupilot_text(file: Path) -> Tables:
    """Open a log.

    Raises
    ------
    InputError
        If the file holds no message with a time.
    """
    formats, rows, damaged = _messages(file)
    labels = {chr(int(row[1])): row[2] for row in rows.pop("UNIT", []) if len(row) > 2 and row[1].isdigit()}
    numbers = {number: name for name, (number, _, _) in formats.items()}
    letters = {numbers.get(row[1], ""): row[2] for row in rows.pop("FMTU", []) if len(row) > 3}
    tables = []
    for name, own in sorted(rows.items()):
        columns = formats[name][2]
        clock = next((column for column in columns if column in CLOCKS), None)
        if name in ABOUT or clock is None:
            continue
        units = {
            column: unit
            for column, letter in zip(columns, letters.get(name, ""), strict=False)
            if (unit := unit_of(labels.get(letter, "")))
        }
        instance = letters.get(name, "").find("#")
        keys = sorted({row[instance] for row in own}) if instance >= 0 else [""]
        for key in keys:
            part = [row for row in own if row[instance] == key] if key else own
            tables.append(_table(file, f"{name}[{key}]" if key else name, columns, clock, units, part))
    if not tables:
        raise InputError(f"{file}: an ArduPilot log without messages that have a time")
    if damaged:
        tables[0].said = f"{damaged:,} damaged lines left out"
    return Tables(file, tables)


def _messages(file: Path) -> tuple[dict[str, tuple[str, str, list[str]]], dict[str, list[list[str]]], int]:
    """Return (number, types, columns) and the rows of each message, and the number of damaged lines."""
    formats: dict[str, tuple[str, str, list[str]]] = {"FMT": ("128", "", [])}
    rows: dict[str, list[list[str]]] = {}
    damaged = 0
    with file.open(encoding="latin-1") as stream:
        for line in stream:
            name, *cells = (cell.strip() for cell in line.split(","))
            if name == "FMT" and len(cells) > 4:
                formats[cells[2]] = (cells[0], cells[3], cells[4:])
            elif name in formats and (name in ABOUT or len(cells) == len(formats[name][2])):
                rows.setdefault(name, []).append(cells)
            elif name:
                damaged += 1
    return formats, rows, damaged


def _table(
    file: Path, topic: str, columns: Sequence[str], clock: str, units: dict[str, str], rows: list[list[str]]
) -> Table:
    text = [column for k, column in enumerate(columns) if not _is_number(rows[0][k])]
    header = [f"{topic}/{column}" for column in columns if column not in text]

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {name: values(columns.index(name.rpartition("/")[2])) for name in names}

    def values(k: int) -> Any:
        cells = [row[k] for row in rows]
        kind = np.int64 if all(cell.lstrip("-").isdigit() for cell in cells) else float
        return np.array([cell if _is_number(cell) else "nan" for cell in cells]).astype(kind)

    stated = {f"{topic}/{column}": unit for column, unit in units.items() if column not in text}
    stated[f"{topic}/{clock}"] = CLOCKS[clock]
    return Table(file, topic, header, len(rows), load, f"{topic}/{clock}", stated)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
