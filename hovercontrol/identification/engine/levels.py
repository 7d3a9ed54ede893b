"""Measurement noise of each channel, from third differences, and its differences between logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.measure import Measured, steps

#: Relative standard error of a noise level from the median of n third differences, times sqrt(n).
LEVEL = 1.65


@dataclass(frozen=True)
class LevelCriteria:
    """When the noise of two logs differs.

    No published source: set by hand, exercised by tests/identification/engine/test_noise.py and
    tests/identification/diagnose/test_levels.py.

    Attributes
    ----------
    unlike : float
        Minimum ratio of noise levels above which each log has its own level.
    sure : float
        Minimum difference of their logarithms in standard errors; both conditions must hold.
    """

    unlike: float = 1.25
    sure: float = 4.0


#: The values in use.
LEVELS = LevelCriteria()


def noise_levels(logs: Sequence[Measured], channels: Sequence[str]) -> Array:
    """Return the standard deviation of the measurement noise of each channel, shape (C,), in its unit.

    The estimate uses third differences, in which motion is small. It is an upper estimate if sampling is
    slow. It is at least the quantisation noise of the channel's resolution.

    Raises
    ------
    InputError
        If a channel is constant; the message names it.
    """
    # Third differences of white noise have the variance (1 + 9 + 9 + 1) sigma^2 = 20 sigma^2. Therefore
    #   sigma = max(median |d^3 y| / (0.6745 sqrt(20)), q / sqrt(12)), q the smallest change of the channel
    levels = []
    for channel in channels:
        spans = [(m, a, b) for m in logs if channel in m.channels for a, b in m.segments]
        rows, times = zip(*(_seen(m, channel, a, b) for m, a, b in spans), strict=True)
        thirds = [(np.diff(row, 3), _even(time)) for row, time in zip(rows, times, strict=True)]
        jumps = np.abs(np.concatenate([third[even if even.any() else ...] for third, even in thirds]))
        every = np.concatenate(rows)
        jumped = np.concatenate([steps(row) for row in rows])
        if not jumped.size:
            names = ", ".join(m.name for m in logs if channel in m.channels)
            raise InputError(f"{names}: column {channel!r} is constant; is it measured?")
        level = float(np.median(jumps)) / (0.6745 * np.sqrt(20.0)) if jumps.size else 0.0
        levels.append(max(level, 1e-6 * float(np.nanstd(every)), float(jumped.min()) / np.sqrt(12.0), 1e-12))
    return np.array(levels)


def _seen(log: Measured, channel: str, begin: int, end: int) -> tuple[Array, Array]:
    """Return the samples of a channel between two rows, and their times; rows without one are skipped."""
    row = log.values[log.channels.index(channel), begin:end]
    own = np.isfinite(row)
    return row[own], log.time[begin:end][own]


def noise_scales(logs: Sequence[Measured], channels: Sequence[str], noise: Array) -> Array:
    """Return the noise of each log relative to that of all logs, shape (L, C); 1 if the logs do not differ.

    Parameters
    ----------
    noise : ndarray, shape (C,)
        Noise level of all logs together.
    """
    scales = np.ones((len(logs), len(channels)))
    for c, channel in enumerate(channels):
        own = [i for i, m in enumerate(logs) if channel in m.channels]
        found = [_level(logs[i], channel) for i in own]
        known = [(i, level, error) for i, (level, error) in zip(own, found, strict=True) if level > 0.0]
        if len(known) < 2:
            continue
        # The largest and smallest level of relative standard errors e1, e2 differ if
        #   log(most / least) > max(log(unlike), sure * sqrt(e1^2 + e2^2))
        (_, least, one), (_, most, other) = (f(known, key=lambda k: k[1]) for f in (min, max))
        if np.log(most / least) > max(np.log(LEVELS.unlike), LEVELS.sure * np.hypot(one, other)):
            for i, level, _ in known:
                scales[i, c] = level / noise[c]
    return scales


def unlike(channels: Sequence[str], scales: Array) -> list[str]:
    """Return one line of text if the logs differ in noise, else an empty list.

    Parameters
    ----------
    scales : ndarray, shape (L, C)
        Result of :func:`noise_scales`.

    Examples
    --------
    >>> unlike(["u", "r"], np.array([[0.5, 1.0], [2.0, 1.0]]))
    ['the logs differ in noise (u: up to 4 times): each counts by its own']
    """
    times = scales.max(axis=0) / scales.min(axis=0)
    said = [f"{c}: up to {t:.2g} times" for c, t in zip(channels, times, strict=True) if t > 1.0]
    return [f"the logs differ in noise ({', '.join(said)}): each counts by its own"] if said else []


def _level(log: Measured, channel: str) -> tuple[float, float]:
    """Return the noise of one channel and its relative standard error; both are 0 if it is constant."""
    row = log.values[log.channels.index(channel)]
    try:
        return float(noise_levels([log], [channel])[0]), LEVEL / np.sqrt(max(np.isfinite(row).sum(), 1))
    except InputError:
        return 0.0, 0.0


def _even(time: Array) -> NDArray[np.bool_]:
    """Return which groups of four consecutive rows are evenly spaced.

    Across a missing row, motion enters the third difference.
    """
    step = np.diff(time)
    if step.size < 3:
        return np.zeros(0, dtype=bool)
    widest = np.maximum(np.maximum(step[:-2], step[1:-1]), step[2:])
    return widest < 1.5 * float(np.median(step))
