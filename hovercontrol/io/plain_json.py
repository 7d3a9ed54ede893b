"""Results as JSON that every reader accepts: numbers, texts, lists; what is infinite or no number is null."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return a value as JSON has it: arrays and tuples as lists, no infinity and no NaN.

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
    """Return a value as indented JSON text that ends with its line."""
    return json.dumps(plain(value), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
