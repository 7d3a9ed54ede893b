"""The vectors of numbers in an HDF5 file, read by h5py; run by :mod:`.apart`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

WIDEST = 64
"""Columns of a matrix that are named one by one."""


def contents(file: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the units that are stated, and columns, by path."""
    import h5py

    units: dict[str, str] = {}
    columns: dict[str, Any] = {}
    with h5py.File(file, "r") as opened:
        found: list[tuple[str, Any]] = []
        opened.visititems(lambda name, item: found.append((name, item)) if hasattr(item, "shape") else None)
        for name, item in found:
            stated = item.attrs.get("units", item.attrs.get("unit", ""))
            unit = stated.decode("utf-8", "replace") if isinstance(stated, bytes) else str(stated)
            for column, values in _columns(name, item):
                columns[column], units[column] = values, unit
    return units, columns


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
