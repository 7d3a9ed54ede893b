"""Codes for missing values: -999, -1e30 ..., or any repeated number far outside the range of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log

POWERS = (1e20, 1e30, 1e37, 1e38)

#: Absolute values of common codes: nines, the largest 16-bit and 32-bit integers, and powers of ten.
CODES = (999.0, 9999.0, 99999.0, 999999.0, 32767.0, 32768.0, 2147483647.0, 2147483648.0, *POWERS)


@dataclass(frozen=True)
class CodeCriteria:
    """Thresholds for numbers that are codes for missing values.

    No published source: set by hand, tested in tests/logs/test_codes.py.

    Attributes
    ----------
    outside : float
        Minimum distance of one of :data:`CODES` from all other values, relative to their range.
    far : float
        The same for any other number.
    rows : int
        Minimum number of rows that contain the number, if it is not one of :data:`CODES`.
    distinct : int
        Minimum number of different other values in that case; a switch has only two.
    """

    outside: float = 0.1
    far: float = 10.0
    rows: int = 3
    distinct: int = 20


#: The values in use.
CODE = CodeCriteria()


def gap_code(values: Floats, *, any_number: bool = True) -> float | None:
    """Return the number that is a code for missing values in a column, or None.

    Parameters
    ----------
    values : ndarray, shape (n,)
    any_number : bool, optional
        Whether it may be a number that is not one of :data:`CODES`. Use False for commands: an idle command
        may be far from the other values.

    Examples
    --------
    >>> row = np.sin(np.arange(100.0))
    >>> row[40:45] = -999.0
    >>> gap_code(row), gap_code(np.sin(np.arange(100.0)))
    (-999.0, None)
    """
    if not values.size:
        return None
    for extreme in (np.fmin.reduce(values), np.fmax.reduce(values)):
        code = float(extreme)
        known = abs(code) in CODES
        if np.isfinite(code) and (known or (any_number and code)) and _stands_out(values, code, known):
            return code
    return None


def _stands_out(values: Floats, code: float, known: bool) -> bool:
    """Return whether an extreme value is far outside all others, apart from further codes among these."""
    same = values == code
    if not known and np.count_nonzero(same) < CODE.rows:
        return False
    others = np.isfinite(values) & ~same & ~(np.isin(np.abs(values), CODES) if known else same)
    low = float(np.min(values, where=others, initial=np.inf))
    high = float(np.max(values, where=others, initial=-np.inf))
    away = max(low - code, code - high)
    if low > high or not away > (CODE.outside if known else CODE.far) * (high - low):
        return False
    if known:
        return code < 0.0 or low < high  # a command may switch between 0 and 999
    return bool(np.unique(values[others]).size >= CODE.distinct)


def code_text(column: str, code: float, rows: int, first: str) -> str:
    """Return the message on a column with a code, without the name of the log."""
    where = f"in {rows} rows, the first {first}," if rows > 1 else first
    return f"column {column!r}: {code:g} {where} looks like a missing value: --missing {code:g}"


def code_faults(log: Log, names: Sequence[str]) -> list[str]:
    """Return one line for each column in which a number is a code for missing values.

    Parameters
    ----------
    names : sequence of str
        Columns to check. In columns other than pose and body velocities only :data:`CODES` are recognised.

    Examples
    --------
    >>> t = 0.02 * np.arange(100)
    >>> code_faults(Log("a", t, {"r": np.where(t < 0.1, -999.0, np.sin(t))}), ["r"])[0]
    "a: column 'r': -999 in 5 rows, the first at 0 s, looks like a missing value: --missing -999"
    """
    said = []
    for name in names:
        code = gap_code(log[name], any_number=name in (*POSE, *VELOCITY))
        if code is not None:
            at = np.flatnonzero(log[name] == code)
            said.append(f"{log.name}: {code_text(name, code, at.size, f'at {log.time[at[0]]:.6g} s')}")
    return said
