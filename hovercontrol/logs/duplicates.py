"""Detection of logs that are full or partial copies of each other, even if shifted in time or rounded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hovercontrol.base.errors import InputError
from hovercontrol.logs.log import Log

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DuplicateCriteria:
    """Thresholds for two logs that contain the same recording.

    No published source: set by hand, tested in tests/identification/diagnose/test_checks.py. Two runs differ
    by their noise, sqrt(2) standard deviations in each channel; copies differ by rounding only.

    Attributes
    ----------
    alike : float
        Rows are equal if no column differs by more than this fraction of its range: about four digits.
    run : int
        Minimum number of consecutive equal rows.
    shared : float
        Minimum fraction of a log's rows that must be equal.
    most : float
        Minimum fraction of the rows recorded at the same time that must be equal.
    same : float
        A channel is equal if it differs by less than this fraction of its noise.
    sought : int
        Maximum number of rows that are searched for in the other log.
    partners : int
        Number of nearest rows tried for each of those rows.
    shifts : int
        Number of time shifts that are tried.
    aside : float
        Maximum difference of the times of two equal rows, relative to the time step.
    """

    alike: float = 1e-3
    run: int = 20
    shared: float = 0.02
    most: float = 0.5
    same: float = 0.5
    sought: int = 400
    partners: int = 3
    shifts: int = 3
    aside: float = 0.3


#: The values in use.
DUPLICATES = DuplicateCriteria()


def refuse_duplicates(
    logs: Sequence[Log], holdout: Sequence[Log], channels: Sequence[str], inputs: Sequence[str]
) -> None:
    """Raise if training or held-out logs overlap each other.

    Parameters
    ----------
    logs : sequence of Log
        Training logs.
    holdout : sequence of Log
        Held-out logs.
    channels, inputs : sequence of str
        Names of measured and commanded columns; those that a log lacks are ignored.

    Raises
    ------
    InputError
        The message names both logs.
    """
    for one, other in combinations(logs, 2):
        what, why = f"{other.name}: it", "its rows would be used twice"
        _refuse(one, other, channels, inputs, what, "training", why)
    for one, other in combinations(holdout, 2):
        what, why = f"{other.name}: it", "its rows would count twice"
        _refuse(one, other, channels, inputs, what, "held-out", why)
    for one, other in product(logs, holdout):
        what, why = f"{other.name}: the held-out log", "it must not be in the fit"
        _refuse(one, other, channels, inputs, what, "training", why)


def _refuse(
    one: Log, other: Log, channels: Sequence[str], inputs: Sequence[str], what: str, kind: str, why: str
) -> None:
    found = shared(one, other, channels, inputs)
    if found == math.inf:
        raise InputError(f"{what} is the {kind} log {one.name}: {why}")
    if found:
        raise InputError(f"{what} shares {found} rows with the {kind} log {one.name}: {why}")


def shared(one: Log, other: Log, channels: Sequence[str], inputs: Sequence[str]) -> float:
    """Return the number of rows common to two logs; infinity if the logs are equal, 0 for only a few rows.

    Noise decides: two similar runs differ by their noise, copies only by rounding. A log at rest, or another
    run with the same commands, is therefore not taken for a copy.

    Examples
    --------
    >>> rng, t = np.random.default_rng(0), np.arange(0, 10, 0.02)
    >>> seen = [np.sin(t) + 1e-3 * rng.normal(size=t.size) for _ in range(2)]
    >>> a, b = (Log("a", t, {"x": row}) for row in seen)
    >>> shared(a, b, ["x"], []), shared(a, a.between(5, 9), ["x"], [])
    (0, 200)
    """
    measured = [name for name in channels if one.has(name) and other.has(name)]
    names = [*measured, *(name for name in inputs if one.has(name) and other.has(name))]
    if not measured:
        return 0
    ours, rows = (_Moving.of(log, names, len(measured)) for log in (one, other))
    if min(ours.time.size, rows.time.size) < DUPLICATES.run:
        return 0
    size = np.maximum(np.ptp(ours.values, axis=0), np.ptp(rows.values, axis=0))
    size[size == 0.0] = 1.0
    count = max((_copied(ours, rows, shift, size) for shift in _shifts(ours, rows, size)), default=0)
    if count <= DUPLICATES.shared * rows.time.size:
        return 0
    return math.inf if count > 0.95 * max(ours.time.size, rows.time.size) else count


@dataclass(frozen=True, eq=False)
class _Moving:
    """The rows of a log in which a measured column changed, because at rest any two logs are alike.

    Attributes
    ----------
    time : ndarray, shape (n,)
    values : ndarray, shape (n, n_columns)
        Measured columns first.
    third : ndarray, shape (n, n_measured)
        Third differences.
    changed : ndarray of bool, shape (n, n_measured)
        Whether the value differs from the previous row.
    """

    time: Array
    values: Array
    third: Array
    changed: NDArray[np.bool_]

    @classmethod
    def of(cls, log: Log, names: Sequence[str], measured: int) -> _Moving:
        values = log.stack(*names)
        known = np.isfinite(values).all(axis=1)
        time, values = log.time[known], values[known]
        third = np.zeros((time.size, measured))
        changed = np.zeros(third.shape, dtype=bool)
        if time.size > 3:
            third[2:-1] = np.diff(values[:, :measured], 3, axis=0)
            changed[1:] = np.diff(values[:, :measured], axis=0) != 0.0
        moving = changed.any(axis=1)
        return cls(time[moving], values[moving], third[moving], changed[moving])

    @property
    def step(self) -> float:
        """Median time step [s]."""
        return float(np.median(np.diff(self.time)))


def _shifts(ours: _Moving, rows: _Moving, size: Array) -> list[float]:
    """Return possible time shifts of `rows` after `ours` [s], the most likely first."""
    some = np.unique(np.linspace(0, rows.time.size - 1, DUPLICATES.sought).astype(int))
    tree = cKDTree(ours.values / size)
    near, at = tree.query(
        rows.values[some] / size, k=DUPLICATES.partners, p=np.inf, distance_upper_bound=DUPLICATES.alike
    )
    late = (rows.time[some][:, None] - ours.time[np.minimum(at, ours.time.size - 1)])[np.isfinite(near)]
    _, own, counts = np.unique(
        np.round(late / min(ours.step, rows.step)), return_inverse=True, return_counts=True
    )
    best = np.argsort(-counts, kind="stable")[: DUPLICATES.shifts]
    return [float(np.median(late[own == k])) for k in best]


def _copied(ours: _Moving, rows: _Moving, shift: float, size: Array) -> int:
    """Return the number of `rows` that are copies of rows of `ours` a time `shift` [s] earlier."""
    time = rows.time - shift
    after = np.clip(np.searchsorted(ours.time, time), 1, ours.time.size - 1)
    at = np.where(time - ours.time[after - 1] < ours.time[after] - time, after - 1, after)
    there = np.flatnonzero(np.abs(ours.time[at] - time) < DUPLICATES.aside * min(ours.step, rows.step))
    at = at[there]
    apart = np.abs(rows.values[there] - ours.values[at])
    alike: NDArray[np.bool_] = np.all(apart <= DUPLICATES.alike * size, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], alike.astype(int), [0]]))).reshape(-1, 2)
    for a, b in edges[np.diff(edges, axis=1).ravel() < DUPLICATES.run]:
        alike[a:b] = False
    if alike.sum() < DUPLICATES.most * there.size:
        return 0
    # White noise of standard deviation s has third differences of standard deviation sqrt(1 + 9 + 9 + 1) s.
    same = other = 0
    for c in range(rows.third.shape[1]):
        changed = alike & (rows.changed[there, c] | ours.changed[at, c])
        if changed.sum() < DUPLICATES.run:
            continue
        third = np.abs(rows.third[there[changed], c])
        usual = np.minimum(third, 6.0 * float(np.median(third)))  # a heading may jump by a full turn
        noise = float(usual.mean()) / math.sqrt(20.0)
        if float(apart[changed, c].mean()) <= DUPLICATES.same * noise:
            same += 1
        else:
            other += 1
    return int(alike.sum()) if same and same >= other else 0
