"""A fitted model's simulation beside the logs, some seconds at a time or all at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.windowed import Windowed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trace:
    """One log beside a simulation.

    Attributes
    ----------
    log : str
    time : ndarray, shape (n,)
        On the log's clock [s].
    channels : tuple of str
    units : mapping
        Of each channel.
    measured, simulated : ndarray, shape (C, n)
        NaN where nothing was measured; `simulated` also where no window lies.
    starts : tuple of float
        Times at which the simulation starts afresh.
    """

    log: str
    time: Array
    channels: tuple[str, ...]
    units: Mapping[str, str]
    measured: Array
    simulated: Array
    starts: tuple[float, ...]

    def rms(self) -> dict[str, float]:
        """Return the root mean square error of each channel in its unit; infinite where it runs away."""
        found = {}
        for c, measured, simulated in zip(self.channels, self.measured, self.simulated, strict=True):
            both = ~np.isnan(measured) & ~np.isnan(simulated)
            with np.errstate(over="ignore"):
                square = float(np.mean((simulated[both] - measured[both]) ** 2)) if both.any() else np.nan
            found[c] = float(np.sqrt(square))
        return found


def traces(near: Fit, length: float = np.inf) -> list[Trace]:
    """Return a fitted model's simulation beside each log.

    Each window starts from the state that `near` has there and then follows the log's commands alone.

    Parameters
    ----------
    near : Fit
        Short windows that say where the states are; its model is simulated.
    length : float, optional
        Of the windows [s]; default: the longest stretch without a break in one.
    """
    data, model, found = near.windowed.data, near.windowed.model, []
    for log, states in zip(data.logs, near.windowed.tracks(), strict=True):
        longest = max(float(log.time[b - 1] - log.time[a]) for a, b in log.segments)
        alone = replace(data, logs=(log,))
        w = Windowed(model, alone, min(length, longest), [states])
        w.set_step(near.p, w.cut.start, near.windowed.pieces)
        residual, _ = w.linearise(near.p, w.cut.start, jacobian=False)
        own = [data.channels.index(c) for c in log.channels]
        simulated = np.full(log.values.shape, np.nan)
        for j, (_, first, stop) in enumerate(w.ranges):
            rows = slice(0, stop - first)
            gap = np.where(w.seen[j, rows], residual[j, rows], np.nan)[:, own].T
            simulated[:, first:stop] = log.values[:, first:stop] - gap
        found.append(
            Trace(
                log.name,
                log.time,
                log.channels,
                {c: near.windowed.block.signal(c).unit for c in log.channels},
                log.values,
                simulated,
                tuple(sorted(float(log.time[first]) for _, first, _ in w.ranges)),
            )
        )
    return found
