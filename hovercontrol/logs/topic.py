"""A table of a log file: its name, columns and clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hovercontrol.logs.readers.tables import Table, Tables
from hovercontrol.logs.source import Source, open_log


@dataclass(frozen=True)
class Topic:
    """A table of a file, as listed in the overview."""

    name: str
    header: list[str]
    rows: int
    clock: str
    source: Source

    def values(self, names: Sequence[str]) -> dict[str, Any]:
        """Return columns as floats."""
        parts: dict[str, list[Any]] = {name: [] for name in names}
        for batch in self.source.batches(list(names)):
            for name in names:
                column = batch.column(name).cast(pa.float64(), safe=False)
                parts[name].append(column.to_numpy(zero_copy_only=False))
        return {name: np.concatenate(found) if found else np.zeros(0) for name, found in parts.items()}

    @property
    def rate(self) -> float:
        """The usual rate [Hz]; NaN if there is no clock."""
        clock = self.clock
        if not clock or self.rows < 2:
            return float("nan")
        unit = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}.get(self.source.units.get(clock, "s"), 1.0)
        step = float(np.median(np.diff(self.values([clock])[clock]))) * unit
        return 1.0 / step if step > 0.0 else float("nan")


def topics_of(file: Path) -> list[Topic]:
    """Return the tables of a file.

    Raises
    ------
    InputError
        As :func:`hovercontrol.logs.source.open_log`.
    """
    opened = open_log(file)
    tables: Sequence[Table | Source] = opened.tables if isinstance(opened, Tables) else [opened]
    found = []
    for table in tables:
        if isinstance(table, Table):
            found.append(Topic(table.name, table.header, table.rows, table.clock, table))
        else:
            header = [name for name in table.header if name]
            clock = "time" if "time" in header else ""
            numbers = sorted(table.numeric() & set(header), key=header.index)
            rows = sum(batch.num_rows for batch in table.batches(numbers[:1]))
            found.append(Topic(file.name, numbers, rows, clock, table))
    return found
