"""Slow errors of sensors: residuals that last and that no random force explains."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.noise import NOISE, averaging_time

#: Variance of the median of normal samples over that of their mean. A missed outlier would move a mean.
MEDIAN = math.pi / 2
#: Minimum number of stretches to judge a channel.
FEWEST = 8


@dataclass(frozen=True)
class SlowError:
    """An error of a sensor that does not average out.

    Attributes
    ----------
    channel : str
    rms : float
        Root mean square of the medians of the residual over `over` seconds, without the part due to noise.
    noise : float
        Standard deviation of the noise from sample to sample.
    unit : str
        Unit of `rms` and `noise`.
    over : float
        Length of such a stretch [s].
    """

    channel: str
    rms: float
    noise: float
    unit: str
    over: float

    #: Always significant: other errors are not listed.
    there = True


def only_noise(fit: Fit, criteria: Criteria) -> bool:
    """Return whether the fit leaves only measurement noise: no process noise and no slow errors."""
    return not np.any(criteria.left(fit)) and not slow_errors(fit)


def slow_errors(fit: Fit) -> tuple[SlowError, ...]:
    """Return the channels with a lasting residual that is larger than their noise from sample to sample.

    A random force moves the path. If channels contradict each other (a gyro that drifts, a heading disturbed
    by a magnet), no path follows all of them, and the fitted noise absorbs the difference. With the medians m
    of the residual over stretches of n samples, and the noise sigma from sample to sample::

        rms^2 = mean(m^2 - (pi/2) sigma^2 / n)

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose.search.base import base_fit
    >>> from hovercontrol.identification.engine.data import gather
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> model, log = hc.vehicle("c17_experiment"), read_log(sample_path()).between(0.0, 15.0)
    >>> slow_errors(base_fit(model, gather(model, [log])))
    ()
    """
    problem = fit.problem
    over = averaging_time(problem)
    n = max(NOISE.averaging_rows, round(over / problem.shortest))
    whole = problem.seen.shape[0] // n * n
    if not whole:
        return ()
    least = NOISE.tiny * np.nanstd(problem.rows.values, axis=(0, 1))
    found = []
    for c, channel in enumerate(problem.rows.channels):
        seen = problem.seen[:whole, :, c].reshape(-1, n, problem.seen.shape[1])
        left = (fit.left[:whole, :, c] * fit.noise.measured[c]).reshape(seen.shape)
        count = seen.sum(axis=1)
        full = 2 * count > n
        if full.sum() < FEWEST:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of stretches without a sample
            middle = np.nanmedian(np.where(seen, left, np.nan), axis=1)[full]
        noise = float(max(problem.data.noise[c], least[c]))
        slow = float(np.sqrt(max(np.mean(middle**2 - MEDIAN * noise**2 / count[full]), 0.0)))
        if slow > noise:
            unit = problem.block.signal(channel).unit
            found.append(SlowError(channel, slow, noise, unit, over))
    return tuple(found)
