"""Statistics of a quantity over a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.definition import Metric


#: The plain statistics by name.
_PLAIN: dict[str, Callable[[Array], float]] = {
    "mean": np.mean,
    "min": np.min,
    "max": np.max,
    "std": np.std,
    "peak": lambda values: np.abs(values).max(),
}

#: Numbers that other statistics need.
NEEDS = {
    "farthest": ("target",),
    "crossed": ("target",),
    "reached": ("target", "within"),
    "settled": ("target", "within"),
}

#: Every statistic a metric may name.
STATISTICS = (*_PLAIN, *NEEDS)


def measure(metric: Metric, time: Array, values: Array) -> float:
    """Return a metric's value.

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s]
    values : ndarray, shape (n,)

    Returns
    -------
    float
        ``farthest``: the largest distance from the target. ``crossed``: seconds from the window's start
        until the value has come to the target or passed it for the first time. ``reached`` and ``settled``:
        until it is near the target for the first time, or stays so until the window's end. Infinite if that
        never happens.
    """
    first = np.searchsorted(time, metric.start - 1e-9)
    last = np.searchsorted(time, metric.end + 1e-9)
    t, v = time[first:last], values[first:last]
    if metric.statistic in _PLAIN:
        return float(_PLAIN[metric.statistic](v))
    off = v - metric.target
    if metric.statistic == "farthest":
        return float(np.abs(off).max())
    near = off * np.sign(off[0]) <= 0 if metric.statistic == "crossed" else np.abs(off) <= metric.within
    if metric.statistic in ("crossed", "reached"):
        return float(t[np.argmax(near)] - t[0]) if near.any() else math.inf
    outside = np.flatnonzero(~near)
    if not outside.size:
        return 0.0
    return float(t[outside[-1] + 1] - t[0]) if outside[-1] + 1 < len(t) else math.inf
