"""Changes of a coefficient over time: logs unlike their neighbours, trends, and change points.

For one craft with times t_k, estimates y_k and variances d_k = s_k^2 + omega^2 these are compared with a
constant, each by the fall of chi^2 = sum (y_k - fit)^2 / d_k (generalised least squares)::

    line    a + b t
    step    a + b [t >= c]
    ramp    a + b max(0, t - c)        for every c between two logs (Hinkley, Biometrika 57 (1970))

The likeliest has the p-value of its gain times the number of shapes tried (Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.base.arrays import Array

#: Fewest logs of a craft of which a trend is sought, and fewest on each side of a change.
LEAST, SIDE = 6, 2

#: Logs on each side beside which a log is judged.
BESIDE = 2

#: A normal median of many has this variance, relative to that of one; of five with one's own less.
_MEDIAN = 1.25

#: Fall of chi^2 within which the time of a change may lie: 95 %, one number.
_LIKELY = 3.84


@dataclass(frozen=True)
class Trend:
    """A change of one craft's coefficient.

    Attributes
    ----------
    shape : {"line", "step", "ramp"}
    since, earliest, latest : float
        Time of the change, and the span of 95 % in which it lies; of a line the first log.
    before, now, now_std : float
        Value at the first log and at the last one.
    p : float
    """

    shape: str
    since: float
    earliest: float
    latest: float
    before: float
    now: float
    now_std: float
    p: float


def scatter(y: Array, variance: Array, craft: NDArray[np.intp], time: Array) -> tuple[float, int]:
    """Return the scatter between logs beyond their errors, free of trends, and its degrees of freedom.

    By differences of neighbours in time (Rice, Ann. Stat. 12 (1984)); outlying pairs weigh little, since the
    median of their squares is taken: ``median(D^2) = 0.455 (s_k^2 + s_k+1^2 + 2 omega^2)``.
    """
    order = np.lexsort((time, craft))
    same = np.diff(craft[order]) == 0
    if same.sum() < 2:
        return 0.0, 0
    D2 = np.diff(y[order])[same] ** 2
    s2 = (variance[order][1:] + variance[order][:-1])[same]
    low, high = 0.0, 1.0 + 4.0 * float(D2.max())
    for _ in range(60):  # omega^2 at which the median of D^2 / E D^2 is that of chi^2 with one degree
        middle = 0.5 * (low + high)
        small = np.median(D2 / (s2 + 2.0 * middle)) < stats.chi2.ppf(0.5, 1)
        low, high = (low, middle) if small else (middle, high)
    return float(np.sqrt(low)), int(0.37 * same.sum())  # efficiency of the median of squares


def outlying(y: Array, d: Array, craft: NDArray[np.intp], time: Array, dof: int) -> Array:
    """Return the p-value of each log beside its neighbours in time of the same craft; NaN without four.

    Parameters
    ----------
    d : ndarray, shape (n,)
        Variances, with the scatter between logs.
    dof : int
        Degrees of freedom of that scatter.
    """
    p = np.full(y.size, np.nan)
    for own in _by_craft(craft, time):
        n = own.size
        if n < 2 * BESIDE + 1:
            continue
        for k in range(n):
            first = min(max(k - BESIDE, 0), n - 2 * BESIDE - 1)
            near = own[first : first + 2 * BESIDE + 1]
            far = abs(y[own[k]] - np.median(y[near])) / np.sqrt(_MEDIAN * max(d[own[k]], np.median(d[near])))
            p[own[k]] = 2.0 * stats.t.sf(far, max(dof, 1))
    return p


def trend(y: Array, d: Array, time: Array, dof: int) -> Trend | None:
    """Return the likeliest change of one craft; None with too few logs.

    Parameters
    ----------
    y, d, time : ndarray, shape (n,)
        Estimates, variances with the scatter between logs, and times, increasing.
    dof : int
        Degrees of freedom of that scatter.
    """
    n = y.size
    if n < LEAST or not time[-1] > time[0]:
        return None
    span = time[-1] - time[0]
    middles = [k for k in range(SIDE, n - SIDE + 1) if time[k] > time[k - 1]]
    at = np.array([0.5 * (time[k - 1] + time[k]) for k in middles])
    shapes = [("line", time[0], (time - time[0]) / span)]
    shapes += [("step", c, (time >= c).astype(float)) for c in at]
    shapes += [("ramp", c, np.maximum(time - c, 0.0) / span) for c in at]
    w = 1.0 / d
    X = np.array([x for *_, x in shapes])
    X0 = X - (X @ w)[:, None] / w.sum()
    y0 = y - (y @ w) / w.sum()
    size = np.maximum((X0**2) @ w, 1e-300)
    slope = (X0 * y0) @ w / size
    gain = slope**2 * size
    best = int(np.argmax(gain))
    kind, since, x = shapes[best]
    p = float(min(1.0, len(shapes) * stats.f.sf(gain[best], 1, max(dof, 1))))
    alike = [
        c for (name, c, _), g in zip(shapes, gain, strict=True) if name == kind and g > gain[best] - _LIKELY
    ]
    mean, of_mean = (y @ w) / w.sum(), (X[best] @ w) / w.sum()
    fit = mean + slope[best] * (x - of_mean)
    now_std = np.sqrt(1.0 / w.sum() + (x[-1] - of_mean) ** 2 / size[best])
    return Trend(
        kind,
        float(since),
        float(min(alike)),
        float(max(alike)),
        float(fit[0]),
        float(fit[-1]),
        float(now_std),
        p,
    )


def _by_craft(craft: NDArray[np.intp], time: Array) -> list[NDArray[np.intp]]:
    """Return the indices of each craft's logs, in order of time."""
    order = np.lexsort((time, craft))
    return np.split(order, np.flatnonzero(np.diff(craft[order])) + 1)
