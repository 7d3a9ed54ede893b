"""What a metric makes of a quantity over a window: one number."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hovercontrol.scenarios.definition import Metric

Array = NDArray[np.float64]

#: The plain statistics by name.
_PLAIN: dict[str, Callable[[Array], float]] = {
    "mean": np.mean,
    "min": np.min,
    "max": np.max,
    "std": np.std,
    "peak": lambda values: np.abs(values).max(),
}

#: Every statistic a metric may name.
STATISTICS = (*_PLAIN, "reached", "settled")


def measure(metric: Metric, time: Array, values: Array) -> float:
    """Return a metric's value.

    Parameters
    ----------
    metric : Metric
    time : ndarray, shape (n,)
        [s]
    values : ndarray, shape (n,)

    Returns
    -------
    float
        ``reached`` and ``settled``: seconds from the window's start until the value is near the target for
        the first time, or stays so until the window's end; infinite if that never happens.
    """
    first = np.searchsorted(time, metric.start - 1e-9)
    last = np.searchsorted(time, metric.end + 1e-9)
    t, v = time[first:last], values[first:last]
    if metric.statistic in _PLAIN:
        return float(_PLAIN[metric.statistic](v))
    near = np.abs(v - metric.target) <= metric.within
    if metric.statistic == "reached":
        return float(t[np.argmax(near)] - t[0]) if near.any() else math.inf
    outside = np.flatnonzero(~near)
    if not outside.size:
        return 0.0
    return float(t[outside[-1] + 1] - t[0]) if outside[-1] + 1 < len(t) else math.inf
