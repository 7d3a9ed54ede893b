"""Helpers on Arrow's types, shared by the readers."""

from __future__ import annotations

import pyarrow as pa

#: Exceptions that Arrow may raise on a damaged file.
DAMAGED = (pa.ArrowException, OSError, ValueError, TypeError, KeyError, OverflowError)


def is_number(kind: pa.DataType) -> bool:
    """Return whether an Arrow type is an integer, a float or a decimal."""
    kinds = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal)
    return any(check(kind) for check in kinds)
