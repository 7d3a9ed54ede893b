"""Detection of columns that are not in SI units, from motion that is impossible for a craft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.logs.log import Floats, Log


@dataclass(frozen=True)
class ScaleCriteria:
    """Thresholds for motion that indicates another unit.

    No published source: set by hand, tested in tests/logs/test_scales.py.

    Attributes
    ----------
    slowest : float
        Largest median time step of a craft's log [s]; a larger one means another unit of time.
    fastest : float
        Speed that no hovercraft of this kind reaches [m/s]; positions in millimetres soon exceed it.
    turning : float
        Yaw rate that no craft sustains for half of a log [rad/s]; a heading in degrees exceeds it if the
        craft turns faster than 30 degrees per second.
    over : float
        Time over which speeds are computed [s].
    """

    slowest: float = 1.0
    fastest: float = 30.0
    turning: float = 30.0
    over: float = 0.4


#: The values in use.
SCALES = ScaleCriteria()


def scale_faults(log: Log) -> list[str]:
    """Return the evidence that time, position, velocity or heading are not in s, m, m/s and rad.

    Returns
    -------
    list of str
        One line each. A wrong unit of time is reported alone, because it would cause the others.

    Examples
    --------
    >>> t = np.arange(0.0, 2.0, 0.02)
    >>> scale_faults(Log("a", t, {"x": 1e3 * t, "y": 0 * t}))
    ['a: the position moves at 1e+03 m/s: is it in millimetres or centimetres? Give metres, or x=NAME:mm']
    >>> scale_faults(Log("a", 1e3 * t, {"x": t, "y": 0 * t}))
    ['a: rows are 20 s apart: is its time in seconds? (--columns time=NAME:ms)']
    """
    apart = float(np.median(np.diff(log.time))) if log.time.size > 1 else 0.0
    if apart > SCALES.slowest:
        return [f"{log.name}: rows are {apart:g} s apart: is its time in seconds? (--columns time=NAME:ms)"]
    said = []
    if log.has("x", "y"):
        fast = float(np.quantile(np.hypot(*_rates(log, "x", "y").T), 0.9))
        if fast > SCALES.fastest:
            said.append(
                f"{log.name}: the position moves at {fast:.3g} m/s: is it in millimetres or centimetres? "
                "Give metres, or x=NAME:mm"
            )
    if log.has("psi"):
        by_row, over = _rates(log, "psi", each=True), _rates(log, "psi")
        turning = float(min(np.median(np.abs(by_row)), np.median(np.abs(over))))  # noise turns to and fro
        if turning > SCALES.turning:
            said.append(
                f"{log.name}: the heading turns at {turning:.3g} rad/s: is it in degrees? "
                "Give radians, or psi=NAME:deg"
            )
    for name in ("u", "v"):
        known = log[name][np.isfinite(log[name])] if log.has(name) else np.empty(0)
        if known.size and np.ptp(known) > 2 * SCALES.fastest:
            low, high = known.min(), known.max()
            said.append(
                f"{log.name}: column {name!r} runs from {low:.4g} to {high:.4g} m/s: is it in mm/s or cm/s?"
            )
    return said


def _rates(log: Log, *names: str, each: bool = False) -> Floats:
    """Return the rates of change of columns [1/s], shape (m, number of names); one row of zeros if too short.

    Rates are over ``SCALES.over``, or with `each` from each row to the next. Over the longer time a wrapped
    heading is unwrapped first.
    """
    values = log.stack(*names)
    known = np.isfinite(values).all(axis=1)
    time, values = log.time[known], values[known]
    if time.size < 3:
        return np.zeros((1, len(names)))
    if names == ("psi",) and not each:
        values = np.unwrap(values, axis=0)
    every = max(1, round(SCALES.over / float(np.median(np.diff(time)))))
    if each or time.size <= 2 * every:
        every = 1
    return np.asarray(np.diff(values[::every], axis=0) / np.diff(time[::every])[:, None], dtype=float)
