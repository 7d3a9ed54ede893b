"""HDF5, read by h5py: datasets by their paths, ``log/x``; those of a group and of one length are a table."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import hdf5_script
from hovercontrol.logs.readers.apart import Apart
from hovercontrol.logs.readers.matlab import CLOCKS
from hovercontrol.logs.readers.tables import Table, Tables, faults, unit_or_none

#: Names of the units of a time, and their sizes [ns].
_UNITS = (
    (r"nanosec(ond)?s?|ns", 1), (r"microsec(ond)?s?|us", 10**3), (r"millisec(ond)?s?|msecs?|ms", 10**6),
    (r"s(ec(ond)?s?)?", 10**9), (r"min(ute)?s?", 60 * 10**9), (r"h((ou)?rs?)?", 3600 * 10**9),
    (r"d(ays?)?", 86400 * 10**9),
)  # fmt: skip


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
    for name, text in stated.items():
        if (since := _since(text)) and name in vectors:
            vectors[name], units[name] = since[1] + _nanoseconds(vectors[name], since[0]), "ns"
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


def _since(text: str) -> tuple[int, int] | None:
    """Return unit [ns] and date [ns since 1970] of a time (CF conventions 1.11, 4.4), or None.

    Examples
    --------
    >>> _since("milliseconds since 1970-01-02 00:00:00Z"), _since("m")
    ((1000000, 86400000000000), None)
    """
    found = re.fullmatch(
        r"\s*(\w+)\s+since\s+(\d{4}-\d\d?-\d\d?)[T ]?([\d:.]*)\s*(?:Z|UTC|[+-]?0+:?0*)?\s*", text
    )
    unit = next((size for pattern, size in _UNITS if found and re.fullmatch(pattern, found[1].lower())), 0)
    if not found or not unit:
        return None
    try:
        year, month, number = map(int, found[2].split("-"))
        day = datetime(year, month, number, tzinfo=UTC)
        clock = [float(part) for part in found[3].split(":")] if found[3] else []
    except ValueError:
        return None
    seconds = sum(part * size for part, size in zip(clock, (3600, 60, 1), strict=False))
    return unit, round(day.timestamp()) * 10**9 + round(seconds * 1e9)


def _nanoseconds(values: Any, unit: int) -> Any:
    return (
        values.astype(np.int64) * unit
        if values.dtype.kind in "iu"
        else np.rint(values * unit).astype(np.int64)
    )


def _table(file: Path, name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    clocks = [n for n in columns if n.rpartition("/")[2].rpartition(".")[2].lower() in CLOCKS]
    return Table.of(file, name or "/", columns, clocks[0] if clocks else "", units)
