"""Where and when a model disagrees: the force and torque it lacks, per mass and inertia, with a band.

Along each window the missing addition to every forced derivative is an Ornstein-Uhlenbeck process of the size
that the misfit takes; the Rauch-Tung-Striebel smoother (AIAA J. 3, 1965) reconstructs it from the residuals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.fit import Fit, forced_states
from hovercontrol.discrepancy.noise import Noise

Array = NDArray[np.float64]

#: Standard errors beyond which the force is there, the shortest stretch [s] worth naming, and how far apart
#: two are [s] that are named as one: a force that changes its sign is not there for a moment.
SEEN, SHORTEST, APART = 3.0, 0.2, 0.5


@dataclass(frozen=True, eq=False)
class Quantity:
    """What a missing force may depend on: a velocity or a command.

    Attributes
    ----------
    name, unit : str
    values : ndarray, shape (n,)
        Velocities as reconstructed; NaN in rows outside all windows.
    is_command : bool
    """

    name: str
    unit: str
    values: Array
    is_command: bool = False


@dataclass(frozen=True, eq=False)
class Missing:
    """What one log says is missing in one equation.

    Attributes
    ----------
    log, equation, unit : str
        ``"a.csv"``, ``"u'"``, ``"m/s^2"``.
    time : ndarray, shape (n,)
        On the log's clock [s].
    force, band : ndarray, shape (n,)
        Per mass (inertia), and its standard error; NaN in rows outside all windows.
    over : tuple of Quantity
        What it may depend on, in the same rows.
    """

    log: str
    equation: str
    unit: str
    time: Array
    force: Array
    band: Array
    over: tuple[Quantity, ...] = ()

    @property
    def segments(self) -> list[tuple[float, float]]:
        """Stretches in which the force is there beyond its band [s], those close together as one."""
        with np.errstate(invalid="ignore"):
            there = np.abs(self.force) > SEEN * self.band
        edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(int), [0]])))
        spans = [(float(self.time[a]), float(self.time[b - 1])) for a, b in edges.reshape(-1, 2)]
        joined: list[tuple[float, float]] = []
        for begin, end in (s for s in spans if s[1] - s[0] >= SHORTEST):
            if joined and begin - joined[-1][1] < APART:
                begin = joined.pop()[0]
            joined.append((begin, end))
        return joined

    @property
    def share(self) -> float:
        """Part of the rows in which the force is there."""
        with np.errstate(invalid="ignore"):
            return float(np.nanmean(np.abs(self.force) > SEEN * self.band))

    @property
    def rms(self) -> float:
        """Root mean square of the force."""
        return math.sqrt(float(np.nanmean(self.force**2)))


def localize(fit: Fit, noise: Noise) -> list[Missing]:
    """Return the force that each equation lacks, by log and equation.

    Parameters
    ----------
    fit : Fit
        Of the model whose disagreement is sought.
    noise : Noise
        With the size and correlation time of what is missing (:func:`..noise.estimate`).
    """
    w, r = fit.windowed, fit.response
    forced = forced_states(fit)
    left = fit.left
    W, K, C = left.shape
    n, m = len(w.free), len(forced)
    level = np.maximum(noise.process[forced], 1e-9)
    P0 = np.zeros((n + m, n + m))
    P0[range(n), range(n)] = [(1e3 * w.block.states[i].nominal) ** 2 for i in w.free]
    P0[range(n), range(n)] = np.minimum(np.diag(P0)[:n], 1e2)
    P0[range(n, n + m), range(n, n + m)] = level**2
    fade = np.exp(-r.dt / noise.seconds)
    R = np.diag(w.data.noise**2)
    P, s = np.broadcast_to(P0, (W, n + m, n + m)).copy(), np.zeros((W, n + m, 1))
    kept: list[tuple[Array, Array, Array, Array, Array]] = []
    F = np.zeros((W, n + m, n + m))
    H = np.zeros((W, C, n + m))
    for k in range(K):
        if k:
            F[:, :n, :n], F[:, :n, n:] = r.A[k - 1], r.B[k - 1][..., forced]
            F[:, n:, n:] = fade[k - 1][:, None, None] * np.eye(m)
            s = F @ s
            P = F @ P @ F.swapaxes(1, 2)
            P[:, n:, n:] += (1 - fade[k - 1] ** 2)[:, None, None] * np.diag(level**2)
        before = (s, P)
        H[:, :, :n] = r.C[k]
        G = P @ H.swapaxes(1, 2)
        gain = G @ np.linalg.inv(H @ G + R)
        s = s + gain @ (left[:, k, :, None] - H @ s)
        P = P - gain @ G.swapaxes(1, 2)
        P = 0.5 * (P + P.swapaxes(1, 2))
        kept.append((s, P, *before, F.copy()))
    force, band, off = np.empty((W, K, m)), np.empty((W, K, m)), np.empty((W, K, m))
    for k in reversed(range(K)):
        here, cov = kept[k][0], kept[k][1]
        if k < K - 1:
            ahead, ahead_cov, step = kept[k + 1][2], kept[k + 1][3], kept[k + 1][4]
            back = cov @ step.swapaxes(1, 2) @ np.linalg.pinv(ahead_cov, hermitian=True)
            here = here + back @ (s - ahead)
            cov = cov + back @ (P - ahead_cov) @ back.swapaxes(1, 2)
        s, P = here, cov
        force[:, k], off[:, k] = s[:, n:, 0], s[:, forced, 0]
        band[:, k] = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2)[:, n:], 0.0))
    return _by_log(fit, forced, force, band, off)


def _by_log(fit: Fit, forced: list[int], force: Array, band: Array, off: Array) -> list[Missing]:
    w = fit.windowed
    found = []
    for i, (log, track) in enumerate(zip(w.data.logs, w.tracks(), strict=True)):

        def rows(values: Array, i: int = i, size: int = log.time.size) -> Array:
            whole = np.full((size, len(forced)), np.nan)
            for j, (owner, first, stop) in enumerate(w.ranges):
                if owner == i:
                    whole[first:stop] = values[j, : stop - first]
            return whole.T

        signals = [w.block.states[w.free[k]] for k in forced]
        moving = rows(off) + track[[w.free[k] for k in forced]]  # simulated, and by how much that is off
        over = [Quantity(s.name, s.unit, values) for s, values in zip(signals, moving, strict=True)]
        over += [
            Quantity(s.name, s.unit, log.inputs[k], is_command=True) for k, s in enumerate(w.block.inputs)
        ]
        for s, values, errors in zip(signals, rows(force), rows(band), strict=True):
            found.append(Missing(log.name, f"{s.name}'", rate(s.unit), log.time, values, errors, tuple(over)))
    return found


def rate(unit: str) -> str:
    """Return the unit of a derivative.

    Examples
    --------
    >>> rate("m/s"), rate("rad")
    ('m/s^2', 'rad/s')
    """
    return f"{unit.removesuffix('/s')}/s^2" if unit.endswith("/s") else f"{unit}/s"
