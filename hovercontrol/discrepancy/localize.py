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

#: Standard errors beyond which the force is there, and the shortest stretch [s] worth naming.
SEEN, SHORTEST = 3.0, 0.2

#: Below this part of its root mean square a quantity counts as standing still.
STILL = 0.1


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
    """

    log: str
    equation: str
    unit: str
    time: Array
    force: Array
    band: Array

    @property
    def segments(self) -> list[tuple[float, float]]:
        """Stretches in which the force is there beyond its band [s]."""
        with np.errstate(invalid="ignore"):
            there = np.abs(self.force) > SEEN * self.band
        edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(int), [0]])))
        spans = [(float(self.time[a]), float(self.time[b - 1])) for a, b in edges.reshape(-1, 2)]
        return [s for s in spans if s[1] - s[0] >= SHORTEST]

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
    force, band = np.empty((W, K, m)), np.empty((W, K, m))
    for k in reversed(range(K)):
        here, cov = kept[k][0], kept[k][1]
        if k < K - 1:
            ahead, ahead_cov, step = kept[k + 1][2], kept[k + 1][3], kept[k + 1][4]
            back = cov @ step.swapaxes(1, 2) @ np.linalg.pinv(ahead_cov, hermitian=True)
            here = here + back @ (s - ahead)
            cov = cov + back @ (P - ahead_cov) @ back.swapaxes(1, 2)
        s, P = here, cov
        force[:, k] = s[:, n:, 0]
        band[:, k] = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2)[:, n:], 0.0))
    return _by_log(fit, forced, force, band)


def _by_log(fit: Fit, forced: list[int], force: Array, band: Array) -> list[Missing]:
    w = fit.windowed
    found = []
    for i, log in enumerate(w.data.logs):
        for a, k in enumerate(forced):
            signal = w.block.states[w.free[k]]
            values, errors = np.full(log.time.size, np.nan), np.full(log.time.size, np.nan)
            for j, (owner, first, stop) in enumerate(w.ranges):
                if owner == i:
                    values[first:stop] = force[j, : stop - first, a]
                    errors[first:stop] = band[j, : stop - first, a]
            unit = (
                f"{signal.unit.removesuffix('/s')}/s^2" if signal.unit.endswith("/s") else f"{signal.unit}/s"
            )
            found.append(Missing(log.name, f"{signal.name}'", unit, log.time, values, errors))
    return found


def regime(fit: Fit, missing: list[Missing]) -> str:
    """Return in words where the missing force of the worst equation is: speed, command, standstill.

    Parameters
    ----------
    fit : Fit
    missing : list of Missing
    """
    worst = max(missing, key=lambda m: m.share * m.rms, default=None)
    if worst is None or worst.share < 0.01:
        return "nowhere beyond the noise"
    same = [m for m in missing if m.equation == worst.equation]
    force = np.concatenate([m.force for m in same])
    best, words = 1.5, "all along"
    for text, rows in _regimes(fit):
        inside = rows & np.isfinite(force)
        outside = ~rows & np.isfinite(force)
        if inside.mean() < 0.05 or outside.mean() < 0.05:
            continue
        ratio = float(np.mean(force[inside] ** 2) / max(np.mean(force[outside] ** 2), 1e-300))
        if ratio > best:
            best, words = ratio, text
    return f"in {worst.equation}, {words}"


def _regimes(fit: Fit) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return conditions on states and commands, with words for them."""
    w = fit.windowed
    logs, tracks = w.data.logs, w.tracks()
    found = []
    inputs = [(s.name, np.concatenate([m.inputs[i] for m in logs])) for i, s in enumerate(w.block.inputs)]
    states = [
        (w.block.states[w.free[k]].name, np.concatenate([track[w.free[k]] for track in tracks]))
        for k in forced_states(fit)
    ]
    for name, values in states:
        known = values[np.isfinite(values)]
        size = float(np.sqrt(np.mean(known**2))) if known.size and known.any() else 1.0
        found += [
            (f"where {name} > 0", values > STILL * size),
            (f"where {name} < 0", values < -STILL * size),
            (f"near standstill of {name}", np.abs(values) < STILL * size),
            (f"where {name} is large", np.abs(values) > size),
        ]
    for name, values in inputs:
        size = float(np.sqrt(np.mean(values**2))) or 1.0
        found += [
            (f"where {name} > 0", values > STILL * size),
            (f"where {name} < 0", values < -STILL * size),
            (f"where {name} is large", np.abs(values) > size),
        ]
    time = np.concatenate([(m.time - m.time[0]) / max(m.time[-1] - m.time[0], 1e-9) for m in logs])
    found += [("late in each log", time > 0.5), ("early in each log", time < 0.5)]
    return found
