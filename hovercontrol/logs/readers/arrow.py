"""Helpers on Arrow's types, shared by the readers."""

from __future__ import annotations

from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

#: Exceptions that Arrow may raise on a damaged file.
DAMAGED = (pa.ArrowException, OSError, ValueError, TypeError, KeyError, OverflowError)


def is_number(kind: pa.DataType) -> bool:
    """Return whether an Arrow type is an integer, a float, a decimal, a truth value or a duration."""
    kinds = (
        pa.types.is_integer,
        pa.types.is_floating,
        pa.types.is_decimal,
        pa.types.is_boolean,
        pa.types.is_duration,
    )
    return any(check(kind) for check in kinds)


def as_number(column: Any) -> Any:
    """Return a column with truth values as 0 and 1, and durations in seconds; other columns unchanged.

    Examples
    --------
    >>> as_number(pa.array([True, None, False])).to_pylist()
    [1.0, None, 0.0]
    >>> as_number(pa.array([1500, None], pa.duration("ms"))).to_pylist()
    [1.5, None]
    """
    if pa.types.is_boolean(column.type):
        return column.cast(pa.float64())
    if pa.types.is_duration(column.type):
        ns = column.cast(pa.duration("ns")).cast(pa.int64())
        return pc.divide(ns.cast(pa.float64(), safe=False), 1e9)
    return column
