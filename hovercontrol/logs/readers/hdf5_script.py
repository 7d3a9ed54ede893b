"""The vectors of numbers in an HDF5 file, read by h5py; run by :mod:`.apart`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

WIDEST = 64
"""Columns of a matrix that are named one by one."""

_PACKED = (("scale_factor", 1.0), ("add_offset", 0.0))


def contents(file: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the units that are stated, and columns, by path."""
    import h5py

    units: dict[str, str] = {}
    columns: dict[str, Any] = {}
    with h5py.File(file, "r") as opened:
        found: list[tuple[str, Any]] = []
        opened.visititems(lambda name, item: found.append((name, item)) if hasattr(item, "shape") else None)
        for name, item in found:
            stated = np.ravel(item.attrs.get("units", item.attrs.get("unit", ""))).tolist()[:1] or [""]
            unit = stated[0].decode("utf-8", "replace") if isinstance(stated[0], bytes) else str(stated[0])
            for column, values in _columns(name, item):
                columns[column], units[column] = _unpacked(values, item.attrs), unit
    return units, columns


def _unpacked(values: Any, attrs: Any) -> Any:
    """Return packed values as numbers (CF conventions 1.11, 2.5.1 and 8.1)."""
    missing = [np.ravel(attrs[name]) for name in ("_FillValue", "missing_value") if name in attrs]
    scale, offset = (np.ravel(attrs.get(name, [default]))[0] for name, default in _PACKED)
    lost = np.isin(values, np.concatenate(missing)) if missing else np.zeros(1, dtype=bool)
    if lost.any() or (scale, offset) != (1.0, 0.0):
        return np.where(lost, np.nan, values * float(scale) + float(offset))
    return values


def _columns(name: str, item: Any) -> Iterator[tuple[str, Any]]:
    kind = item.dtype
    if kind.names and item.ndim == 1:
        for key in kind.names:
            if kind[key].base.kind in "biuf" and len(kind[key].shape) < 2:
                values = _native(item[key])
                for k in range(values.shape[1]) if values.ndim > 1 else ():
                    yield f"{name}.{key}[{k}]", values[:, k]
                if values.ndim == 1:
                    yield f"{name}.{key}", values
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
