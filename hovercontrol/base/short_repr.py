"""Text representation of results: their fields, with arrays as shape and range."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: Longest line, and most items of a sequence or mapping that are written.
WIDTH, ITEMS = 110, 8
#: Longest array that is written in full, and longest text of a dataclass within another.
FEW, NESTED = 6, 80


def short_repr(thing: Any) -> str:
    """Return ``Name(field=value, ...)`` of a dataclass, on one line or one for each field.

    A class takes it as its own: ``__repr__ = short_repr``.

    Parameters
    ----------
    thing : dataclass
        Fields that are empty or whose ``repr`` is false are left out.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Run:
    ...     time: np.ndarray
    ...     columns: dict[str, np.ndarray]
    ...     __repr__ = short_repr
    >>> Run(np.linspace(0, 9, 901), {"u": np.zeros((9, 901)), "name": np.arange(3.0)})
    Run(time=[901 from 0 to 9], columns={u: [9 x 901 from 0 to 0], name: [0 1 2]})
    """
    values = {f.name: getattr(thing, f.name) for f in fields(thing) if f.repr}
    parts = [f"{name}={short(value)}" for name, value in values.items() if not _empty(value)]
    name = type(thing).__qualname__
    line = f"{name}({', '.join(parts)})"
    if len(line) <= WIDTH:
        return line
    return f"{name}(\n" + "".join(f"    {cut(part)},\n" for part in parts) + ")"


def short(value: Any) -> str:
    """Return a short text of a value.

    Examples
    --------
    >>> short(np.eye(30) > 0), short(list(range(99)))
    ('[30 x 30, 3 % true]', '[0, 1, 2, 3, 4, 5, 6, 7, ... 91 more]')
    >>> short("a" * 99)
    "'aaaaaaaaaaaaaaaaaaaaaaaaaaaa...aaaaaaaa'"
    """
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, bool | np.bool_):
        return str(bool(value))
    if isinstance(value, float | np.floating):
        return f"{float(value):.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= 40 else f"{value[:28]}...{value[-8:]}")
    if isinstance(value, Mapping):
        return "{" + listed((f"{key}: {short(one)}" for key, one in value.items()), len(value)) + "}"
    if isinstance(value, list | tuple) and type(value).__repr__ in (list.__repr__, tuple.__repr__):
        text = listed(map(short, value), len(value))
        return f"[{text}]" if isinstance(value, list) else f"({text}{',' * (len(value) == 1)})"
    text = repr(value)
    if is_dataclass(value) and type(value).__repr__ is short_repr and (len(text) > NESTED or "\n" in text):
        return f"{type(value).__qualname__}(...)"
    return cut(text.split("\n", 1)[0])


def listed(texts: Iterable[str], count: int) -> str:
    """Return the first few texts, and the number of others."""
    first = [text for text, _ in zip(texts, range(ITEMS), strict=False)]
    more = f", ... {count - ITEMS} more" if count > ITEMS else ""
    return ", ".join(first) + more


def cut(text: str, longest: int = WIDTH - 6) -> str:
    """Return a text, cut to one line."""
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."


def _empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | Mapping | list | tuple) and not value)


def _array(values: np.ndarray[Any, Any]) -> str:
    if values.ndim == 1 and values.size <= FEW and values.dtype.kind in "biuf":
        return "[" + " ".join(f"{one:.5g}" if values.dtype.kind == "f" else str(one) for one in values) + "]"
    shape = " x ".join(map(str, values.shape)) or "1"
    if not values.size or values.dtype.kind not in "biuf":
        return f"[{shape}]"
    if values.dtype.kind == "b":
        return f"[{shape}, {100 * values.mean():.0f} % true]"
    kept = values[np.isfinite(values)]
    missing = values.size - kept.size
    ends = f" from {kept.min():.5g} to {kept.max():.5g}" if kept.size else ""
    return f"[{shape}{ends}{f', {missing} not finite' if missing else ''}]"
