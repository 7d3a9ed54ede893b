"""HDF5, read by h5py: datasets by their paths, ``log/x``; those of a group and of one length are a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.matlab import CLOCKS, WIDEST
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none


def hdf5(file: Path) -> Tables:
    """Open a file; a column of a matrix is named ``path[0]``, a field of a compound ``path.field``.

    Raises
    ------
    InputError
        If h5py is missing, or the file is damaged or contains no vector of numbers.
    """
    module = library(file, "h5py", "HDF5 files", "logs-all")
    groups: dict[tuple[str, int], dict[str, Any]] = {}
    units: dict[str, str] = {}
    with faults(file, "HDF5"), module.File(file, "r") as opened:
        found: list[tuple[str, Any]] = []
        opened.visititems(lambda name, item: found.append((name, item)) if hasattr(item, "shape") else None)
        for name, item in found:
            stated = item.attrs.get("units", item.attrs.get("unit", ""))
            unit = unit_or_none(stated.decode() if isinstance(stated, bytes) else str(stated))
            for column, values in _columns(name, item):
                groups.setdefault((name.rpartition("/")[0], len(values)), {})[column] = values
                if unit:
                    units[column] = unit
    if not groups:
        raise InputError(f"{file}: an HDF5 file without vectors of numbers")
    paths = [path for path, _ in groups]
    tables = [
        _table(file, path if paths.count(path) == 1 else f"{path} {rows} rows", columns, units)
        for (path, rows), columns in groups.items()
    ]
    full = [name for columns in groups.values() for name in columns]
    short = [name.rpartition("/")[2] for name in full]
    aliases = {own: name for own, name in zip(short, full, strict=True) if short.count(own) == 1}
    return Tables(file, tables, aliases)


def _columns(name: str, item: Any) -> Iterator[tuple[str, Any]]:
    kind = item.dtype
    if kind.names and item.ndim == 1:
        for key in kind.names:
            if kind[key].kind in "biuf":
                yield f"{name}.{key}", _native(item[key])
    elif kind.kind in "biuf" and item.ndim in (1, 2) and max(item.shape, default=0) > 1:
        if item.ndim == 1:
            yield name, _native(item[()])
        elif min(item.shape) <= WIDEST:
            values = _native(item[()])
            long = values if values.shape[0] >= values.shape[1] else values.T
            for k in range(long.shape[1]):
                yield f"{name}[{k}]" if long.shape[1] > 1 else name, long[:, k]


def _native(values: Any) -> Any:
    values = values.astype(np.uint8) if values.dtype.kind == "b" else values
    return values.astype(values.dtype.newbyteorder("="))


def _table(file: Path, name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    clocks = [n for n in columns if n.rpartition("/")[2].rpartition(".")[2].lower() in CLOCKS]

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {n: columns[n] for n in names}

    rows = len(next(iter(columns.values())))
    own = {n: units[n] for n in columns if n in units}
    return Table(file, name or "/", list(columns), rows, load, clocks[0] if clocks else "", own)
