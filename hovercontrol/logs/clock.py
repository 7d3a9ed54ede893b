"""The steady sampling clock of jittered time stamps.

A motion-capture system samples at a fixed rate, but a log written over a network stamps each
sample when it arrives: several at once, then none for 0.2 s. Velocities from such stamps are
nonsense (a 0.3 rad turn within 0.1 ms). Each stamp is ``start + frame * period + delay``. Where all
delays lie within half a period of each other's mean, the stamps' phase tells the frame of each, however
many are missing; else a delay is near zero most of the time, and the lower envelope of the delays shows
the frames that were lost on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from hovercontrol.core.arguments import as_row
from hovercontrol.core.boundary import checked
from hovercontrol.io.short_repr import short_repr
from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log, gap_rows


@dataclass(frozen=True)
class ClockCriteria:
    """When the stamps of a log are late copies of a steady clock.

    No published source: set by hand on recorded logs, exercised by tests/logs/test_smooth.py and
    tests/logs/test_real.py.

    Attributes
    ----------
    window : int
        Samples of which at least one arrives without delay.
    punctual : float
        Part of the stamps within a quarter period of the clock below which there is none (by chance:
        0.5).
    exact : float
        Stamps this close to the clock are kept, in periods.
    fewest : int
        Smallest number of stamps for a clock.
    rougher : float
        Largest roughness of the samples on the clock, relative to that on the stamps.
    one_sided : float
        Upper tail of the delays, relative to the lower one, from which on they are delays of arrival.
    in_phase : float
        Part of the stamps that must lie within half a period of the clock for the phase to count frames.
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
        Longest time from sampling to stamp [s], beyond the constant part.

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

    The stamps are kept where they are exact, and where they are truly irregular: fewer than ``CLOCK.fewest``
    of them, too few ``CLOCK.punctual``, or samples that are smoother on the stamps than on the clock.

    The clock's zero is the mean of the stamps where these scatter alike to both sides, as a jittering
    time stamp does, and their lower envelope (the fiftieth part that comes first) where their scatter
    has one long tail, as delays on a network have: the shape of the scatter decides. What all stamps
    are late by alike cannot be seen and stays.

    Parameters
    ----------
    arrival : ndarray (n,)
        Time stamps [s], strictly increasing.
    samples : ndarray (n, k), optional
        What was sampled; NaN where nothing was.

    Returns
    -------
    Clock

    Raises
    ------
    InputError
        If `arrival` is not a row of numbers.

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
    """Return the log with its stamps replaced by the steady clock behind them, if any.

    Commands in the same rows move with them: each row stays one. Each trial has a clock of its own.

    Parameters
    ----------
    log : Log
    columns : sequence of str, optional
        What was measured, else pose and body velocities. The clock is that of the rows in which any of
        these is finite; the times of the others are moved as much as those around them.

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
    """Return which of pose and body velocities a log has.

    Examples
    --------
    >>> measured(Log("demo", [0.0, 1.0], {"thrust": [0.0, 1.0], "r": [0.0, 0.0]}))
    ['r']
    """
    return [name for name in (*POSE, *VELOCITY) if log.has(name)]


def moved(time: Floats, stamps: Floats, clock: Floats) -> Floats:
    """Return times among stamps, each moved as much as the stamps around it are by a clock.

    Examples
    --------
    >>> moved(np.array([0.0, 1.0, 2.5]), np.array([1.0, 2.0]), np.array([1.1, 2.1]))
    array([0.1, 1.1, 2.6])
    """
    shifted: Floats = time + np.interp(time, stamps, clock - stamps)
    return shifted


def _in_phase(arrival: Floats, period: float) -> tuple[Floats, float, int] | None:
    """Return times, period and lost frames where all stamps scatter by less than half a period, else None."""
    period = _refined(arrival, period)
    phase = 2 * np.pi / period * (arrival - arrival[0])
    late = float(np.arctan2(np.sin(phase).sum(), np.cos(phase).sum())) / (2 * np.pi)
    line = np.array([period, arrival[0] + late * period])
    order = np.arange(arrival.size)
    for _ in range(2):
        frame = np.rint((arrival - line[1]) / line[0]) - order
        frame = np.minimum.accumulate(frame[::-1])[::-1] + order  # a late stamp is before the next
        near = np.abs(arrival - np.polyval(line, frame)) < 0.5 * line[0]
        if near.mean() < CLOCK.in_phase:
            return None
        line = _regression(frame[near], arrival[near])
    return np.polyval(line, frame), float(line[0]), int(frame[-1] - frame[0]) - (arrival.size - 1)


def _refined(arrival: Floats, period: float) -> float:
    """Return the period at which the stamps' phases agree best, first over short spans, then over long ones.

    Within spans of so many samples the phases are added up as directions; between them only the lengths
    of the sums.
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
    """Return times, period and lost frames by the lower envelope of the delays."""
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
    """Return the delay that counts as none: the mean of a scatter alike to both sides, else its lower end."""
    low, middle, high = np.quantile(delay, [0.05, 0.5, 0.95])
    if high - middle > CLOCK.one_sided * (middle - low):
        return float(np.quantile(delay, 0.02))
    return float(delay.mean())


def _rougher(time: Floats, stamps: Floats, samples: Floats) -> bool:
    """Return whether samples are rougher on a clock than on the stamps, over all channels that move."""
    ratios = []
    for row in samples.T:
        seen = np.isfinite(row)
        if np.count_nonzero(seen) >= CLOCK.fewest:
            on, as_stamped = (_roughness(t[seen], row[seen]) for t in (time, stamps))
            if min(on, as_stamped) > 0:
                ratios.append(np.log(on / as_stamped))
    return bool(ratios and np.exp(np.mean(ratios)) > CLOCK.rougher)


def _roughness(time: Floats, row: Floats) -> float:
    """Return how far samples usually are from the line between their neighbours, noise alike everywhere."""
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = row[1:-1] - (1 - share) * row[:-2] - share * row[2:]
    return float(np.median(np.abs(off) / np.sqrt(1 + share**2 + (1 - share) ** 2)))


def _frames(arrival: Floats, period: float) -> Floats:
    """Return the frame number of each arrival, counting the lost frames."""
    late = arrival - arrival[0] - period * np.arange(arrival.size)
    # Least delay among a sample and the next CLOCK.window: steps up by whole periods where frames were
    # lost.
    padded = np.append(late, np.full(CLOCK.window, np.inf))
    floor = minimum_filter1d(padded, CLOCK.window + 1, origin=-(CLOCK.window // 2))[: late.size]
    lost = np.concatenate([[0.0], np.cumsum(np.rint(np.diff(floor) / period))])
    lost = np.minimum.accumulate(lost[::-1])[::-1]  # a frame number never falls behind
    frames: Floats = np.arange(arrival.size) + lost - lost[0]
    return frames


def _regression(x: Floats, y: Floats) -> Floats:
    """Return slope and intercept of a straight line; :func:`numpy.polyfit` takes ten times the memory."""
    away = x - x.mean()
    slope = (away @ y) / (away @ away)
    return np.array([slope, y.mean() - slope * x.mean()])


def _line(arrival: Floats, frame: Floats, period: float) -> Floats:
    """Return the times of frames on the line through the undelayed arrivals."""
    offset = arrival - period * frame
    slope, start = 0.0, float(np.median(offset))
    for _ in range(3):
        near = np.abs(offset - start - slope * frame) < 0.1 * period
        if near.sum() > 10:
            slope, start = _regression(frame[near], offset[near])
    line: Floats = start + (period + slope) * frame
    return line
