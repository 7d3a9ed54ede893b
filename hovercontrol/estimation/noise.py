"""Measurement noise and process noise: what a likelihood assumes of all that no equation says.

Process noise is a missing acceleration in each equation on which forces act, of a root mean square and a
correlation time (Ornstein and Uhlenbeck): gusts, bumps and floors last a while. Its size says what a model
lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.drift import STATES
from hovercontrol.estimation.kalman import Smoothed, System, run_filter
from hovercontrol.estimation.problem import Linear, Problem

Array = NDArray[np.float64]

#: Standard deviation of a block's first states about the guess, in parts of how far states range.
LOOSE = 10.0


@dataclass(frozen=True, eq=False)
class Noise:
    """Levels of noise.

    Attributes
    ----------
    measured : ndarray, shape (C,)
        Standard deviation of each channel.
    scale : ndarray, shape (L, C)
        The same of each log over that of all.
    process : ndarray, shape (q,)
        Root mean square of the missing acceleration, by driven state.
    seconds : ndarray, shape (q,)
        Its correlation time.
    """

    measured: Array
    scale: Array
    process: Array
    seconds: Array


def augment(
    problem: Problem,
    linear: Linear,
    noises: list[Noise],
    *,
    unknowns: bool = True,
    drive: Array | None = None,
    seen: Array | None = None,
) -> System:
    """Return the linear system of a problem with its missing accelerations, and drift, as further states.

    Parameters
    ----------
    problem : Problem
    linear : Linear
    noises : list of Noise
        One, or several that run side by side: blocks are repeated for each.
    unknowns : bool, optional
        Whether the unknowns have columns.
    drive, seen : ndarray, shapes (K-1, W, n, M) and (K, W, C, M), optional
        Further columns: what a candidate adds to the states from row to row, and to the channels.
    """
    n, driven, dt = len(problem.free), list(problem.driven), problem.dt
    q, (K, W, C) = len(driven), linear.residual.shape
    drift = problem.data.drift
    N = n + q + (STATES if drift else 0)
    gamma = _gamma(problem, linear.A)
    columns = [linear.defect[..., None]]
    channels = [linear.residual[..., None]]
    if unknowns and linear.B.size:
        columns.append(linear.B)
        channels.append(-linear.D)
    if drive is not None and seen is not None:
        columns.append(drive)
        channels.append(-seen)
    m = sum(c.shape[-1] for c in columns)
    full = np.zeros((K - 1, W, N, m))
    full[..., :n, :] = np.concatenate(columns, axis=-1)
    watched = np.concatenate(channels, axis=-1)
    H = np.zeros((K, W, C, N))
    H[..., :n] = linear.H
    if drift:
        H[..., n + q :] = np.where(problem.seen[..., None], drift.H, 0.0)
    copies = len(noises)
    A = np.zeros((K - 1, copies, W, N, N))
    Q = np.zeros((K - 1, copies, W, N, N))
    R = np.ones((K, copies, W, C))
    P0 = np.zeros((copies, W, N, N))
    P0[..., range(n), range(n)] = (LOOSE * problem.spread) ** 2
    for c, noise in enumerate(noises):
        A[:, c, :, :n, :n] = linear.A
        for j in range(q):
            tau = float(noise.seconds[j])
            s = dt / tau
            fade = np.exp(-s)
            A[:, c, :, :n, n + j] = gamma[..., j] * (tau * -np.expm1(-s))[..., None]
            A[:, c, :, n + j, n + j] = fade
            if noise.process[j] > 0.0:
                pushed, both, own = _covariance(problem, noise, j)
                g = gamma[..., j]
                Q[:, c, :, :n, :n] += g[..., :, None] * (g * pushed[..., None])[..., None, :]
                Q[:, c, :, :n, n + j] = Q[:, c, :, n + j, :n] = g * both[..., None]
                Q[:, c, :, n + j, n + j] = own
            P0[c, :, n + j, n + j] = float(noise.process[j]) ** 2
        if linear.jolt is not None:
            Q[:, c, :, :n, :n] += linear.jolt[..., :, None] * linear.jolt[..., None, :]
        if drift:
            A[:, c, :, n + q :, n + q :] = drift.A
            Q[:, c, :, n + q :, n + q :] = drift.Q
            P0[c, :, n + q :, n + q :] = drift.P0
        level = (noise.measured * noise.scale[problem.rows.log]) ** 2  # W, C
        R[:, c] = np.where(problem.seen, level, 1.0)
    if copies == 1:
        return System(A[:, 0], Q[:, 0], full, H, R[:, 0], watched, P0[0])

    def tiled(a: Array) -> Array:
        return np.tile(a, (1, copies, *(1 for _ in a.shape[2:])))

    return System(
        A.reshape(K - 1, copies * W, N, N),
        Q.reshape(K - 1, copies * W, N, N),
        tiled(full),
        tiled(H),
        R.reshape(K, copies * W, C),
        tiled(watched),
        P0.reshape(copies * W, N, N),
    )


def _integrated(s: Array) -> Array:
    """Return 2 s - 3 + 4 exp(-s) - exp(-2 s), without loss of digits for small s."""
    small = s < 1e-2
    series = s**3 * (2.0 / 3.0 - s / 2.0 + 7.0 * s**2 / 30.0)
    plain = 2.0 * s - 3.0 + 4.0 * np.exp(-s) - np.exp(-2.0 * s)
    return np.where(small, series, plain)


#: A variance moves by at most this factor in a pass; a far ratio that keeps its sign is followed
#: so many times as far.
FARTHEST, ONWARD = 100.0, 2.5

#: Logarithm of such a ratio from which on it is far.
FAR = 0.5

#: Fall of the cost from which on another correlation time is taken.
WORTH_A_STEP = 0.5

#: Missing acceleration below these parts of what is seen is none, or its correlation time does not matter.
NONE, SMALL = 1e-5, 1e-3

#: Measurement noise is no less than these parts of what third differences show and of a channel's range:
#: without any a filter is singular.
LEAST, TINY = 0.01, 1e-6

#: Rows of all runs side by side, at most: for the sake of memory.
TOGETHER = 100_000


def moved(
    problem: Problem, noise: Noise, system: System, smooth: Smoothed, before: Array
) -> tuple[Noise, Array]:
    """Return the levels of noise a step nearer to the likeliest, and that step.

    The likelihood's slope by a variance has two halves; at its maximum they are equal, and a variance times
    their ratio is nearer.

    Parameters
    ----------
    problem : Problem
    noise : Noise
    system : System
        With that noise.
    smooth : Smoothed
    before : ndarray
        The step before; empty at first.
    """
    C, q = len(noise.measured), len(noise.process)
    ratio = np.zeros(C + q)
    e = system.seen[..., 0] - (system.H @ smooth.state[..., None])[..., 0]
    known = np.einsum("kwci,kwij,kwcj->kwc", system.H, smooth.covariance, system.H)
    for c in range(C):
        own = problem.seen[..., c]
        R = system.R[..., c][own]
        A = float((e[..., c][own] ** 2 / R).sum())
        B = float((1.0 - known[..., c][own] / R).sum())
        ratio[c] = np.log(A / B) if A > 0 and B > 0 else 0.0
    n = len(problem.free)
    gamma = _gamma(problem, system.A[..., :n, :n])
    for j in range(q):
        if noise.process[j] <= 0.0:
            continue
        pushed, both, own = _covariance(problem, noise, j)
        g = gamma[..., j]
        r, N = smooth.push, smooth.information
        along, last = (r[..., :n] * g).sum(axis=-1), r[..., n + j]
        A = float((pushed * along**2 + 2.0 * both * along * last + own * last**2).sum())
        Ng = (N[..., :n, :n] @ g[..., None])[..., 0]
        B = float(
            (
                pushed * (Ng * g).sum(axis=-1)
                + 2.0 * both * (N[..., n + j, :n] * g).sum(axis=-1)
                + own * N[..., n + j, n + j]
            ).sum()
        )
        ratio[C + j] = np.log(max(A, 1e-300) / max(B, 1e-300))
    limit = np.log(FARTHEST)
    step = np.clip(ratio, -limit, limit)
    if before.size:
        far = (before * step > 0) & (np.abs(step) > FAR)
        step = np.where(far, np.clip(ONWARD * step, -limit, limit), step)
    process = noise.process * np.exp(0.5 * step[C:])
    process = np.where(process < NONE * problem.accelerations, 0.0, process)
    least = np.maximum(LEAST * problem.data.noise, TINY * np.nanstd(problem.rows.values, axis=(0, 1)))
    measured = np.maximum(noise.measured * np.exp(0.5 * step[:C]), least)
    return replace(noise, measured=measured, process=process), step


def _covariance(problem: Problem, noise: Noise, j: int) -> tuple[Array, Array, Array]:
    """Return variance of a missing acceleration's integral over steps, covariance with it, own variance.

    Shapes (K-1, W).
    """
    tau, var = float(noise.seconds[j]), float(noise.process[j]) ** 2
    s = problem.dt / tau
    return var * tau**2 * _integrated(s), var * tau * np.expm1(-s) ** 2, -var * np.expm1(-2.0 * s)


def _gamma(problem: Problem, A: Array) -> Array:
    """Return what a push in the middle of a step has become at its end, (K-1, W, n, q)."""
    driven = list(problem.driven)
    gamma = 0.5 * A[..., :, driven]
    for j, i in enumerate(driven):
        gamma[..., i, j] += 0.5
    return gamma


def averaged(noise: Noise, over: float) -> Array:
    """Return the root mean square of each missing acceleration's mean over some time [s], shape (q,)."""
    s = over / noise.seconds
    return np.asarray(noise.process * np.sqrt(np.maximum(2.0 * (s + np.expm1(-s)), 0.0)) / s)


def timed(problem: Problem, linear: Linear, noise: Noise, factor: float) -> tuple[Noise, bool]:
    """Return the noise with likelier correlation times, if there are such `factor` away; and whether.

    Each is tried longer and shorter, with the same push over long times and with the same over short ones.
    """
    least, most = problem.shortest, problem.longest
    tries, places = [noise], []
    for j in np.flatnonzero(noise.process > SMALL * problem.accelerations).tolist():
        for times in (1.0 / factor, factor):
            new = float(np.clip(noise.seconds[j] * times, least, most))
            for power in (-0.5, 0.5):
                seconds, process = noise.seconds.copy(), noise.process.copy()
                process[j] *= (new / seconds[j]) ** power
                seconds[j] = new
                tries.append(replace(noise, seconds=seconds, process=process))
                places.append(j)
    if not places:
        return noise, False
    costs: list[float] = []
    together = max(1, TOGETHER // problem.rows.time.size)
    for k in range(0, len(tries), together):
        part = tries[k : k + together]
        try:
            filtered = run_filter(augment(problem, linear, part, unknowns=False))
        except np.linalg.LinAlgError:  # the path ran away: the next pass comes back
            return noise, False
        each = (filtered.white[..., 0] ** 2).sum(axis=(0, 2)) + filtered.log_det
        costs += each.reshape(len(part), -1).sum(axis=1).tolist()
    seconds, process, moved_on = noise.seconds.copy(), noise.process.copy(), False
    for j in sorted(set(places)):
        own = [1 + k for k, place in enumerate(places) if place == j]
        best = min(own, key=lambda k: costs[k])
        if costs[best] < costs[0] - WORTH_A_STEP:
            seconds[j], process[j], moved_on = tries[best].seconds[j], tries[best].process[j], True
    return replace(noise, seconds=seconds, process=process), moved_on
