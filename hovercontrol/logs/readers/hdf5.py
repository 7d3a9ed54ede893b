"""HDF5, read by h5py: datasets by their paths, ``log/x``; those of a group and of one length are a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import hdf5_script
from hovercontrol.logs.readers.apart import Apart
from hovercontrol.logs.readers.matlab import CLOCKS
from hovercontrol.logs.readers.tables import Table, Tables, faults, unit_or_none


def hdf5(file: Path) -> Tables:
    """Open a file; a column of a matrix is named ``path[0]``, a field of a compound ``path.field``.

    Raises
    ------
    InputError
        If h5py is missing, or the file is damaged or contains no vector of numbers.
    """
    with faults(file, "HDF5"):
        stated, vectors = Apart(file, hdf5_script, "h5py", "HDF5 files").call("contents", str(file))
    units = {name: unit for name, text in stated.items() if (unit := unit_or_none(text))}
    groups: dict[tuple[str, int], dict[str, Any]] = {}
    for name, values in vectors.items():
        groups.setdefault((name.rpartition("/")[0], len(values)), {})[name] = values
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


def _table(file: Path, name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    clocks = [n for n in columns if n.rpartition("/")[2].rpartition(".")[2].lower() in CLOCKS]

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {n: columns[n] for n in names}

    rows = len(next(iter(columns.values())))
    own = {n: units[n] for n in columns if n in units}
    return Table(file, name or "/", list(columns), rows, load, clocks[0] if clocks else "", own)
