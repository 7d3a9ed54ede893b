"""MATLAB's .mat files: ``time``, ``log.x``; equally long vectors are a table.

SciPy reads files up to version 7, and mat-io those of version 7.3 (HDF5), and tables and timetables of all
versions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

#: Last parts of variable names that denote time.
CLOCKS = ("time", "t", "timestamp", "stamp", "tout")

WIDEST = 64
"""Columns of a matrix that are named one by one."""


def matlab(file: Path) -> Tables:
    """Open a file; a column of a matrix is named ``name[0]``, a field of a struct ``name.field``.

    In a file of one struct or timetable the fields are also known by their own names.

    Raises
    ------
    InputError
        If mat-io is missing and needed, or the file is damaged or contains no vector.
    """
    variables = {name: value for name, value in _variables(file).items() if not name.startswith("__")}
    units: dict[str, str] = {}
    with faults(file, "MATLAB file"):
        vectors = {
            name: values
            for variable, value in variables.items()
            for name, values in _vectors(variable, value, units)
        }
    groups: dict[tuple[str, int], dict[str, Any]] = {}
    lengths = {len(values) for values in vectors.values()}
    for name, values in vectors.items():  # all of one length are one table; else each struct has its own
        struct = name.partition(".")[0] if len(lengths) > 1 and "." in name else ""
        groups.setdefault((struct, len(values)), {})[name] = values
    if not groups:
        raise InputError(
            f"{file}: expected vectors of numbers, found {', '.join(list(variables)[:5]) or 'nothing'}"
        )
    longest = {struct: max(n for own, n in groups if own == struct) for struct, _ in groups}
    tables = [
        _table(
            file, struct if struct and n == longest[struct] else f"{struct} {n} rows".strip(), columns, units
        )
        for (struct, n), columns in groups.items()
    ]
    short = {name.partition(".")[2]: name for name in vectors} if len(variables) == 1 else {}
    return Tables(file, tables, {own: name for own, name in short.items() if own})


def _variables(file: Path) -> Mapping[str, Any]:
    """Return a file's variables: by SciPy, or by mat-io those of version 7.3, tables and timetables."""
    with file.open("rb") as stream:
        head = stream.read(520)
    hdf = b"\x89HDF\r\n" in (head[:6], head[512:518])  # with a header of 512 bytes or without
    newest = hdf or head.startswith(b"MATLAB 7.3")
    if newest:
        library(file, "h5py", "MATLAB files of version 7.3", "logs-all")
    found: Mapping[str, Any] = {} if newest else _by_scipy(file)
    opaque = any(type(value).__name__ == "MatlabOpaque" for value in found.values())
    if newest or opaque:
        what = "MATLAB files of version 7.3" if newest else "timetables and tables of MATLAB"
        module = library(file, "matio", what, "logs-all", package="mat-io")
        with faults(file, "MATLAB file"):
            found = module.load_from_mat(str(file), add_table_attrs=True)
    return found


def _by_scipy(file: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    with faults(file, "MATLAB file"):
        found: dict[str, Any] = loadmat(file, squeeze_me=False, struct_as_record=True)
    return found


def _table(file: Path, name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    clocks = [name for name in columns if name.rpartition(".")[2].lower() in CLOCKS]
    clock = min(clocks, key=lambda clock: CLOCKS.index(clock.rpartition(".")[2].lower()), default="")
    rows = len(next(iter(columns.values())))
    return Table(
        file,
        name,
        list(columns),
        rows,
        lambda names: {n: columns[n] for n in names},
        clock,
        {name: units[name] for name in columns if name in units},
    )


def _vectors(name: str, value: Any, units: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield the numeric vectors of a variable by name, including those inside structs; fill in `units`."""
    if hasattr(value, "columns"):  # a table or a timetable
        yield from _frame(name, value, units)
    elif isinstance(value, np.ndarray) and value.dtype.names:
        fields = {key: [one[key] for one in value.flat] for key in value.dtype.names}
        for key, each in fields.items():
            if len(each) > 1 and all(_is_scalar(one) for one in each):
                yield f"{name}.{key}", np.array([np.asarray(one).item() for one in each], dtype=float)
            elif len(each) <= WIDEST:
                for k, one in enumerate(each):
                    yield from _vectors(f"{name if len(each) == 1 else f'{name}({k + 1})'}.{key}", one, units)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "m":
        units[name] = "s"
        yield name, _seconds(value.ravel())
    elif isinstance(value, np.ndarray) and value.dtype.kind == "M":
        units[name] = "ns"
        yield name, value.ravel().astype("datetime64[ns]").astype(np.int64)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and max(value.shape, default=0) > 1:
        yield from _columns(name, value)


def _columns(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a vector, the columns of a matrix, or the elements of an array over its last dimension."""
    numbers = value.astype(np.uint8) if value.dtype.kind == "b" else value
    numbers = numbers.astype(numbers.dtype.newbyteorder("="))
    if numbers.ndim > 2:  # Simulink: the last dimension of signals.values is time
        long = np.moveaxis(numbers, -1, 0)
    else:
        long = numbers if numbers.shape[0] >= numbers.shape[-1] else numbers.T
    sizes = [size for size in long.shape[1:] if size > 1]
    long = long.reshape(len(long), *sizes)
    if int(np.prod(sizes)) <= WIDEST:
        for at in product(*map(range, sizes)):
            yield f"{name}[{','.join(map(str, at))}]" if sizes else name, long[(slice(None), *at)]


def _frame(name: str, frame: Any, units: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield the columns of a table; the row times of a timetable are the first."""
    if frame.index.dtype.kind in "mM":
        yield from _vectors(f"{name}.{frame.index.name or 'Time'}", frame.index.to_numpy(), units)
    stated = np.ravel(frame.attrs.get("varUnits", frame.attrs.get("VariableUnits", []))).tolist()
    for k, column in enumerate(frame.columns):
        values = frame[column].to_numpy()
        if values.dtype.kind in "biufmM" and len(values) > 1:
            yield from _vectors(f"{name}.{column}", values, units)
            unit = unit_or_none(str(stated[k])) if k < len(stated) else ""
            if unit:
                units[f"{name}.{column}"] = unit


def _is_scalar(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in "biuf"


def _seconds(values: Any) -> Any:
    return np.where(np.isnat(values), np.nan, values / np.timedelta64(1, "ns") / 1e9)
