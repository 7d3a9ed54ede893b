"""Measurement noise and process noise: what a likelihood assumes of all that no equation says.

Process noise is a missing acceleration in each equation on which forces act, of a root mean square and a
correlation time (Ornstein and Uhlenbeck): gusts, bumps and floors last a while. Its size says what a model
lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.damping import Damping
from hovercontrol.estimation.drift import STATES
from hovercontrol.estimation.kalman import Smoothed, System, run_filter
from hovercontrol.estimation.problem import Linear, Problem

Array = NDArray[np.float64]

#: Correlation time of a missing acceleration to begin with, in rows.
FIRST = 5.0


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
    driven : tuple of str
        Names of the driven states.
    """

    measured: Array
    scale: Array
    process: Array
    seconds: Array
    driven: tuple[str, ...]

    def of(self, problem: Problem) -> Noise:
        """Return the noise in the equations of another problem on the same rows.

        An effect may act in an equation in which the model without it has nothing: there all acceleration is
        missing at first.
        """
        if self.driven == problem.driven_names:
            return self
        process, seconds = (
            problem.accelerations.copy(),
            np.full(len(problem.driven), FIRST * problem.shortest),
        )
        for j, name in enumerate(problem.driven_names):
            if name in self.driven:
                k = self.driven.index(name)
                process[j], seconds[j] = self.process[k], self.seconds[k]
        return replace(self, process=process, seconds=seconds, driven=problem.driven_names)


def augment(
    problem: Problem,
    linear: Linear,
    noise: Noise,
    *,
    unknowns: bool = True,
    drive: Array | None = None,
    seen: Array | None = None,
) -> System:
    """Return the linear system of a problem with its missing accelerations as further states.

    Behind them come the drift of a navigation and, where rows with new commands are lost, by how much the
    last of these was late.

    Parameters
    ----------
    problem : Problem
    linear : Linear
    noise : Noise
    unknowns : bool, optional
        Whether the unknowns have columns.
    drive, seen : ndarray, shapes (K-1, W, n, M) and (K, W, C, M), optional
        Further columns: what a candidate adds to the states from row to row, and to the channels.
    """
    n, q, (K, W, C) = len(problem.free), len(problem.driven), linear.residual.shape
    drift = problem.data.drift
    late = linear.jolt is not None
    N = n + q + (STATES if drift else 0) + late
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
        H[..., n + q : n + q + STATES] = np.where(problem.seen[..., None], drift.H, 0.0)
    A = np.zeros((K - 1, W, N, N))
    Q = np.zeros((K - 1, W, N, N))
    P0 = np.zeros((W, N, N))
    missing = range(n, n + q)
    fade, held, pushed, both, own = _steps(problem, noise)
    A[..., :n, :n] = linear.A
    A[..., :n, n : n + q] = gamma * held[..., None, :]
    A[..., missing, missing] = fade
    cross = gamma * both[..., None, :]
    Q[..., :n, :n] = (gamma * pushed[..., None, :]) @ np.swapaxes(gamma, -1, -2)
    Q[..., :n, n : n + q] = cross
    Q[..., n : n + q, :n] = np.swapaxes(cross, -1, -2)
    Q[..., missing, missing] = own
    P0[..., range(n), range(n)] = linear.start**2
    P0[..., missing, missing] = noise.process**2
    if drift:
        own_drift = slice(n + q, n + q + STATES)
        A[..., own_drift, own_drift] = drift.A
        Q[..., own_drift, own_drift] = drift.Q
        P0[..., own_drift, own_drift] = drift.P0
    if linear.jolt is not None and linear.fresh is not None:  # by how much the last unsure command is late
        fresh, jolt = linear.fresh[..., None], linear.jolt
        A[..., :n, -1], A[..., -1, -1] = np.where(fresh, 0.0, jolt), ~linear.fresh
        new = np.where(fresh, jolt, 0.0)
        Q[..., :n, :n] += new[..., :, None] * new[..., None, :]
        Q[..., :n, -1] = Q[..., -1, :n] = new
        Q[..., -1, -1], P0[..., -1, -1] = linear.fresh, 1.0
    level = (noise.measured * noise.scale[problem.rows.log]) ** 2  # W, C
    if problem.data.variance is not None:
        level = level * problem.data.variance
    return System(A, Q, full, H, np.where(problem.seen, level, 1.0), watched, P0)


#: A variance moves by at most this factor in a pass; a ratio that keeps its sign is followed at most so many
#: times as far.
FARTHEST, ONWARD = 100.0, 2.5


@dataclass(frozen=True)
class NoiseCriteria:
    """Limits of noise levels and their steps.

    No published source: set by hand, exercised by tests/estimation/test_noise.py.

    Attributes
    ----------
    averaging : float
        Averaging time of a missing acceleration, which over a single row is mostly noise [s].
    averaging_rows : int
        The same in rows, for slowly sampled logs; the longer counts.
    gain : float
        Fall of the cost from which on another correlation time is taken.
    none : float
        Process noise relative to the acceleration below which it is zero.
    small : float
        Process noise relative to the acceleration below which its correlation time is not fitted.
    least : float
        Smallest measurement noise relative to the level of third differences.
    tiny : float
        Smallest measurement noise relative to a channel's spread: no sensor is better, and in a log without
        noise what integration leaves would be significant.
    """

    averaging: float = 0.2
    averaging_rows: int = 5
    gain: float = 0.5
    none: float = 1e-5
    small: float = 1e-3
    least: float = 0.01
    tiny: float = 1e-5


#: The values in use.
NOISE = NoiseCriteria()


def moved(problem: Problem, noise: Noise, system: System, smooth: Smoothed, damping: Damping) -> Noise:
    """Return the levels of noise a step nearer to the likeliest.

    The likelihood's slope by a variance has two halves; at its maximum they are equal, and a variance times
    their ratio is nearer.

    Parameters
    ----------
    problem : Problem
    noise : Noise
    system : System
        With that noise.
    smooth : Smoothed
    damping : Damping
        Of the steps of the variances' logarithms.
    """
    C, q = len(noise.measured), len(noise.process)
    ratio = np.zeros(C + q)
    e = system.seen[..., 0] - (system.H @ smooth.state[..., None])[..., 0]
    known = ((system.H @ smooth.covariance) * system.H).sum(axis=-1)
    for c in range(C):
        own = problem.seen[..., c]
        R = system.R[..., c][own]
        A = float((e[..., c][own] ** 2 / R).sum())
        B = float((1.0 - known[..., c][own] / R).sum())
        ratio[c] = np.log(A / B) if A > 0 and B > 0 else 0.0
    n = len(problem.free)
    gamma = _gamma(problem, system.A[..., :n, :n])
    variances = _steps(problem, noise)[2:]
    for j in np.flatnonzero(noise.process > 0.0).tolist():
        pushed, both, own = (v[..., j] for v in variances)
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
    step = np.clip(damping.taken(np.clip(ratio, -limit, limit)), -limit, limit)
    process = noise.process * np.exp(0.5 * step[C:])
    process = np.where(process < NOISE.none * problem.accelerations, 0.0, process)
    least = np.maximum(
        NOISE.least * problem.data.noise, NOISE.tiny * np.nanstd(problem.rows.values, axis=(0, 1))
    )
    measured = np.maximum(noise.measured * np.exp(0.5 * step[:C]), least)
    return replace(noise, measured=measured, process=process)


def _steps(problem: Problem, noise: Noise) -> tuple[Array, Array, Array, Array, Array]:
    """Return what becomes of the missing accelerations over steps, each of shape (K-1, W, q).

    What is left of each, its integral, the variance of what is added to that integral, the covariance of that
    with what is added to the acceleration, and the variance of the latter.
    """
    tau, variance = noise.seconds, noise.process**2
    s = problem.dt[..., None] / tau
    less, less2 = np.expm1(-s), np.expm1(-2.0 * s)  # exp(-s) - 1, exp(-2 s) - 1
    series = s**3 * (2.0 / 3.0 - s / 2.0 + 7.0 * s**2 / 30.0)  # of the next, without loss of digits
    integrated = np.where(s < 1e-2, series, 2.0 * s + 4.0 * less - less2)
    return (
        1.0 + less,
        -tau * less,
        variance * tau**2 * integrated,
        variance * tau * less**2,
        -variance * less2,
    )


def _gamma(problem: Problem, A: Array) -> Array:
    """Return what a push in the middle of a step has become at its end, (K-1, W, n, q)."""
    driven = list(problem.driven)
    gamma = 0.5 * A[..., :, driven]
    for j, i in enumerate(driven):
        gamma[..., i, j] += 0.5
    return gamma


def averaging_time(problem: Problem) -> float:
    """Return the averaging time of missing accelerations [s]."""
    return max(NOISE.averaging, NOISE.averaging_rows * problem.shortest)


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
    for j in np.flatnonzero(noise.process > NOISE.small * problem.accelerations).tolist():
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
    for one in tries:  # one by one: side by side they would leave the processor's cache
        try:
            filtered = run_filter(augment(problem, linear, one, unknowns=False))
        except np.linalg.LinAlgError:  # the path ran away: the next pass comes back
            return noise, False
        costs.append(float((filtered.white**2).sum() + filtered.log_det.sum()))
    seconds, process, moved_on = noise.seconds.copy(), noise.process.copy(), False
    for j in sorted(set(places)):
        own = [1 + k for k, place in enumerate(places) if place == j]
        best = min(own, key=lambda k: costs[k])
        if costs[best] < costs[0] - NOISE.gain:
            seconds[j], process[j], moved_on = tries[best].seconds[j], tries[best].process[j], True
    return replace(noise, seconds=seconds, process=process), moved_on
