"""Labels of raw values, as CAN signals have them: ``0 = "Off"``, ``65535 = "SNA"``.

A label names a number or the lack of one. ``Off`` is the number that the signal's scale gives for its raw
value, and a label such as ``12.5`` is that number itself. ``SNA`` (signal not available), ``Error`` and the
like mean a missing sample.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from hovercontrol.logs.log import Floats

#: Words in labels of missing samples, in the languages of common databases.
_MISSING = re.compile(
    r"(?<![a-z])(s\W?n\W?a|n\W?/?a|nan|none|null|snv|timeout|lost)(?![a-z])"
    r"|(not|no|nicht|non|un|in)[\W_]*(signal|data|avail|valid|val\b|known|defin|determin|usable|plaus|"
    r"verf|bekannt|disponible|specif)"
    r"|err(?![a-z])|error|erreur|fault|fail|fehler|ung(ü|ue|u)ltig|invalid|missing|defe[ck]t|reserv",
    re.IGNORECASE,
)

_NUMBER = re.compile(r"\s*[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?\s*")


def is_missing(text: str) -> bool:
    """Return whether a label means that there is no value.

    Examples
    --------
    >>> [is_missing(text) for text in ("SNA", "Signal_not_available", "Error", "INVALID", "n/a")]
    [True, True, True, True, True]
    >>> [is_missing(text) for text in ("Off", "Standstill", "N", "Reverse", "Neutral", "Initialised")]
    [False, False, False, False, False, False]
    """
    return bool(_MISSING.search(text.replace("_", " ")))


def reserved(bits: int) -> tuple[float, float]:
    """Return the first and last raw value that are no measurement (SAE J1939-71, table 1).

    Of 8 bits and more those from 0xFB.., of fewer the largest.

    Examples
    --------
    >>> reserved(8), reserved(16), reserved(2)
    ((251.0, 255.0), (64256.0, 65535.0), (3.0, 3.0))
    """
    last = 2.0**bits - 1.0
    return (0xFB * 2.0 ** (bits - 8) if bits >= 8 else last), last


def labelled(
    raw: Any, values: Floats, labels: Iterable[tuple[float, float, str]], bits: int, *, scaled: bool
) -> tuple[Floats, list[str]]:
    """Return values with the numbers that labels mean, and a text on each label that occurs.

    Parameters
    ----------
    raw, values : ndarray (n,)
        Raw values, and the numbers that the scale of the signal gives for them.
    labels : iterable of (float, float, str)
        First and last raw value of a label, and its text.
    bits : int
        Size of the raw values.
    scaled : bool
        Whether the signal has a scale, thus is a measurement; else it is a list of states.

    Examples
    --------
    >>> raw = np.array([0, 20, 65535])
    >>> labelled(raw, 0.1 * raw, [(0, 0, "Off"), (65535, 65535, "SNA")], 16, scaled=True)
    (array([ 0.,  2., nan]), ["'Off' is 0 in 1 row", "'SNA' is missing in 1 row"])
    """
    values = np.array(values, dtype=float)
    said = []
    for low, high, text in labels:
        rows = (raw >= low) & (raw <= high)
        count = int(np.count_nonzero(rows))
        if not count:
            continue
        beyond = scaled and bits >= 8 and (low >= reserved(bits)[0] or low == -(2.0 ** (bits - 1)))
        if is_missing(text) or beyond:
            values[rows] = np.nan
        elif not scaled and _NUMBER.fullmatch(text):
            values[rows] = float(text)
        found = values[rows]
        meaning = "missing" if np.isnan(found[0]) else f"{found.min():.4g}"
        meaning += f" to {found.max():.4g}" if found.max() > found.min() else ""
        said.append(f"{text!r} is {meaning} in {count:,} row{'s' * (count > 1)}")
    return values, said
