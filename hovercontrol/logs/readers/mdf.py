"""MDF (ASAM, versions 3 and 4), read by asammdf: one table per channel group, on its master channel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.core.units import dimension
from hovercontrol.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library


def mdf(file: Path) -> Tables:
    """Open a measurement; channels keep their names, or ``group/name`` if two groups have the same name.

    Raises
    ------
    InputError
        If asammdf is missing, or the file is damaged or contains no channel.
    """
    module = library(file, "asammdf", "MDF files")
    with faults(file, "MDF"):
        measured = module.MDF(str(file))
        groups = [_Group(measured, k, group) for k, group in enumerate(measured.groups)]
        shared = Counter(name for group in groups for name in group.channels)
        tables = [group.table(file, {n for n in shared if shared[n] > 1}) for group in groups]
    tables = [table for table in tables if table.rows and len(table.header) > 1]
    if not tables:
        raise InputError(f"{file}: an MDF file without channels of numbers")
    return Tables(file, tables)


class _Group:
    """A group of channels, with their position in the file by name."""

    def __init__(self, measured: Any, number: int, group: Any) -> None:
        self.measured, self.number = measured, number
        self.rows = int(group.channel_group.cycles_nr)
        said = str(getattr(group.channel_group, "acq_name", "") or "").strip()
        self.name = said or f"group{number}"
        master = measured.masters_db.get(number)
        self.channels = {
            c.name: k for k, c in enumerate(group.channels) if k != master and _is_number(c, measured)
        }
        units = {c.name: _unit(c) for c in group.channels}
        self.units = {name: units[name] for name in self.channels if units[name]}

    def table(self, file: Path, shared: set[str]) -> Table:
        """Return the group's table; names in `shared` occur in several groups."""
        called = {(f"{self.name}/{name}" if name in shared else name): k for name, k in self.channels.items()}
        own = dict(zip(called, self.channels, strict=True))
        clock = f"{self.name}/time"

        def load(names: Sequence[str]) -> dict[str, Any]:
            return {name: self._values(called.get(name)) for name in names}

        units = {name: self.units[own[name]] for name in called if own[name] in self.units} | {clock: "s"}
        return Table(file, self.name, [clock, *called], self.rows, load, clock, units)

    def _values(self, channel: int | None) -> Any:
        if channel is None:
            return np.asarray(self.measured.get_master(self.number))
        found = self.measured.get(group=self.number, index=channel, ignore_invalidation_bits=False)
        values = np.asarray(found.samples)
        if values.dtype.kind not in "biuf":
            values = np.asarray(self.measured.get(group=self.number, index=channel, raw=True).samples)
        values = values.astype(np.uint8) if values.dtype.kind == "b" else values
        return values.astype(values.dtype.newbyteorder("="))


def _is_number(channel: Any, measured: Any) -> bool:
    """Return whether a channel contains integers or floats; type codes differ between versions of MDF."""
    kind = int(channel.data_type)
    return kind <= 5 if str(measured.version) >= "4" else kind not in (7, 8)


def _unit(channel: Any) -> str:
    """Return the unit that the file states for a channel, or an empty text if there is no valid unit."""
    text = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "") or ""
    text = (text.decode("latin-1") if isinstance(text, bytes) else str(text)).strip("\0 ").replace("°", "deg")
    try:
        dimension(text)
    except InputError:
        return ""
    return text
