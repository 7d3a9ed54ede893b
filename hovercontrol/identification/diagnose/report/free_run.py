"""Free runs of a fitted model along its logs: some seconds long, driven by the commands alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.diagnose.evidence.traces import runs_of, simulate_runs
from hovercontrol.identification.engine.fit import Fit


@dataclass(frozen=True, eq=False)
class FreeRun:
    """One log with the free runs of a model.

    Attributes
    ----------
    log : str
    channels : tuple of str
    units : mapping
        Unit of each channel.
    time, measured : ndarray, shapes (n,), (C, n)
        Measured values; NaN where a sample was left out.
    at, simulated : ndarray, shapes (N,), (C, N)
        Times and channels of the runs, one after the other.
    starts : tuple of int
        Index in `at` at which each run begins.
    """

    log: str
    channels: tuple[str, ...]
    units: Mapping[str, str]
    time: Array
    measured: Array
    at: Array
    simulated: Array
    starts: tuple[int, ...]

    __repr__ = short_repr

    @property
    def error(self) -> Array:
        """Simulated minus measured, over the standard deviation of each channel, shape (C, n)."""
        order = np.argsort(self.at, kind="stable")
        there = [np.interp(self.time, self.at[order], y[order]) for y in self.simulated]
        size = [float(np.std(y[np.isfinite(y)])) if np.isfinite(y).any() else 1.0 for y in self.measured]
        return np.asarray((np.array(there) - self.measured) / np.maximum(size, 1e-12)[:, None])

    def keeps_near(self) -> bool:
        """Whether the rms error of the runs is below the standard deviation of each channel."""
        return all(np.mean(e[np.isfinite(e)] ** 2) < 1.0 for e in self.error if np.isfinite(e).any())


def on_rows(fit: Fit, values: Array, log: int) -> tuple[Array, Array]:
    """Return times and values, shape (n, ...), of all rows of one log in order of time.

    Parameters
    ----------
    values : ndarray, shape (K, W, ...)
        Values by row and block.
    """
    rows = fit.problem.rows
    own = (rows.at >= 0) & (rows.log == log)
    order = np.argsort(rows.time[own], kind="stable")
    return rows.time[own][order], values[own][order]


def free_run(fit: Fit, log: int = 0, seconds: float = 5.0) -> FreeRun:
    """Return the free runs of a fitted model along a log, each from the smoothed path.

    Parameters
    ----------
    seconds : float, optional
        Length of a run [s].
    """
    problem = fit.problem
    time, seen = on_rows(fit, np.where(problem.seen, problem.rows.values, np.nan), log)
    runs = list(runs_of(problem, log, seconds))
    at = [problem.rows.time[row, block] for row, block in runs]
    simulated = [channels for _, channels in simulate_runs(problem, fit.p, fit.path, runs)]
    origin = problem.logs[log].origin
    channels = problem.rows.channels
    return FreeRun(
        problem.logs[log].name,
        channels,
        {c: problem.block.signal(c).unit for c in channels},
        time + origin,
        seen.T,
        np.concatenate(at) + origin,
        np.concatenate(simulated, axis=1),
        tuple(np.cumsum([0, *(t.size for t in at[:-1])]).tolist()),
    )
