"""Logs in terms of a model's Block: measured channels in blocks, their noise, and a guess of the states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.identification.engine.drift import DriftStates, drift_states
from hovercontrol.identification.engine.levels import noise_levels, noise_scales
from hovercontrol.identification.engine.measure import Measured, measure_all
from hovercontrol.identification.engine.navigation import measure_navigated
from hovercontrol.identification.engine.rows import Rows, arrange
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.identification.engine.tempo import tempo_of
from hovercontrol.identification.engine.ticks import on_ticks
from hovercontrol.logs import Log

#: Maximum number of rows used of each log.
MOST_ROWS = 60_000

#: Number of rows to either side for the central difference of a measured state.
REACH = 3

#: Length in rows of the median filter of the first guess of a measured state. It removes single outliers.
DESPIKE = 5

#: A trial begins in motion if a speed is there beyond this part of its root mean square. Then the samples of
#: so many seconds are left out (the longest delay that is tried), at most this part of the trial.
REST, SETTLED, SHARE = 0.2, 0.15, 0.05


@dataclass(frozen=True, eq=False)
class Data:
    """Logs in terms of a model's Block.

    Attributes
    ----------
    logs : tuple of Measured
    channels : tuple of str
        All channels that were measured in any log.
    noise : ndarray, shape (C,)
        Initial estimate of the measurement noise, from third differences.
    scales : ndarray, shape (L, C)
        Noise of each log relative to that of all logs.
    rows : Rows
    drift : DriftStates or None
        Errors of the velocities of an inertial navigation.
    variance : ndarray, shape (K, W, C), or None
        Noise variance of each sample relative to that of its channel; None if all are 1.
    hidden : tuple of str
        States whose guess is what a model makes of the logs (:meth:`seen_through`).
    tempo : float
        By which all lengths of time are multiplied (:mod:`.tempo`).
    """

    logs: tuple[Measured, ...]
    channels: tuple[str, ...]
    noise: Array
    scales: Array
    rows: Rows
    drift: DriftStates | None = None
    variance: Array | None = None
    hidden: tuple[str, ...] = ()
    tempo: float = 1.0

    def seen_through(self, guess: Mapping[str, Array]) -> Data:
        """Return the data with a model's guess of hidden states, by name, each of shape (K, W)."""
        return replace(self, rows=replace(self.rows, guess={**self.rows.guess, **guess}), hidden=tuple(guess))

    def without(self, samples: NDArray[np.bool_]) -> Data:
        """Return the data without some samples, a mask of shape (K, W, C)."""
        values = np.where(samples, np.nan, self.rows.values)
        return replace(self, rows=replace(self.rows, values=values))

    @property
    def joined(self) -> Data:
        """The data with the filter running on from stretch to stretch of a piece, as feedback asks."""
        return replace(self, rows=replace(self.rows, follows=np.diff(self.rows.piece, prepend=-1) == 0))

    @property
    def down_weighted(self) -> NDArray[np.bool_]:
        """Samples whose variance is larger than that of their channel, a mask of shape (K, W, C)."""
        if self.variance is None:
            return np.zeros(self.rows.values.shape, dtype=bool)
        return np.asarray(np.isfinite(self.rows.values) & (self.variance > 1.0))


def gather(model: Subject, logs: Sequence[Log | Measured]) -> Data:
    """Return the measurements of logs in terms of a model's Block.

    Raises
    ------
    InputError
        If an input is missing or out of its bounds, no state or output of the model was measured, or no log
        has enough rows.
    """
    block = structure(model)
    every = [(isinstance(log, Log) and measure_navigated(block, log)) or log for log in logs]
    measured = tuple(measure_all(block, every, MOST_ROWS))
    if model.period:
        measured = tuple(on_ticks(log, model.period) for log in measured)
    channels = tuple(dict.fromkeys(c for m in measured for c in m.channels))
    noise = noise_levels(measured, channels)
    scales = noise_scales(measured, channels, noise)
    tempo = tempo_of(measured, is_craft=model.is_craft)
    measured = tuple(_settled(model, block, m, tempo) for m in measured)
    rows = arrange(measured, [_guess(block, m) for m in measured], channels, model.period, tempo)
    rows = replace(rows, follows=np.zeros_like(rows.follows))
    return Data(measured, channels, noise, scales, rows, drift_states(measured, rows), tempo=tempo)


def _settled(model: Subject, block: Block, log: Measured, tempo: float) -> Measured:
    """Return a log without the samples that commands from before it may have moved.

    These are the first ones of each trial that begins in motion: any state on which forces act is there
    beyond :data:`REST` of its root mean square. A trial that begins at rest had no commands before.
    """
    own = {s.symbol for s in (*block.parameters, *block.inputs)}
    guess, values, moving = _guess(block, log), log.values.copy(), list[int]()
    speeds = [
        guess[n] for n in model.motion if n in guess and block.expand(block.derivatives[n]).free_symbols & own
    ]
    for first, stop in pairwise([0, *log.starts, log.time.size] if block.inputs else []):
        if any(abs(v[first]) > REST * float(np.sqrt(np.mean(v**2))) for v in speeds):
            time = log.time[first:stop] - log.time[first]
            values[:, first:stop][:, time < min(SETTLED * tempo, SHARE * float(time[-1]))] = np.nan
            moving.append(first)
    return replace(log, moving=tuple(moving), values=values) if moving else log


def _guess(block: Block, log: Measured) -> dict[str, Array]:
    """Return a guess of the states: median-filtered measurements, or differences of measured states."""
    names = [s.name for s in block.states]
    known = {name: row for name, row in zip(names, log.states, strict=False) if np.isfinite(row).all()}
    for name in [n for n in known if n in log.channels]:
        known[name] = median_filter(known[name], size=DESPIKE, mode="nearest")
    at = np.arange(log.time.size)
    before, after = np.maximum(at - REACH, 0), np.minimum(at + REACH, at[-1])
    symbols = [s.symbol for s in block.states]
    # x_i = x_j' by central differences: (x_j(k + REACH) - x_j(k - REACH)) / (t(k + REACH) - t(k - REACH))
    for i, j in _slopes(block, symbols):
        if names[j] in known and names[i] not in known:
            rise = known[names[j]][after] - known[names[j]][before]
            known[names[i]] = rise / np.maximum(log.time[after] - log.time[before], 1e-12)
    return known


def _slopes(block: Block, symbols: Sequence[object]) -> list[tuple[int, int]]:
    """Return pairs (i, j) of states with ``x_j' = x_i``, such as ``position' = velocity``."""
    slopes = [block.expand(block.derivatives[s.name]) for s in block.states]
    return [(symbols.index(e), j) for j, e in enumerate(slopes) if e in symbols]
