"""What remains in what sensors show: errors that last, which no random force explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.discrepancy.criteria import Criteria
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.noise import NOISE, averaging_time

#: Fewest averages from which a channel is judged.
FEWEST = 8


@dataclass(frozen=True)
class SlowError:
    """An error of a sensor that does not average out.

    Attributes
    ----------
    channel : str
    rms : float
        Root mean square of the residual, averaged over `over` seconds, less what noise leaves of it.
    noise : float
        Standard deviation of the noise from sample to sample.
    unit : str
        Of both.
    over : float
        Averaging time [s].
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
    """Return the channels whose residual, averaged, is larger than their noise from sample to sample.

    Random forces move the path; where channels contradict each other (a gyro that drifts, a heading that a
    magnet bends) no path follows them all, and the noise that is fitted takes the difference.

    Parameters
    ----------
    fit : Fit

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.discrepancy.diagnose import base_fit
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
        mean = np.where(seen, left, 0.0).sum(axis=1)[full] / count[full]
        noise = float(max(problem.data.noise[c], least[c]))
        slow = float(np.sqrt(max(np.mean(mean**2 - noise**2 / count[full]), 0.0)))
        if slow > noise:
            unit = problem.block.signal(channel).unit
            found.append(SlowError(channel, slow, noise, unit, over))
    return tuple(found)
