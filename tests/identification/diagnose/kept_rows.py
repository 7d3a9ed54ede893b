"""Rows of long tables, dataclasses of texts and numbers, kept in a CSV file as the runs end."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

Kind = TypeVar("Kind")


def append_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write rows at the end of a CSV file, which is made where it is not there."""
    if not rows:
        return
    fresh = not path.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(rows[0])])
        if fresh:
            writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def read_rows(path: Path, kind: type[Kind]) -> list[Kind]:
    """Return the rows of a CSV file as dataclasses; none where there is no file."""
    if not path.exists():
        return []
    kinds = {f.name: {"str": str, "int": int, "float": float}[str(f.type)] for f in fields(kind)}  # type: ignore[arg-type]
    with path.open(newline="", encoding="utf-8") as file:
        return [kind(**{k: kinds[k](v) for k, v in line.items()}) for line in csv.DictReader(file)]
