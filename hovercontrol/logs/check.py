"""Checks of a log before it is used; each error names the line or the interval."""

from __future__ import annotations

import warnings
from collections.abc import Container
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.errors import InputError, shown
from hovercontrol.logs.codes import code_text, gap_code
from hovercontrol.logs.log import Floats, Log, Mask
from hovercontrol.logs.source import Source


@dataclass(frozen=True)
class PlausibleLimits:
    """Limits of plausible values in the log of a hovercraft.

    No published source: set by hand, tested in tests/logs/test_read.py.

    Attributes
    ----------
    turn : float
        Largest mean turn rate [rad/s]; a heading in degrees exceeds it easily.
    value : float
        Largest absolute value in any column.
    coarse : float
        Largest fraction of rows that repeat the time of the row before by mistakes of a logger; if there are
        more, the stamps are coarser than the rows.
    rate : float
        Largest rate of rows [Hz].
    """

    turn: float = 60.0
    value: float = 1e20
    coarse: float = 0.2
    rate: float = 1e5


Rows = NDArray[np.intp]

#: The values in use.
PLAUSIBLE = PlausibleLimits()

#: Days of 1970 and 2100 in Excel (from 30 December 1899), and in MATLAB's datenum (from the year 0).
SERIAL_DATES = ((25569.0, 73051.0), (719529.0, 767011.0))


def check_finite(file: str, source: Source, column: str, values: Floats) -> None:
    """Raise if a value is missing, NaN, infinite or huge; ``column`` is its name in the file."""
    check_size(file, source, column, values)
    _refuse(file, source, column, values, np.isnan(values))


def check_size(file: str, source: Source, column: str, values: Floats) -> None:
    """Raise if a value is infinite or huge, or all are missing; ``column`` is its name in the file."""
    if values.size and np.isnan(values).all():
        how = f" (read with {source.said})" if source.said else ""
        raise InputError(f"{file}: column {column!r} is empty: NaN in all {values.size} rows{how}")
    _refuse(file, source, column, values, np.abs(values) > PLAUSIBLE.value)


def _refuse(file: str, source: Source, column: str, values: Floats, wrong: Mask) -> None:
    """Raise if any value is wrong; the message names the first."""
    bad = np.flatnonzero(wrong)
    if not bad.size:
        return
    where, text = source.place(int(bad[0]), column)
    more = f" ({bad.size} such rows)" if bad.size > 1 else ""
    wanted = f"a number up to {PLAUSIBLE.value:g}" if np.isfinite(values[bad[0]]) else "a finite number"
    raise InputError(f"{file}: {where}, column {column!r}: expected {wanted}, found {shown(text)}{more}")


def check_codes(file: str, source: Source, column: str, values: Floats, *, any_number: bool) -> None:
    """Raise if a number is used as a code for missing values; ``column`` is its name in the file."""
    code = gap_code(values, any_number=any_number)
    if code is not None:
        at = np.flatnonzero(values == code)
        where = f"in {source.place(int(at[0]), column)[0]}"
        raise InputError(f"{file}: {code_text(column, code, at.size, where)}")


def check_time(file: str, source: Source, column: str, time: Floats, firsts: Rows, copies: Rows) -> None:
    """Raise if time repeats or runs backwards within a trial; ``column`` is its name in the file.

    ``firsts`` are the first rows of trials, ``copies`` the rows that are copies of the row before.
    """
    stuck = np.setdiff1d(np.flatnonzero(np.diff(time) <= 0), np.concatenate([firsts, copies]) - 1)
    if not stuck.size:
        return
    row = int(stuck[0]) + 1
    where, text = source.place(row, column)
    before = source.place(row - 1, column)[1]
    repeats = time[row] == time[row - 1]
    more = f" ({stuck.size} such rows)" if stuck.size > 1 else ""
    hint = "; other values differ: keep one of the rows" if repeats else ""
    if repeats and stuck.size > PLAUSIBLE.coarse * time.size:
        hint = "; it is coarser than the rows: is there a finer one? (--columns time=NAME)"
    raise InputError(
        f"{file}: {where}, column {column!r}: time {'repeats' if repeats else 'runs backwards'}: "
        f"expected more than {before}, found {text}{more}{hint}"
    )


def check_days(file: str, column: str, time: Floats, known: Container[str]) -> None:
    """Raise if a time is a serial date in days, as Excel and MATLAB count them from 1900 and from 0.

    In seconds its rows would be faster than ``PLAUSIBLE.rate``; in days they are not. A unit of ``time`` that
    is among the `known` ones is not doubted.
    """
    steps = np.diff(time)
    if "time" in known or not steps.size or not 0.0 < np.median(steps) < 1.0 / PLAUSIBLE.rate:
        return
    if any(low <= time[0] <= high for low, high in SERIAL_DATES):
        raise InputError(
            f"{file}: column {column!r}: {time[0]:.10g} with steps of {np.median(steps):.2g} looks like a "
            f"date in days (Excel, MATLAB): --columns time={column}:day (in seconds: time={column}:s)"
        )


def check_gaps(log: Log) -> None:
    """Warn of the gaps of a log, and raise if they are longer in total than the rest of the log."""
    gaps = [stop - start for start, stop in log.gaps]
    if not gaps:
        return
    left = sum(float(part.time[-1] - part.time[0]) for part in log.each_trial()) - sum(gaps)
    many = len(gaps) > 1
    count = f"{len(gaps)} gap{'s' * many} of {max(gaps):.3g} s{' at most' * many}"
    usual = f"the median interval between rows is {np.median(np.diff(log.time)):.3g} s"
    if sum(gaps) > left:
        raise InputError(
            f"{log.name}: {count}, {sum(gaps):.3g} s in total; {usual}, and only {left:.3g} s remain"
        )
    warnings.warn(f"{log.name}: {count}, bridged by the model; {usual}", stacklevel=3)


def check_heading(file: str, column: str, time: Floats, psi: Floats, r: Floats | None) -> None:
    """Raise if a heading is clearly in degrees; ``column`` is its name in the file.

    The heading counts as being in degrees if it jumps by a full circle of 360, turns faster than
    ``PLAUSIBLE.turn`` on average, or turns about 57 times (180/pi) as fast as the yaw rate ``r`` [rad/s] of
    the same log. If it agrees with the yaw rate in the first two cases, both are in degrees.
    """
    # Ratio of both turns over the log: sum |psi_k+1 - psi_k| / sum (|r_k+1 + r_k|/2) (t_k+1 - t_k).
    known = np.isfinite(psi) if r is None else np.isfinite(psi) & np.isfinite(r)
    time, psi, r = time[known], psi[known], r[known] if r is not None else None
    steps = np.abs(np.diff(psi))
    if not steps.size:
        return
    passed = np.maximum(np.diff(time), 0.0)  # where a trial begins time may jump back
    wrapped = bool(np.ptp(psi) <= 360.0 and np.any(steps > 300.0) and np.median(steps) < 60.0)
    whirling = bool(steps.sum() > PLAUSIBLE.turn * passed.sum() and not wrapped)
    ratio, turned = 1.0, np.zeros(1)
    if r is not None and np.abs(r).max() > 0.0:
        turned = np.abs(r[1:] + r[:-1]) / 2 * passed
        ratio = float(steps.sum() / max(float(turned.sum()), 1e-9))
    both = False
    if r is not None and (wrapped or whirling):
        on = np.minimum(steps, np.abs(360.0 - steps)) if wrapped else steps
        both = bool(0.5 < on.sum() / max(float(turned.sum()), 1e-9) < 2.0)
    if both:
        raise InputError(
            f"{file}: column {column!r}: expected a heading in rad, found values from {psi.min():.4g} to "
            f"{psi.max():.4g} that look like degrees, and a yaw rate in degrees per second; multiply both by "
            f"pi/180, or read them as --columns psi={column}:deg,r=NAME:deg/s"
        )
    if wrapped or (whirling and r is None) or 40.0 < ratio < 80.0:
        raise InputError(
            f"{file}: column {column!r}: expected a heading in rad, found values from "
            f"{psi.min():.4g} to {psi.max():.4g} that look like degrees; multiply by pi/180, or read it as "
            f"--columns psi={column}:deg"
        )
