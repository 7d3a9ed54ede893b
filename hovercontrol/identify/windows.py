"""Where logs are cut into windows, and how noisy their channels are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.errors import InputError
from hovercontrol.identify.measure import Array, Measured, steps
from hovercontrol.logs import Log

#: Fewest rows in a window.
FEWEST = 4


def windows(logs: Sequence[Measured], length: float) -> list[tuple[int, int, int]]:
    """Cut all logs into windows of about `length` seconds that cross no break.

    Returns
    -------
    list of (int, int, int)
        Index of the log, first row, row behind the last. Stretches shorter than half a window are
        left out.

    Raises
    ------
    InputError
        If no log holds a window.
    """
    found = []
    for i, log in enumerate(logs):
        for first, stop in log.segments:
            time = log.time[first:stop]
            span = time[-1] - time[0]
            count = max(1, min(round(span / length), (stop - first) // FEWEST))
            if span < length / 2 or stop - first < FEWEST:
                continue
            edges = np.searchsorted(time, time[0] + span * np.arange(1, count) / count)
            bounds = [0, *edges.tolist(), stop - first]
            found += [(i, first + a, first + b) for a, b in pairwise(bounds) if b - a >= FEWEST]
    if not found:
        spans = (log.time[b - 1] - log.time[a] for log in logs for a, b in log.segments)
        names = ", ".join(log.name for log in logs)
        raise InputError(
            f"{names}: too short for a window of {length:g} s: the longest stretch without a "
            f"break is {max(spans, default=0.0):.3g} s"
        )
    return found


def refuse_slow_rows(logs: Sequence[Log | Measured], length: float) -> None:
    """Refuse logs of which a window holds too few rows; hardly one, and time is hardly in seconds.

    Raises
    ------
    InputError
        The line names the log.
    """
    for log in logs:
        apart = float(np.median(np.diff(log.time))) if log.time.size > 1 else 0.0
        if apart > length:
            raise InputError(
                f"{log.name}: rows are {apart:g} s apart, more than a window of {length:g} s: is its time in "
                "seconds? Otherwise choose a longer window"
            )
        if FEWEST * apart > 1.001 * length:
            raise InputError(
                f"{log.name}: rows are {apart:.3g} s apart: a window of {length:g} s is shorter than "
                f"{FEWEST} of them; choose one of {FEWEST * apart:.3g} s or more (--window)"
            )


def thin(ranges: list[tuple[int, int, int]], most_rows: int) -> list[tuple[int, int, int]]:
    """Keep windows spread evenly so that no more than `most_rows` rows remain (but one window)."""
    total = sum(stop - first for _, first, stop in ranges)
    if total <= most_rows:
        return ranges
    keep = max(1, int(len(ranges) * most_rows / total))
    return [ranges[int(i)] for i in np.linspace(0, len(ranges) - 1, keep)]


def noise_levels(logs: Sequence[Measured], channels: Sequence[str]) -> Array:
    """Return the measurement noise of each channel, shape (C,), in its unit.

    From third differences, which motion hardly enters: the median of their size over 0.6745
    sqrt(20). An upper estimate where sampling is slow. Not below what the smallest step of the
    channel, its resolution, makes (over sqrt(12)).

    Raises
    ------
    InputError
        If a channel is constant; the line names it.
    """
    levels = []
    for channel in channels:
        spans = [(m, a, b) for m in logs if channel in m.channels for a, b in m.segments]
        rows = [m.values[m.channels.index(channel), a:b] for m, a, b in spans]
        seen = [np.isfinite(row) for row in rows]  # not so in rows that are there for a command only
        times = [m.time[a:b][known] for (m, a, b), known in zip(spans, seen, strict=True)]
        rows = [row[known] for row, known in zip(rows, seen, strict=True)]
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


def _even(time: Array) -> NDArray[np.bool_]:
    """Tell which four rows in a row follow each other evenly: across a missing row motion enters."""
    step = np.diff(time)
    if step.size < 3:
        return np.zeros(0, dtype=bool)
    widest = np.maximum(np.maximum(step[:-2], step[1:-1]), step[2:])
    return widest < 1.5 * float(np.median(step))
