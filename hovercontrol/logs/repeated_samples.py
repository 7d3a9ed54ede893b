"""Measurements slower than the rows of a log: rows that only repeat the last measurement.

A logger that writes a 29 Hz pose on a 50 Hz grid writes some poses twice, equal to the last digit. Used as
samples, they would mean that the craft stopped and then jumped. A craft that is at rest, or slower than the
resolution of its sensor, also repeats its pose, but there the repeats begin and end with small steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log, Mask


@dataclass(frozen=True)
class RepeatCriteria:
    """Thresholds for repeated rows that are not measurements.

    No published source: set by hand, tested in tests/logs/test_repeated_samples.py.

    Attributes
    ----------
    jump : float
        Change of a column that shows motion, relative to its smallest change; required both before and after
        the equal rows.
    fewest : int
        Minimum number of different values that are repeated during motion.
    by_chance : float
        Minimum ratio, during motion, of runs of equal rows to runs that change by a single step of the
        resolution. Samples of a coarse sensor repeat about as often as they change by a single step.
    longer : float
        Repeats that last longer than this factor times their 95 % quantile count as a craft at rest; of
        these, one row per such period is kept.
    rounding : float
        Changes below this fraction of the largest one are rounding errors: the speed of an encoder is a
        difference of its counts, and equal only to rounding.
    """

    jump: float = 3.0
    fewest: int = 10
    by_chance: float = 3.0
    longer: float = 1.5
    rounding: float = 1e-6


#: The values in use.
REPEATS = RepeatCriteria()


def without_repeats(log: Log, names: Sequence[str]) -> tuple[Log, list[str]]:
    """Return a log without the measurements that only repeat the last one, and a line on each group.

    Repeats become NaN; commands in the same rows are kept. The pose is one group of columns, the body
    velocities are another. The other columns are one group if they repeat together, else separate groups.

    Parameters
    ----------
    names : sequence of str
        Measured columns.

    Examples
    --------
    >>> t = 0.02 * np.arange(1000)
    >>> slow = np.repeat(np.sin(t[::2]), 2)
    >>> found, said = without_repeats(Log("a", t, {"x": slow, "y": slow, "psi": slow}), ["x", "y", "psi"])
    >>> said
    ['a: the pose changes at about 25 Hz: the 500 of 1,000 rows that repeat it are not used as measurements']
    >>> int(np.isfinite(found["x"]).sum())
    500
    """
    pose, velocity = ([n for n in names if n in group] for group in (POSE, VELOCITY))
    others = [n for n in names if n not in (*POSE, *VELOCITY)]
    groups = [("the pose", pose), ("the body velocity", velocity)]
    if len(others) > 1 and repeats(log, others).any():
        groups += [(", ".join(others), others)]
    else:
        groups += [(f"column {n!r}", [n]) for n in others]
    dropped, said = dict[str, Floats](), []
    for what, group in groups:
        again = repeats(log, group)
        if not again.any():
            continue
        kept = np.isfinite(log.stack(*group)).all(axis=1) & ~again
        rate = _rate(log, kept)
        dropped |= {name: np.where(again, np.nan, log[name]) for name in group}
        said.append(
            f"{log.name}: {what} changes at about {rate:.2g} Hz: the {again.sum():,} of {len(log):,} rows "
            "that repeat it are not used as measurements"
        )
    if not dropped:
        return log, []
    blank = {name: log.missing(name) for name in log.columns}
    return replace(log, columns={**log.columns, **dropped}, blank=blank), said


def repeats(log: Log, names: Sequence[str]) -> Mask:
    """Return the rows, shape (n,), in which columns only repeat the last measurement.

    Parameters
    ----------
    names : sequence of str
        Columns that are measured together.

    Examples
    --------
    >>> t = 0.02 * np.arange(1000)
    >>> int(repeats(Log("a", t, {"r": np.sin(t)}), ["r"]).sum())
    0
    """
    again = np.zeros(len(log), dtype=bool)
    if not names or len(log) < 3:
        return again
    rows = np.flatnonzero(np.isfinite(log.stack(*names)).all(axis=1))
    values = log.stack(*names)[rows]
    sizes = np.abs(np.diff(values, axis=0))  # of the changes into rows 1, 2, ...
    sizes[sizes <= REPEATS.rounding * sizes.max(axis=0, initial=0.0)] = 0.0
    finest = np.array([row[row > 0.0].min(initial=np.inf) for row in sizes.T])
    large: Mask = np.any(sizes >= REPEATS.jump * finest, axis=1)
    equal: Mask = np.all(sizes == 0.0, axis=1)
    near: Mask = np.all(sizes <= 1.5 * finest, axis=1)
    held = _amid(equal, large)
    if not held.size or len(np.unique(values[held[:, 0]], axis=0)) < REPEATS.fewest:
        return again
    alone = near & ~equal
    if len(held) <= REPEATS.by_chance * len(_amid(alone, large)):
        return again
    period = int(REPEATS.longer * np.quantile(held[:, 1] - held[:, 0], 0.95)) + 1
    first, stop = _runs(equal).T
    length = stop - first
    place = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)  # 0 at the first repeat
    own = np.flatnonzero(equal) + 1
    again[rows[own[(place + 1) % period != 0]]] = True
    return again


def _runs(wanted: Mask) -> np.ndarray[tuple[int, int], np.dtype[np.intp]]:
    """Return the first index and the index after the last of each run, shape (m, 2)."""
    edges = np.diff(np.concatenate([[0], wanted.astype(np.int8), [0]]))
    return np.flatnonzero(edges).reshape(-1, 2)


def _amid(wanted: Mask, large: Mask) -> np.ndarray[tuple[int, int], np.dtype[np.intp]]:
    """Return the runs with a large change right before and right after, shape (m, 2)."""
    runs = _runs(wanted)
    inner = runs[(runs[:, 0] > 0) & (runs[:, 1] < wanted.size)]
    return inner[large[inner[:, 0] - 1] & large[inner[:, 1]]]


def _rate(log: Log, kept: Mask) -> float:
    """Return the rate of measurements [Hz], without gaps and pauses."""
    steps = np.diff(log.time[kept])
    return 1.0 / float(steps[steps <= 5.0 * np.median(steps)].mean())
