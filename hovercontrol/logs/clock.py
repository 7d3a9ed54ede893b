"""The steady sampling clock behind jittered arrival times.

A motion-capture system samples at a fixed rate, but a log written over a network stamps each
sample when it arrives: several at once, then none for 0.2 s. Velocities from such stamps are
nonsense (a 0.3 rad turn within 0.1 ms). Each arrival time is ``start + frame * period + delay``
with a delay that is near zero most of the time; the lower envelope of the delays shows the frames
that were lost on the way. Stamps that only scatter, by less than half a period, are counted
step by step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from hovercontrol.logs.log import POSE, Floats, Log, gap_rows

WINDOW = 50
"""Samples within which at least one arrives without delay."""

PUNCTUAL = 0.7
"""Share of stamps within a quarter period of the clock, below which there is none (chance: 0.5)."""

EXACT = 1e-6
"""Of a period: stamps that are this near to the clock are kept as they are."""

FEWEST = 20
"""Stamps from which a clock is fitted."""


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
    """

    time: Floats
    steady: bool
    period: float
    lost: int
    worst_delay: float


def fit_clock(arrival: Floats, pose: Floats | None = None) -> Clock:
    """Fit a steady sampling clock to the time stamps of a log.

    The stamps are kept where they are no arrival times: where there are fewer than ``FEWEST``,
    where too few are ``PUNCTUAL``, or where the pose is smoother on the stamps than on the clock.
    A constant delay cannot be seen and stays.

    Parameters
    ----------
    arrival : ndarray (n,)
        Time stamps [s], strictly increasing.
    pose : ndarray (n, k), optional
        What was sampled.

    Examples
    --------
    >>> arrival = 0.02 * np.arange(100.0)
    >>> arrival[50:55] = 1.0801 + 1e-4 * np.arange(5)  # five samples arrive together
    >>> clock = fit_clock(arrival)
    >>> clock.steady, round(clock.period, 4), round(float(clock.time[50]), 3)
    (True, 0.02, 1.0)
    """
    steps = np.diff(arrival)
    period = float(np.median(steps)) if steps.size else 0.0
    as_stamped = Clock(arrival, False, period, 0, 0.0)
    if arrival.size < FEWEST:
        return as_stamped
    for span in (10, 100):
        if arrival.size > 2 * span:
            strides = arrival[span:] - arrival[:-span]
            whole = np.abs(strides / (span * period) - 1.0) < 0.5 / span
            if whole.any():
                period = float(np.median(strides[whole])) / span
    time = np.empty_like(arrival)
    lost = 0
    for part in np.split(np.arange(arrival.size), gap_rows(arrival)):
        frame = _counted(arrival[part], period)
        if frame is None:
            frame = _frames(arrival[part], period)
            time[part] = _line(arrival[part], frame, period)
        else:
            time[part] = np.polyval(np.polyfit(frame, arrival[part], 1), frame)
        lost += int(frame[-1]) - (part.size - 1)
    delay = arrival - time
    if np.abs(delay).max() < EXACT * period:
        time, delay = arrival, np.zeros_like(arrival)
    if np.mean(np.abs(delay) < 0.25 * period) < PUNCTUAL or not np.all(np.diff(time) > 0):
        return as_stamped
    if pose is not None and _roughness(time, pose) > 1.02 * _roughness(arrival, pose):
        return as_stamped
    return Clock(time, True, period, lost, float(delay.max()))


def steady(log: Log) -> Log:
    """Return the log with arrival times replaced by the steady clock behind them, if any.

    Examples
    --------
    >>> irregular = Log("demo", np.cumsum(1.0 + np.arange(50) % 3), {})
    >>> bool(np.all(steady(irregular).time == irregular.time))
    True
    """
    pose = log.stack(*POSE) if log.has(*POSE) else None
    return replace(log, time=fit_clock(log.time, pose).time)


def _roughness(time: Floats, pose: Floats) -> float:
    """Return how far samples are from the line between their neighbours, averaged over channels."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = pose[1:-1] - (1 - share) * pose[:-2] - share * pose[2:]
    return float(np.exp(np.log(np.abs(off).mean(axis=0) + 1e-12).mean()))


def _counted(arrival: Floats, period: float) -> Floats | None:
    """Return the frame number of each stamp where all scatter by less than half a period, or None."""
    steps = np.rint(np.diff(arrival) / period)
    if arrival.size < 3 or (steps < 1).any():
        return None
    frame: Floats = np.append(0.0, np.cumsum(steps))
    pace, start = np.polyfit(frame, arrival, 1)
    return frame if np.abs(arrival - start - pace * frame).max() < 0.5 * period else None


def _frames(arrival: Floats, period: float) -> Floats:
    """Return the frame number of each arrival, counting the lost frames."""
    late = arrival - arrival[0] - period * np.arange(arrival.size)
    # Least delay among a sample and the next WINDOW: steps up by whole periods where frames were
    # lost.
    padded = np.append(late, np.full(WINDOW, np.inf))
    floor = minimum_filter1d(padded, WINDOW + 1, origin=-(WINDOW // 2))[: late.size]
    lost = np.concatenate([[0.0], np.cumsum(np.rint(np.diff(floor) / period))])
    lost = np.minimum.accumulate(lost[::-1])[::-1]  # a frame number never falls behind
    frames: Floats = np.arange(arrival.size) + lost - lost[0]
    return frames


def _line(arrival: Floats, frame: Floats, period: float) -> Floats:
    """Return the times of frames on the line through the undelayed arrivals."""
    offset = arrival - period * frame
    slope, start = 0.0, float(np.median(offset))
    for _ in range(3):
        near = np.abs(offset - start - slope * frame) < 0.1 * period
        if near.sum() > 10:
            slope, start = np.polyfit(frame[near], offset[near], 1)
    line: Floats = start + (period + slope) * frame
    return line
