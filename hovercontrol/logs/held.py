"""Measurements slower than the rows of a log, held between: rows that repeat the last one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log

#: Rows of a log that are looked at, at most.
MOST_ROWS = 60_000


@dataclass(frozen=True)
class HeldCriteria:
    """When measurements are held.

    No published source: set by hand, exercised by tests/logs/test_held.py.

    Attributes
    ----------
    rows : float
        Rows from one new measurement to the next, in the median, from which on they are held.
    bearable : float
        The same of a pose, up to which a fit is little off: farther apart, its steps look like jumps.
    regular : float
        Part of the measurements that come within a row, or a fifth, of that.
    fewest : int
        Smallest number of measurements.
    coarse : float
        Usual change of a column over its smallest, below which it repeats since its resolution is coarse.
    """

    rows: float = 2.0
    bearable: float = 2.0
    regular: float = 0.9
    fewest: int = 10
    coarse: float = 3.0


#: The values in use.
HELD = HeldCriteria()


def held_faults(log: Log, names: Sequence[str], over: float = 1.0) -> list[str]:
    """Return one line for each measurement that is held over rows of a log.

    Parameters
    ----------
    log : Log
    names : sequence of str
        Measured columns; the pose counts as one measurement, and the body velocities as another.
    over : float, optional
        Rows up to which nothing is said.

    Examples
    --------
    >>> t = 0.02 * np.arange(1000)
    >>> slow = np.repeat(np.sin(t[::10]), 10)
    >>> held_faults(Log("a", t, {"x": slow, "y": slow, "psi": slow}), ["x", "y", "psi"])[0].partition(";")[0]
    'a: the pose repeats for 10 rows: it is measured at about 5 Hz and held between'
    """
    pose, velocity = ([n for n in names if n in group] for group in (POSE, VELOCITY))
    groups = [("the pose", pose), ("the body velocity", velocity)]
    groups += [(f"column {n!r}", [n]) for n in names if n not in (*POSE, *VELOCITY)]
    said = []
    for what, group in groups:
        found = held(log, group) if group else None
        if found and found[0] > over:
            rows, rate = found
            said.append(
                f"{log.name}: {what} repeats for {rows} rows: it is measured at about {rate:.2g} Hz and held "
                "between; write each measurement once, in a file of its own, and give both as POSE+COMMANDS"
            )
    return said


def held_pose(log: Log) -> list[str]:
    """Return the line on a pose that is held for so long that no velocities follow from it.

    Examples
    --------
    >>> t = 0.02 * np.arange(1000)
    >>> held_pose(Log("a", t, {"x": np.sin(t), "y": np.cos(t), "psi": t}))
    []
    """
    return held_faults(log, [name for name in POSE if log.has(name)], HELD.bearable)


def held(log: Log, names: Sequence[str]) -> tuple[int, float] | None:
    """Return for how many rows columns stay as they are, and how often they change [Hz]; None if at each row.

    Examples
    --------
    >>> t = 0.02 * np.arange(1000)
    >>> held(Log("a", t, {"r": np.sin(t)}), ["r"]) is None
    True
    """
    apart, times, jumps = [np.empty(0)], [np.empty(0)], [np.empty((0, len(names)))]
    for part in log.spread(MOST_ROWS):
        values = part.stack(*names)
        seen = np.isfinite(values).all(axis=1)
        change = np.diff(values[seen], axis=0)
        new = np.flatnonzero(change.any(axis=1))
        apart.append(np.diff(new).astype(float))
        times.append(np.diff(part.time[seen][1:][new]))
        jumps.append(np.abs(change[new]))
    rows, sizes = np.concatenate(apart), np.concatenate(jumps)
    if rows.size < HELD.fewest or all(_coarse(column) for column in sizes.T):
        return None
    usual = float(np.median(rows))
    near = np.abs(rows - usual) <= max(1.0, 0.2 * usual)
    if usual < HELD.rows or near.mean() < HELD.regular or (rows == 1.0).mean() > 1.0 - HELD.regular:
        return None
    return round(usual), 1.0 / float(np.median(np.concatenate(times)))


def _coarse(jumps: Floats) -> bool:
    """Return whether a column changes by steps of its resolution."""
    own = jumps[jumps > 0.0]
    return not own.size or bool(np.median(own) < HELD.coarse * own.min())
