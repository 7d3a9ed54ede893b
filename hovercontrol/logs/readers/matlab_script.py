"""The vectors of the variables of a MATLAB file, read by mat-io; its `contents` are run by :mod:`.apart`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

WIDEST = 64
"""Columns of a matrix that are named one by one."""


def contents(file: str) -> tuple[tuple[list[str], dict[str, str]], dict[str, Any]]:
    """Return the variables, and the units that are stated; vectors by name."""
    from matio import load_from_mat

    return vectors_of(load_from_mat(file, add_table_attrs=True))


def vectors_of(variables: dict[str, Any]) -> tuple[tuple[list[str], dict[str, str]], dict[str, Any]]:
    """Return the variables, and the units that are stated; vectors by name, those inside structs, too."""
    units: dict[str, str] = {}
    names = [name for name in variables if not name.startswith("__")]
    found = {key: values for name in names for key, values in _vectors(name, variables[name], units)}
    return (names, units), found


def _vectors(name: str, value: Any, units: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield the numeric vectors of a variable by name, including those inside structs; fill in `units`."""
    if hasattr(value, "columns"):  # a table or a timetable
        yield from _frame(name, value, units)
    elif isinstance(value, np.ndarray) and value.dtype.names:
        yield from _fields(name, value, units)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.size <= WIDEST:  # cells
        for k, one in enumerate(value.flat):
            yield from _vectors(name if value.size == 1 else f"{name}({k + 1})", one, units)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "m":
        units[name] = "s"
        yield name, _seconds(value.ravel())
    elif isinstance(value, np.ndarray) and value.dtype.kind == "M":
        units[name] = "ns"
        yield name, value.ravel().astype("datetime64[ns]").astype(np.int64)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and max(value.shape, default=0) > 1:
        yield from _columns(name, value)


def _fields(name: str, value: Any, units: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield the vectors in a struct or an array of structs."""
    for key in value.dtype.names:
        each = [one[key] for one in value.flat]
        if len(each) > 1 and all(_is_scalar(one) for one in each):
            yield f"{name}.{key}", np.array([np.asarray(one).item() for one in each], dtype=float)
        elif len(each) <= WIDEST:
            for k, one in enumerate(each):
                yield from _vectors(f"{name if len(each) == 1 else f'{name}({k + 1})'}.{key}", one, units)


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
            if k < len(stated):
                units[f"{name}.{column}"] = str(stated[k])


def _is_scalar(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in "biuf"


def _seconds(values: Any) -> Any:
    return np.where(np.isnat(values), np.nan, values / np.timedelta64(1, "ns") / 1e9)
