"""What remains in what sensors show: errors that last, which no random force explains."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from hovercontrol.discrepancy.criteria import Criteria
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.noise import NOISE, averaging_time

#: Variance of a median of normal samples, over that of their mean. One outlier that was missed moves a mean.
MEDIAN = math.pi / 2
#: Fewest stretches from which a channel is judged.
FEWEST = 8


@dataclass(frozen=True)
class SlowError:
    """An error of a sensor that does not average out.

    Attributes
    ----------
    channel : str
    rms : float
        Root mean square of the residual's medians over `over` seconds, less what noise leaves of them.
    noise : float
        Standard deviation of the noise from sample to sample.
    unit : str
        Of both.
    over : float
        Length of such a stretch [s].
    """

    channel: str
    rms: float
    noise: float
    unit: str
    over: float

    #: Whether anything remains: else it is not listed.
    there = True


def only_noise(fit: Fit, criteria: Criteria) -> bool:
    """Return whether all that remains of a fit is noise of its measurements."""
    return not np.any(criteria.left(fit)) and not slow_errors(fit)


def slow_errors(fit: Fit) -> tuple[SlowError, ...]:
    """Return the channels whose residual lasts, larger than their noise from sample to sample.

    Random forces move the path; where channels contradict each other (a gyro that drifts, a heading that a
    magnet bends) no path follows them all, and the noise that is fitted takes the difference.

    Parameters
    ----------
    fit : Fit

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.discrepancy.search.base import base_fit
    >>> from hovercontrol.estimation.data import gather
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.samples import sample_path
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
