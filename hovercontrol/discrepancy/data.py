"""Logs as a model's Block sees them, with the noise of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.levels import noise_scales
from hovercontrol.discrepancy.navigation import Navigated, measure_navigated
from hovercontrol.discrepancy.subject import Subject, structure
from hovercontrol.identify.measure import Measured, measure_all
from hovercontrol.identify.windows import noise_levels
from hovercontrol.logs import Log

Array = NDArray[np.float64]

#: What a command does is unsure for so long after a change whose time is unknown [s]: it may act late.
UNSURE = 0.3


@dataclass(frozen=True, eq=False)
class Data:
    """Logs as a model's Block sees them.

    Attributes
    ----------
    logs : tuple of Measured
    channels : tuple of str
        All that was measured in any.
    noise : ndarray, shape (n_channels,)
        Measurement noise, from third differences.
    pace : float
        How much slower than a hovercraft the machine is; windows are as much longer (:mod:`.ladder`).
    """

    logs: tuple[Measured, ...]
    channels: tuple[str, ...]
    noise: Array
    pace: float = 1.0

    @property
    def duration(self) -> float:
        """Length of the longest log [s]."""
        return max(float(m.time[-1] - m.time[0]) for m in self.logs)

    @property
    def navigated(self) -> bool:
        """Whether a navigation wrote a log."""
        return any(isinstance(m, Navigated) for m in self.logs)

    @cached_property
    def scales(self) -> Array:
        """The noise of each log over that of all, shape (L, C): 1 if alike, or written by a navigation."""
        if self.navigated:
            return np.ones((len(self.logs), len(self.channels)))
        return noise_scales(self.logs, self.channels, self.noise)


def gather(model: Subject, logs: Sequence[Log], most_rows: int = 60_000) -> Data:
    """Return what logs say about a model (:func:`hovercontrol.identify.measure.measure`)."""
    block = structure(model)
    every = [measure_navigated(block, log, most_rows) or log for log in logs]
    measured = tuple(_without_doubtful_steps(m) for m in measure_all(block, every, most_rows))
    channels = tuple(dict.fromkeys(c for m in measured for c in m.channels))
    return Data(measured, channels, noise_levels(measured, channels))


def _without_doubtful_steps(log: Measured) -> Measured:
    """Leave out where a command changed while rows are missing: when it did, and acts, is not known."""
    step = np.diff(log.time)
    gap = step > 1.5 * float(np.median(step))
    changed = (np.diff(log.inputs, axis=1) != 0).any(axis=0)
    at = np.flatnonzero(gap & changed) + 1
    segments = []
    for first, stop in log.segments:
        own = at[(at > first) & (at < stop)]
        known = np.searchsorted(log.time, log.time[own] + UNSURE)
        begins, ends = [first, *known.tolist()], [*own.tolist(), stop]
        segments += [(a, b) for a, b in zip(begins, ends, strict=True) if b - a > 1]
    return replace(log, segments=tuple(segments))
