"""A fitted model running free beside its logs: some seconds by the commands alone, then afresh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.rows import LONGEST_GAP
from hovercontrol.targets.shoot import shoot

Array = NDArray[np.float64]

#: Longest step between the points of a run [s].
STEP = 0.01


@dataclass(frozen=True, eq=False)
class FreeRun:
    """One log beside the runs of a model.

    Attributes
    ----------
    log : str
    channels : tuple of str
    units : mapping
        Of each channel.
    time, measured : ndarray, shapes (n,), (C, n)
        As measured; NaN where a sample was left out.
    at, simulated : ndarray, shapes (N,), (C, N)
        Times and channels of the runs, one after the other.
    starts : tuple of int
        Where in `at` each begins.
    """

    log: str
    channels: tuple[str, ...]
    units: Mapping[str, str]
    time: Array
    measured: Array
    at: Array
    simulated: Array
    starts: tuple[int, ...]

    @property
    def error(self) -> Array:
        """Simulated minus measured over how much each channel moves (standard deviation), shape (C, n)."""
        order = np.argsort(self.at, kind="stable")
        there = [np.interp(self.time, self.at[order], y[order]) for y in self.simulated]
        size = [float(np.std(y[np.isfinite(y)])) if np.isfinite(y).any() else 1.0 for y in self.measured]
        return np.asarray((np.array(there) - self.measured) / np.maximum(size, 1e-12)[:, None])

    def keeps_near(self) -> bool:
        """Whether runs err in each channel by less than it moves."""
        return all(np.mean(e[np.isfinite(e)] ** 2) < 1.0 for e in self.error if np.isfinite(e).any())


def on_rows(fit: Fit, values: Array, log: int) -> tuple[Array, Array]:
    """Return times and values, shape (n, ...), of all rows of one log in their order.

    Parameters
    ----------
    fit : Fit
    values : ndarray, shape (K, W, ...)
        Row by row of the blocks.
    log : int
    """
    rows = fit.problem.rows
    own = (rows.at >= 0) & (rows.log == log)
    order = np.argsort(rows.time[own], kind="stable")
    return rows.time[own][order], values[own][order]


def free_run(fit: Fit, log: int = 0, seconds: float = 5.0) -> FreeRun:
    """Return a fitted model's runs beside a log, each from the smoothed path.

    Parameters
    ----------
    fit : Fit
    log : int, optional
    seconds : float, optional
        After which a run starts afresh.
    """
    problem = fit.problem
    time, path = on_rows(fit, fit.path, log)
    _, seen = on_rows(fit, np.where(problem.seen, problem.rows.values, np.nan), log)
    first = [0]
    for k in np.flatnonzero(np.diff(time, prepend=time[0]) > 0):
        if time[k] - time[first[-1]] >= seconds or time[k] - time[k - 1] > LONGEST_GAP:
            first.append(int(k))
    ends = [time[k - 1] for k in first[1:]] + [time[-1]]
    kept = [(k, end) for k, end in zip(first, ends, strict=True) if end > time[k]]
    begin = np.array([time[k] for k, _ in kept])
    lasts = np.array([end for _, end in kept])
    N = max(2, int(np.ceil(float((lasts - begin).max()) / STEP)))
    h = (lasts - begin) / N
    t = begin + np.arange(N + 1)[:, None] * h  # (N + 1, W)
    which = np.full(t.size, log)
    parameters = problem.parameters(fit.p)
    u, lagged = problem.commands_at(
        parameters, t[:-1].reshape(1, -1), np.tile(h, N), np.full(N * len(kept), log)
    )
    shape = (1, N, 1, len(kept))
    known = {i: v.reshape(shape) for i, v in lagged.items()}
    start = path[[k for k, _ in kept]].T[:, None, :]
    with np.errstate(all="ignore"):
        x = shoot(
            problem.block, t[None, :-1], np.tile(h, (N, 1)), u.reshape(len(u), *shape), known,
            np.array(parameters)[:, None], start,
        )[:, :, 0]  # fmt: skip
    states = np.moveaxis(x, 1, 0).reshape(x.shape[1], -1)
    found = problem.channels_at(states, parameters, t.ravel(), which).reshape(-1, *t.shape)
    origin = problem.logs[log].origin
    channels = problem.rows.channels
    return FreeRun(
        problem.logs[log].name,
        channels,
        {c: problem.block.signal(c).unit for c in channels},
        time + origin,
        seen.T,
        t.T.ravel() + origin,
        np.swapaxes(found, 1, 2).reshape(len(channels), -1),
        tuple(range(0, t.size, N + 1)),
    )
