"""Rows of the logs, arranged in blocks for the filter.

Each log is cut into disjoint blocks, whose evidence is compared later. A gap does not end a block: rows
without a measurement fill it, and the model predicts across it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array, Indices
from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.measure import Measured


@dataclass(frozen=True)
class Blocking:
    """How logs are cut into blocks.

    No published source: set by hand, exercised by tests/identification/engine/test_rows.py.

    Attributes
    ----------
    least_blocks : int
        Smallest number of blocks of all logs together, so that their scatter can be estimated.
    most_blocks : int
        Largest number of blocks.
    seconds : float
        Length of a block [s].
    rows : int
        Length of a block of a slowly sampled log in rows.
    stretch : int
        Smallest number of rows of a stretch that a longer block is split into.
    fewest : int
        Smallest number of rows of a block.
    long_step : float
        Time step, relative to the median one, above which rows without a measurement are inserted.
    longest_gap : float
        Longest gap within a block [s].
    gap_steps : float
        Longest gap within a block in median time steps. A gap that exceeds both ends a block.
    """

    least_blocks: int = 8
    most_blocks: int = 24
    seconds: float = 2.5
    rows: int = 30
    stretch: int = 240
    fewest: int = 12
    long_step: float = 2.5
    longest_gap: float = 2.0
    gap_steps: float = 20.0


#: The values in use.
BLOCKING = Blocking()


@dataclass(frozen=True, eq=False)
class Rows:
    """W stretches of up to K rows; shorter ones are padded with their last row.

    A stretch that another one follows ends with a row without measurements at the time at which that one
    begins, so that the filter runs on from stretch to stretch.

    Attributes
    ----------
    time : ndarray, shape (K, W)
        Time since the start of the log of each stretch [s].
    values : ndarray, shape (K, W, C)
        Measurements; NaN where there is none.
    guess : dict of str to ndarray, shape (K, W)
        Initial guess of the states that the logs tell, by name.
    log : ndarray of int, shape (W,)
        Log of each stretch.
    block : ndarray of int, shape (W,)
        Block of each stretch. Long blocks consist of several stretches.
    piece : ndarray of int, shape (W,)
        Unbroken piece of a log of each stretch. A very long gap or the end of a trial ends a piece.
    follows : ndarray of bool, shape (W,)
        Stretches that begin at the end of the one before: all of a piece except its first.
    block_log : ndarray of int, shape (B,)
        Log of each block.
    at : ndarray of int, shape (K, W)
        Row of the log; -1 where there is none.
    channels : tuple of str
    """

    time: Array
    values: Array
    guess: dict[str, Array]
    log: Indices
    block: Indices
    piece: Indices
    follows: NDArray[np.bool_]
    block_log: Indices
    at: Indices
    channels: tuple[str, ...]

    def joined(self, path: Array) -> Array:
        """Return a path, (K, W, ...), in which each stretch ends where the one that follows it begins."""
        path, lengths = path.copy(), self.lengths
        for w in (np.flatnonzero(self.follows) - 1).tolist():
            path[lengths[w] :, w] = path[0, w + 1]
        return path

    @property
    def lengths(self) -> Indices:
        """Number of rows of each stretch, without padding and the begin of the next stretch, shape (W,)."""
        rows = 1 + np.count_nonzero(np.diff(self.time, axis=0) > 0, axis=0)
        return np.asarray(rows - np.append(np.diff(self.piece) == 0, False))

    @property
    def seconds(self) -> Array:
        """Length of each block [s], shape (B,)."""
        return self.by_block(self.time[-1] - self.time[0])

    def by_block(self, values: Array) -> Array:
        """Return the sums over the stretches of each block, (W, ...) to (B, ...)."""
        found = np.zeros((len(self.block_log), *values.shape[1:]))
        np.add.at(found, self.block, values)
        return found


def arrange(
    logs: Sequence[Measured],
    states: Sequence[Mapping[str, Array]],
    channels: Sequence[str],
    period: float = 0.0,
    tempo: float = 1.0,
) -> Rows:
    """Cut logs into blocks.

    Parameters
    ----------
    states : sequence of dict of str to ndarray, shape (n,)
        Finite guess of the states at all rows of each log, by name.
    period : float, optional
        Sampling period of a sampled model [s]: each of its ticks becomes a row.
    tempo : float, optional
        By which lengths of time are multiplied.

    Raises
    ------
    InputError
        If no log has enough rows.
    """
    pieces = [(i, a, b) for i, log in enumerate(logs) for a, b in _pieces(log, tempo)]
    total = sum(logs[i].time[b - 1] - logs[i].time[a] for i, a, b in pieces)
    count = min(total / (BLOCKING.seconds * tempo), sum(b - a for _, a, b in pieces) / BLOCKING.rows)
    blocks = int(np.clip(round(count), BLOCKING.least_blocks, BLOCKING.most_blocks))
    grids: list[tuple[int, Array, Indices]] = []
    block: list[int] = []
    piece: list[int] = []
    block_log: list[int] = []
    for number, (i, a, b) in enumerate(pieces):
        time, at = _grid(logs[i], a, b, period)
        share = (time[-1] - time[0]) / max(total, 1e-300)
        own = int(np.clip(round(blocks * share), 1, max(time.size // BLOCKING.fewest, 1)))
        edges = np.searchsorted(time, np.linspace(time[0], time[-1], own + 1)[1:-1])
        for block_time, block_at in zip(np.split(time, edges), np.split(at, edges), strict=True):
            if block_time.size < 2:
                continue
            parts = max(1, block_time.size // BLOCKING.stretch)
            for t, rows in zip(
                np.array_split(block_time, parts), np.array_split(block_at, parts), strict=True
            ):
                grids.append((i, t, rows))
                block.append(len(block_log))
                piece.append(number)
            block_log.append(i)
    if not grids:
        said = ", ".join(log.name for log in logs)
        raise InputError(f"{said}: too few rows: no stretch of {BLOCKING.fewest} follows on")
    of, number_of, from_log = (np.array(a, dtype=np.intp) for a in (block, piece, block_log))
    follows = np.diff(number_of, prepend=-1) == 0
    for w in (np.flatnonzero(follows) - 1).tolist():
        i, t, rows = grids[w]
        grids[w] = i, np.append(t, grids[w + 1][1][0]), np.append(rows, -1)
    times, places, values, guess = _filled(grids, logs, states, channels)
    owner = np.array([i for i, _, _ in grids], dtype=np.intp)
    return Rows(times, values, guess, owner, of, number_of, follows, from_log, places, tuple(channels))


def _filled(
    grids: Sequence[tuple[int, Array, Indices]],
    logs: Sequence[Measured],
    states: Sequence[Mapping[str, Array]],
    channels: Sequence[str],
) -> tuple[Array, Indices, Array, dict[str, Array]]:
    """Return times, rows of the logs, measured values and guessed states, filled to one length."""
    K, W = max(t.size for _, t, _ in grids), len(grids)
    times, places = np.empty((K, W)), np.full((K, W), -1, dtype=np.intp)
    values = np.full((K, W, len(channels)), np.nan)
    names = [name for name in states[0] if all(name in s for s in states)]
    guess = {name: np.empty((K, W)) for name in names}
    for w, (i, t, rows) in enumerate(grids):
        log, n = logs[i], t.size
        times[:n, w], times[n:, w] = t - log.origin, t[-1] - log.origin
        places[:n, w] = rows
        there = rows >= 0
        for c, channel in enumerate(channels):
            if channel in log.channels:
                row = log.values[log.channels.index(channel)]
                values[:n, w, c] = np.where(there, row[np.maximum(rows, 0)], np.nan)
        for name in names:
            guess[name][:n, w] = np.interp(t, log.time, states[i][name])
            guess[name][n:, w] = guess[name][n - 1, w]
    return times, places, values, guess


def _pieces(log: Measured, tempo: float) -> list[tuple[int, int]]:
    """Return first row and end (exclusive) of the parts of each trial between very long gaps."""
    seen = np.flatnonzero(np.isfinite(log.values).any(axis=0))
    if seen.size < 2:
        return []
    step = np.diff(log.time[seen])
    far = step > max(BLOCKING.longest_gap * tempo, BLOCKING.gap_steps * float(np.median(step)))
    far[np.searchsorted(seen, [start for start in log.starts if seen[0] < start <= seen[-1]]) - 1] = True
    parts = np.split(seen, np.flatnonzero(far) + 1)
    return [(int(p[0]), int(p[-1]) + 1) for p in parts if p.size >= BLOCKING.fewest]


def _grid(log: Measured, first: int, stop: int, period: float) -> tuple[Array, Indices]:
    """Return times and rows of a part; long steps are filled with times that have no row (-1).

    All steps of more than one period are long for a sampled model.
    """
    time = log.time[first:stop]
    step = np.diff(time)
    usual = period or float(np.median(step))
    long = 1.5 if period else BLOCKING.long_step
    times, rows = [time[:1]], [np.array([first], dtype=np.intp)]
    for k, dt in enumerate(step.tolist()):
        if dt > long * usual:
            extra = time[k] + dt * np.arange(1, round(dt / usual)) / round(dt / usual)
            times.append(extra)
            rows.append(np.full(extra.size, -1, dtype=np.intp))
        times.append(time[k + 1 : k + 2])
        rows.append(np.array([first + k + 1], dtype=np.intp))
    return np.concatenate(times), np.concatenate(rows)
