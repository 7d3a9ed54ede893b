"""The steady sampling clock of jittered time stamps.

A motion-capture system samples at a fixed rate, but a log written over a network stamps each
sample when it arrives: several at once, then none for 0.2 s. Velocities from such stamps are
meaningless (a 0.3 rad turn within 0.1 ms). The model of a stamp is ``start + frame * period + delay``.
If all delays are within half a period of their mean, the phase of each stamp gives its frame number, however
many frames are missing. Otherwise most delays are assumed to be near zero, and the lower envelope of the
delays shows the lost frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from hovercontrol.base.arguments import as_row
from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr
from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log, gap_rows


@dataclass(frozen=True)
class ClockCriteria:
    """Thresholds for replacing the stamps of a log by a steady clock.

    No published source: set by hand on recorded logs, tested in tests/logs/test_smooth.py and
    tests/logs/test_real.py.

    Attributes
    ----------
    window : int
        Number of consecutive samples of which at least one is assumed to arrive without delay.
    punctual : float
        Minimum fraction of the stamps within a quarter period of the clock (uniformly distributed stamps
        give 0.5).
    exact : float
        Largest distance from the clock, in periods, at which the stamps are kept as they are.
    fewest : int
        Minimum number of stamps for a clock.
    rougher : float
        Maximum roughness of the samples on the clock, relative to that on the stamps.
    one_sided : float
        Ratio of the upper to the lower tail of the delays above which they are taken as arrival delays.
    in_phase : float
        Minimum fraction of the stamps within half a period of the clock if frames are counted by phase.
    """

    window: int = 50
    punctual: float = 0.7
    exact: float = 1e-6
    fewest: int = 20
    rougher: float = 1.02
    one_sided: float = 1.5
    in_phase: float = 0.99


#: The values in use.
CLOCK = ClockCriteria()


SPAN = 16
"""Samples over which the stamps must stay in phase at first; then over ever longer spans."""

FINER = 8
"""Trial periods to either side of the best so far, a quarter of a turn over the span apart."""

MOST_PHASES = 20_000
"""Stamps whose phase is looked at."""


@checked
@dataclass(frozen=True, eq=False)
class Clock:
    """Sampling times fitted to arrival times.

    Attributes
    ----------
    time : ndarray (n,)
        Sampling times [s]; the arrival times themselves where ``steady`` is false.
    steady : bool
        Whether a fixed sampling rate explains the arrival times.
    period : float
        Sampling period [s].
    lost : int
        Frames that never arrived.
    worst_delay : float
        Longest time from sampling to stamp [s], not counting the constant part.

    Examples
    --------
    >>> clock = fit_clock(0.02 * np.arange(100))
    >>> clock.steady, round(clock.period, 4)
    (True, 0.02)
    """

    time: Floats
    steady: bool
    period: float
    lost: int
    worst_delay: float

    __repr__ = short_repr


@checked
def fit_clock(arrival: Floats, samples: Floats | None = None) -> Clock:
    """Fit a steady sampling clock to the time stamps of a log.

    The stamps are kept if they are exact. They are also kept if they are truly irregular: fewer than
    ``CLOCK.fewest`` stamps, a punctual fraction below ``CLOCK.punctual``, or samples that are smoother on the
    stamps than on the clock.

    The offset of the clock depends on the distribution of the delays. If it is symmetric, as for jittering
    stamps, the clock passes through the mean of the stamps. If it has one long upper tail, as for network
    delays, the clock follows their lower envelope (the 2 % quantile). A delay common to all stamps is not
    observable and remains.

    Parameters
    ----------
    arrival : ndarray (n,)
        Time stamps [s], strictly increasing.
    samples : ndarray (n, k), optional
        The sampled values; NaN where there is none.

    Returns
    -------
    Clock

    Raises
    ------
    InputError
        If `arrival` is not a one-dimensional array of numbers.

    Examples
    --------
    >>> jitter = 1e-3 * np.sin(np.arange(100.0) ** 2)
    >>> clock = fit_clock(0.02 * np.arange(100) + jitter)
    >>> clock.steady, round(clock.period, 4)
    (True, 0.02)
    """
    arrival = as_row("fit_clock: arrival", arrival)
    steps = np.diff(arrival)
    period = float(np.median(steps)) if steps.size else 0.0
    as_stamped = Clock(arrival, False, period, 0, 0.0)
    if arrival.size < CLOCK.fewest:
        return as_stamped
    found = _in_phase(arrival, period) or _in_envelope(arrival, period)
    time, period, lost = found
    delay = arrival - time
    if np.abs(delay).max() < CLOCK.exact * period:
        return Clock(arrival, True, period, lost, 0.0)
    punctual = np.abs(delay) < 0.25 * period
    if np.mean(punctual) < CLOCK.punctual or not np.all(np.diff(time) > 0):
        return as_stamped
    if samples is not None and _rougher(time, arrival, samples):
        return as_stamped
    time = time + _zero(delay[punctual])
    return Clock(time, True, period, lost, float((arrival - time).max()))


@checked
def steady(log: Log, columns: Sequence[str] | None = None) -> Log:
    """Return the log with its stamps replaced by a steady clock, if one fits.

    Commands in the same rows move with the stamps, and the number of rows does not change. Each trial has
    its own clock.

    Parameters
    ----------
    log : Log
    columns : sequence of str, optional
        Measured columns (default: pose and body velocities). The clock is fitted to the rows in which any of
        these is finite. The times of the other rows are shifted as much as the rows around them.

    Examples
    --------
    >>> irregular = Log("demo", np.cumsum(1.0 + np.arange(50) % 3), {})
    >>> bool(np.all(steady(irregular).time == irregular.time))
    True
    """
    if log.trials:
        time = np.concatenate([steady(part, columns).time for part in log.each_trial()])
        return replace(log, time=time) if (np.diff(time) > 0.0).all() else log
    names = measured(log) if columns is None else columns
    if not names:
        return replace(log, time=fit_clock(log.time).time)
    samples = log.stack(*names)
    seen = np.isfinite(samples).any(axis=1)
    if seen.all():
        return replace(log, time=fit_clock(log.time, samples).time)
    clock = fit_clock(log.time[seen], samples[seen])
    return replace(log, time=moved(log.time, log.time[seen], clock.time))


def measured(log: Log) -> list[str]:
    """Return the names of the pose and body velocity columns that a log has.

    Examples
    --------
    >>> measured(Log("demo", [0.0, 1.0], {"thrust": [0.0, 1.0], "r": [0.0, 0.0]}))
    ['r']
    """
    return [name for name in (*POSE, *VELOCITY) if log.has(name)]


def moved(time: Floats, stamps: Floats, clock: Floats) -> Floats:
    """Return times shifted by the interpolated difference between a clock and its stamps.

    Examples
    --------
    >>> moved(np.array([0.0, 1.0, 2.5]), np.array([1.0, 2.0]), np.array([1.1, 2.1]))
    array([0.1, 1.1, 2.6])
    """
    shifted: Floats = time + np.interp(time, stamps, clock - stamps)
    return shifted


def _in_phase(arrival: Floats, period: float) -> tuple[Floats, float, int] | None:
    """Return times, period and lost frames if the stamps are within half a period of a clock, else None."""
    # Offset of the clock: period/(2 pi) arg sum_k exp(2 pi i t_k / period); frame_k = round of the stamp on
    # the clock; then start and period by linear regression of the stamps on the frames.
    period = _refined(arrival, period)
    phase = 2 * np.pi / period * (arrival - arrival[0])
    late = float(np.arctan2(np.sin(phase).sum(), np.cos(phase).sum())) / (2 * np.pi)
    line = np.array([period, arrival[0] + late * period])
    order = np.arange(arrival.size)
    for _ in range(2):
        frame = np.rint((arrival - line[1]) / line[0]) - order
        frame = np.minimum.accumulate(frame[::-1])[::-1] + order  # frame numbers increase strictly
        near = np.abs(arrival - np.polyval(line, frame)) < 0.5 * line[0]
        if near.mean() < CLOCK.in_phase:
            return None
        line = _regression(frame[near], arrival[near])
    return np.polyval(line, frame), float(line[0]), int(frame[-1] - frame[0]) - (arrival.size - 1)


def _refined(arrival: Floats, period: float) -> float:
    """Return the period at which the stamps' phases agree best, first over short and then over longer spans.

    The period maximises ``sum over spans |sum_k exp(2 pi i t_k / period)|``, with times t_k from the start of
    each span: phases must agree within a span, but not between spans.
    """
    turns = np.arange(-FINER, FINER + 1)
    span = min(SPAN, arrival.size)
    while True:
        count = min(arrival.size // span, max(MOST_PHASES // span, 1))
        firsts = np.linspace(0, arrival.size - span, count).astype(int)
        inside = np.linspace(0, span - 1, min(span, MOST_PHASES)).astype(int)
        stamps = arrival[firsts[:, None] + inside] - arrival[firsts, None]
        faster = 1 + 0.25 / span * turns
        agree = [np.abs(np.exp(2j * np.pi * f / period * stamps).sum(axis=1)).sum() for f in faster]
        period = period / float(faster[int(np.argmax(agree))])
        if span == arrival.size:
            return period
        span = min(4 * span, arrival.size)


def _in_envelope(arrival: Floats, period: float) -> tuple[Floats, float, int]:
    """Return times, period and lost frames from the lower envelope of the delays."""
    for span in (10, 100):
        if arrival.size > 2 * span:
            strides = arrival[span:] - arrival[:-span]
            whole = np.abs(strides / (span * period) - 1.0) < 0.5 / span
            if whole.any():
                period = float(np.median(strides[whole])) / span
    time = np.empty_like(arrival)
    lost = 0
    for part in np.split(np.arange(arrival.size), gap_rows(arrival)):
        frame = _frames(arrival[part], period)
        time[part] = _line(arrival[part], frame, period)
        lost += int(frame[-1]) - (part.size - 1)
    return time, period, lost


def _zero(delay: Floats) -> float:
    """Return the clock's offset: the mean of the delays if they are symmetric, else their 2 % quantile."""
    low, middle, high = np.quantile(delay, [0.05, 0.5, 0.95])
    if high - middle > CLOCK.one_sided * (middle - low):
        return float(np.quantile(delay, 0.02))
    return float(delay.mean())


def _rougher(time: Floats, stamps: Floats, samples: Floats) -> bool:
    """Return whether samples are rougher on the clock than on the stamps (geometric mean over channels)."""
    ratios = []
    for row in samples.T:
        seen = np.isfinite(row)
        if np.count_nonzero(seen) >= CLOCK.fewest:
            on, as_stamped = (_roughness(t[seen], row[seen]) for t in (time, stamps))
            if min(on, as_stamped) > 0:
                ratios.append(np.log(on / as_stamped))
    return bool(ratios and np.exp(np.mean(ratios)) > CLOCK.rougher)


def _roughness(time: Floats, row: Floats) -> float:
    """Return the median distance of samples from the line between their neighbours, scaled to equal noise."""
    # s = (t_k - t_k-1)/(t_k+1 - t_k-1),  d_k = y_k - (1 - s) y_k-1 - s y_k+1 has the variance
    # (1 + s^2 + (1 - s)^2) times that of the noise.
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = row[1:-1] - (1 - share) * row[:-2] - share * row[2:]
    return float(np.median(np.abs(off) / np.sqrt(1 + share**2 + (1 - share) ** 2)))


def _frames(arrival: Floats, period: float) -> Floats:
    """Return the frame number of each arrival, counting the lost frames."""
    late = arrival - arrival[0] - period * np.arange(arrival.size)
    # The minimum delay of a sample and the next CLOCK.window samples steps up by whole periods where frames
    # were lost.
    padded = np.append(late, np.full(CLOCK.window, np.inf))
    floor = minimum_filter1d(padded, CLOCK.window + 1, origin=-(CLOCK.window // 2))[: late.size]
    lost = np.concatenate([[0.0], np.cumsum(np.rint(np.diff(floor) / period))])
    lost = np.minimum.accumulate(lost[::-1])[::-1]  # frame numbers increase strictly
    frames: Floats = np.arange(arrival.size) + lost - lost[0]
    return frames


def _regression(x: Floats, y: Floats) -> Floats:
    """Return slope and intercept of a least-squares line; `numpy.polyfit` takes ten times the memory."""
    away = x - x.mean()
    slope = (away @ y) / (away @ away)
    return np.array([slope, y.mean() - slope * x.mean()])


def _line(arrival: Floats, frame: Floats, period: float) -> Floats:
    """Return the times of frames on the line through the undelayed arrivals."""
    # Regression of arrival - period frame = start + slope frame, three times with the arrivals within
    # 0.1 period of the last line.
    offset = arrival - period * frame
    slope, start = 0.0, float(np.median(offset))
    for _ in range(3):
        near = np.abs(offset - start - slope * frame) < 0.1 * period
        if near.sum() > 10:
            slope, start = _regression(frame[near], offset[near])
    line: Floats = start + (period + slope) * frame
    return line
