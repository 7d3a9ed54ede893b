"""Results as standard JSON: infinite values and NaN become null."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return a value that JSON can represent: arrays and tuples as lists, infinity and NaN as None.

    Examples
    --------
    >>> from pathlib import Path
    >>> plain({"a": np.array([1.0, np.inf]), "b": (np.int64(2), None), "c": Path("x/y")})
    {'a': [1.0, None], 'b': [2, None], 'c': 'x/y'}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def json_text(value: Any) -> str:
    """Return a value as indented JSON text with a final newline."""
    return json.dumps(plain(value), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
