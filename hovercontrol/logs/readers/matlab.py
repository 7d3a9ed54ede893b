"""MATLAB's .mat files up to version 7, read by SciPy: ``time``, ``log.x``; equally long vectors: a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults

#: Last parts of variable names that denote time.
CLOCKS = ("time", "t", "timestamp", "stamp", "tout")

WIDEST = 64
"""Columns of a matrix that are named one by one."""


def matlab(file: Path) -> Tables:
    """Open a file; a column of a matrix is named ``name[0]``, a field of a struct ``name.field``.

    Raises
    ------
    InputError
        If it is of version 7.3, damaged, or contains no vector.
    """
    with file.open("rb") as stream:
        if stream.read(16).startswith((b"MATLAB 7.3", b"\x89HDF")):
            raise InputError(
                f"{file}: expected a MATLAB file up to version 7, found version 7.3; "
                "save it with save(..., '-v7')"
            )
    from scipy.io import loadmat

    with faults(file, "MATLAB file"):
        found = loadmat(file, squeeze_me=False, struct_as_record=True)
        vectors = {
            name: values
            for variable, value in found.items()
            if not variable.startswith("__")
            for name, values in _vectors(variable, value)
        }
    groups: dict[tuple[str, int], dict[str, Any]] = {}
    lengths = {len(values) for values in vectors.values()}
    for name, values in vectors.items():  # all of one length are one table; else each struct has its own
        struct = name.partition(".")[0] if len(lengths) > 1 and "." in name else ""
        groups.setdefault((struct, len(values)), {})[name] = values
    if not groups:
        raise InputError(
            f"{file}: expected vectors of numbers, found {', '.join(list(found)[3:8]) or 'nothing'}"
        )
    return Tables(file, [_table(file, struct, columns) for (struct, _), columns in groups.items()])


def _table(file: Path, struct: str, columns: dict[str, Any]) -> Table:
    clocks = [name for name in columns if name.rpartition(".")[2].lower() in CLOCKS]
    clock = min(clocks, key=lambda name: CLOCKS.index(name.rpartition(".")[2].lower()), default="")
    rows = len(next(iter(columns.values())))
    name = struct or f"{rows} rows"
    return Table(file, name, list(columns), rows, lambda names: {n: columns[n] for n in names}, clock)


def _vectors(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the numeric vectors of a variable by name, including those inside structs."""
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names:
        for k, one in enumerate(value.flat) if value.size <= WIDEST else ():
            prefix = name if value.size == 1 else f"{name}({k + 1})"
            for key in value.dtype.names:
                yield from _vectors(f"{prefix}.{key}", one[key])
    elif value.dtype.kind in "biuf" and value.ndim == 2 and max(value.shape) > 1:
        numbers = value.astype(np.uint8) if value.dtype.kind == "b" else value
        numbers = numbers.astype(numbers.dtype.newbyteorder("="))
        if 1 in value.shape:
            yield name, numbers.ravel()
        elif min(value.shape) <= WIDEST:
            long = numbers if value.shape[0] >= value.shape[1] else numbers.T
            for k in range(long.shape[1]):
                yield f"{name}[{k}]", long[:, k]
