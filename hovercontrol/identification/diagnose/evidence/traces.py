"""Simulations of a fitted model along the logs, in short runs or over whole logs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array, Indices
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.backends.shoot import shoot
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.evidence.remainder import missing_forces
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.problem import STEP, Problem
from hovercontrol.identification.engine.rows import BLOCKING


@dataclass(frozen=True, eq=False)
class Trace:
    """One log with a simulation.

    Attributes
    ----------
    log : str
    time : ndarray, shape (n,)
        On the log's clock [s].
    channels : tuple of str
    units : mapping
        Of each channel.
    measured, simulated : ndarray, shape (C, n)
        NaN where nothing was measured; `simulated` also in rows outside all blocks.
    starts : tuple of float
        Times at which the simulation is restarted from the smoothed path [s].
    missing : tuple of Missing
        The smoothed missing force in the same rows, by equation.
    """

    log: str
    time: Array
    channels: tuple[str, ...]
    units: Mapping[str, str]
    measured: Array
    simulated: Array
    starts: tuple[float, ...]
    missing: tuple[Missing, ...] = ()

    __repr__ = short_repr

    def rms(self) -> dict[str, float]:
        """Return the root mean square error of each channel in its unit; infinite if it diverges."""
        found = {}
        for c, measured, simulated in zip(self.channels, self.measured, self.simulated, strict=True):
            both = ~np.isnan(measured) & ~np.isnan(simulated)
            with np.errstate(over="ignore"):
                square = float(np.mean((simulated[both] - measured[both]) ** 2)) if both.any() else np.nan
            found[c] = float(np.sqrt(square))
        return found


def simulated_traces(fit: Fit, seconds: float = np.inf) -> tuple[Trace, ...]:
    """Return the simulation of a fitted model along each log.

    It starts from the smoothed path and is driven by the commands of the log alone.

    Parameters
    ----------
    seconds : float, optional
        Length of a run before a restart [s]; default: restart only where a log was interrupted.
    """
    missing = missing_forces(fit)
    return tuple(_trace(fit, k, seconds, missing) for k in range(len(fit.problem.logs)))


def _trace(fit: Fit, k: int, seconds: float, missing: tuple[Missing, ...]) -> Trace:
    problem, log = fit.problem, fit.problem.logs[k]
    own = [problem.rows.channels.index(c) for c in log.channels]
    measured, simulated = (np.full((len(own), log.time.size), np.nan) for _ in range(2))
    runs = list(runs_of(problem, k, seconds))
    for (row, block), (_, values) in zip(runs, simulate_runs(problem, fit.p, fit.path, runs), strict=True):
        at = problem.rows.at[row, block]
        there = at >= 0
        simulated[:, at[there]] = values[own][:, there]
        seen = problem.rows.values[row, block][:, own].T
        measured[:, at[there]] = seen[:, there]
    return Trace(
        log.name,
        log.time,
        log.channels,
        {c: problem.block.signal(c).unit for c in log.channels},
        measured,
        simulated,
        tuple(float(problem.rows.time[row[0], block[0]] + log.origin) for row, block in runs),
        tuple(m for m in missing if m.log == log.name),
    )


def runs_of(problem: Problem, k: int, seconds: float = np.inf) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows and blocks of each run over a log, in order of time.

    Parameters
    ----------
    k : int
        Index of the log.
    seconds : float, optional
        Length of a run [s]; a long gap also ends a run.
    """
    blocks = np.flatnonzero(problem.rows.log == k)
    time = problem.rows.time
    lengths = problem.rows.lengths[blocks]
    row = np.concatenate([np.arange(n) for n in lengths]).astype(np.intp)
    block = np.repeat(blocks, lengths)
    t = time[row, block]
    far = max(BLOCKING.longest_gap * problem.tempo, BLOCKING.gap_steps * problem.shortest)
    begin = 0
    for j in range(1, t.size + 1):
        if j == t.size or t[j] - t[j - 1] > far or t[j] - t[begin] >= seconds - 0.5 * problem.shortest:
            if j - begin > 1:
                yield row[begin:j], block[begin:j]
            begin = j


def simulate_runs(
    problem: Problem, p: Array, path: Array, runs: Sequence[tuple[Indices, Indices]]
) -> list[tuple[Array, Array]]:
    """Return states and channels along each run, shapes (n_states, n) and (C, n).

    All runs are simulated in parallel.

    Parameters
    ----------
    p : ndarray, shape (P,)
        Unknowns.
    path : ndarray, shape (K, W, n_states)
        Path from which each run starts.
    runs : sequence of (ndarray of int, ndarray of int)
        Rows and blocks, from :func:`runs_of`.
    """
    parameters = problem.parameters(p)
    M, N = max(row.size for row, _ in runs), len(runs)
    t = np.empty((M, N))
    for j, (row, block) in enumerate(runs):
        t[: row.size, j] = problem.rows.time[row, block]
        t[row.size :, j] = t[row.size - 1, j]
    start = np.stack([path[row[0], block[0]] for row, block in runs], axis=-1)
    log = np.array([problem.rows.log[block[0]] for _, block in runs])
    dt = np.diff(t, axis=0)
    S = (
        1
        if problem.period
        else max(problem.usual_pieces, math.ceil(float(dt.max()) / (STEP * problem.tempo) - 1e-9))
    )
    h = dt / S
    begin = t[:-1] + np.arange(S)[:, None, None] * h
    every = np.tile(log, M - 1)
    u, lagged = problem.inputs.between(parameters, begin.reshape(S, -1), h.ravel(), every)
    states = shoot(
        problem.block,
        begin,
        h,
        u.reshape(-1, S, M - 1, N),
        {i: v.reshape(S, M - 1, N) for i, v in lagged.items()},
        parameters,
        start,
        euler=problem.euler,
    )
    x = np.moveaxis(states, 1, 0).reshape(states.shape[1], -1)
    with np.errstate(all="ignore"):
        found = problem.channels_at(x, parameters, t.ravel(), np.tile(log, M)).reshape(-1, M, N)
    return [(states[: row.size, :, j].T, found[:, : row.size, j]) for j, (row, _) in enumerate(runs)]
