"""Measurement noise and process noise: the part of the likelihood that the model equations leave open.

Process noise is a missing acceleration in each equation on which forces act. It is an Ornstein-Uhlenbeck
process with a root mean square and a correlation time, because gusts, bumps and uneven floors last a while.
In a sampled model it is held from tick to tick, white or an autoregression of first order. Its size measures
how much the model lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.damping import Damping
from hovercontrol.identification.engine.drift import STATES
from hovercontrol.identification.engine.kalman import Forces, Smoothed, System, run_filter
from hovercontrol.identification.engine.problem import Linear, Problem

#: Initial correlation time of a missing acceleration, in rows.
FIRST = 5.0

#: Shortest correlation time in a sampled model, in periods: that of white noise.
WHITE = 0.5


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise levels.

    Attributes
    ----------
    measured : ndarray, shape (C,)
        Standard deviation of the measurement noise of each channel.
    scale : ndarray, shape (L, C)
        Standard deviation in each log relative to `measured`.
    process : ndarray, shape (q,)
        Root mean square of the missing acceleration, by driven state.
    seconds : ndarray, shape (q,)
        Correlation time of the missing acceleration [s].
    driven : tuple of str
        Names of the driven states, those on which forces act.
    """

    measured: Array
    scale: Array
    process: Array
    seconds: Array
    driven: tuple[str, ...]

    def of(self, problem: Problem) -> Noise:
        """Return the noise for another problem on the same rows.

        An effect may act in an equation that is not driven in the model without it. There the process noise
        starts from the whole observed acceleration.
        """
        if self.driven == problem.driven_names:
            return self
        process, seconds = (
            problem.accelerations.copy(),
            np.full(len(problem.driven), (WHITE if problem.period else FIRST) * problem.shortest),
        )
        for j, name in enumerate(problem.driven_names):
            if name in self.driven:
                k = self.driven.index(name)
                process[j], seconds[j] = self.process[k], self.seconds[k]
        return replace(self, process=process, seconds=seconds, driven=problem.driven_names)


#: Contributions of columns to the states from row to row, and to the channels (:class:`.System`).
Columns: TypeAlias = tuple[Array | None, Array | None]


def augment(
    problem: Problem, linear: Linear, noise: Noise, *, unknowns: bool = True, more: Sequence[Columns] = ()
) -> System:
    """Return the linear system of a problem, with its missing accelerations as additional states.

    The state vector is ``[x, a, d, l]``: the free states x, the missing accelerations a, the drift d of a
    navigation (if the logs come from one) and the lateness l of the last command whose time is uncertain (if
    rows with new commands are missing), in standard deviations.

    Parameters
    ----------
    unknowns : bool, optional
        Whether the unknowns have columns.
    more : sequence of (ndarray or None, ndarray or None), optional
        Additional columns, shapes (K-1, W, n, M) and (K, W, C, M): contribution of candidates to the states
        from row to row, and minus that to the channels; None for none.
    """
    n, q, W = len(problem.free), len(problem.driven), linear.residual.shape[1]
    columns: list[Columns] = [(linear.defect[..., None], linear.residual[..., None])]
    if unknowns and linear.B.size:
        columns.append((linear.B, -linear.D if linear.D.any() else None))
    P0 = np.zeros((W, n + q, n + q))
    P0[..., range(n), range(n)] = linear.start**2
    P0[..., range(n, n + q), range(n, n + q)] = noise.process**2
    # R = (sigma_channel scale_(log, channel))^2 times the relative variance of the sample
    level = (noise.measured * noise.scale[problem.rows.log]) ** 2  # W, C
    if problem.data.variance is not None:
        level = level * problem.data.variance
    forces = Forces(problem.driven, np.stack(_steps(problem, noise)), n, problem.period > 0.0)
    R = np.where(problem.seen, level, 1.0)
    found = System(linear.A, linear.H, R, (*columns, *more), P0, forces, follows=problem.rows.follows)
    return found if problem.data.drift is None and linear.jolt is None else _extended(problem, linear, found)


def _extended(problem: Problem, linear: Linear, system: System) -> System:
    """Return a system with the drift of a navigation and the lateness of commands as further states."""
    drift, late = problem.data.drift, linear.jolt is not None
    plain, n, at = system.whole(), system.forces.states, system.P0.shape[-1]
    more = (STATES if drift else 0) + late
    A, Q, P0 = (_padded(a, more, more) for a in (plain.A, plain.Q, plain.P0) if a is not None)
    H = _padded(plain.H, 0, more)
    ((drive, seen),) = plain.columns
    assert drive is not None
    if drift:
        own = slice(at, at + STATES)
        H[..., own] = np.where(problem.seen[..., None], drift.H, 0.0)
        A[..., own, own], Q[..., own, own], P0[..., own, own] = drift.A, drift.Q, drift.P0
    # Lateness l of the last command of uncertain time, in standard deviations; j = jolt:
    #   where such a command begins to act:  l <- xi,  x <- x + j xi,  xi ~ N(0, 1);  else  x <- x + j l
    if linear.jolt is not None and linear.fresh is not None:
        fresh, jolt = linear.fresh[..., None], linear.jolt
        A[..., :n, -1], A[..., -1, -1] = np.where(fresh, 0.0, jolt), ~linear.fresh
        new = np.where(fresh, jolt, 0.0)
        Q[..., :n, :n] += new[..., :, None] * new[..., None, :]
        Q[..., :n, -1] = Q[..., -1, :n] = new
        Q[..., -1, -1], P0[..., -1, -1] = linear.fresh, 1.0
    columns = ((_padded(drive, more, 0), seen),)
    return replace(plain, A=A, H=H, Q=Q, columns=columns, P0=P0)


def _padded(a: Array, down: int, right: int) -> Array:
    """Return an array with rows and columns of zeros after its last two axes."""
    return np.pad(a, [(0, 0)] * (a.ndim - 2) + [(0, down), (0, right)])


#: Largest factor by which a variance changes in a pass; largest factor by which a step in the logarithm of a
#: variance is lengthened while its sign stays the same.
FARTHEST, ONWARD = 100.0, 2.5


@dataclass(frozen=True)
class NoiseCriteria:
    """Limits of noise levels and their steps.

    No published source: set by hand, exercised by tests/identification/engine/test_noise.py.

    Attributes
    ----------
    averaging : float
        Averaging time of a missing acceleration, which over a single row is mostly noise [s].
    averaging_rows : int
        Averaging time in rows, for slowly sampled logs; the longer of the two applies.
    gain : float
        Minimum reduction of the cost for which another correlation time is accepted.
    none : float
        Process noise below this fraction of the observed acceleration is set to zero.
    small : float
        Process noise below this fraction of the observed acceleration keeps its correlation time.
    least : float
        Smallest measurement noise relative to the level from third differences.
    white : float
        Shortest correlation time in rows. That of neighbouring rows is then 1.7 %: the noise is white.
    tiny : float
        Smallest measurement noise relative to the standard deviation of the channel. No sensor is better; in
        a log without noise, integration errors would be significant.
    """

    averaging: float = 0.2
    averaging_rows: int = 5
    gain: float = 0.5
    none: float = 1e-5
    small: float = 1e-3
    least: float = 0.01
    white: float = 1.0 / 30.0
    tiny: float = 1e-5


#: The values in use.
NOISE = NoiseCriteria()


def moved(
    problem: Problem, noise: Noise, system: System, smooth: Smoothed, step: Array, damping: Damping
) -> Noise:
    """Return the noise levels after one step towards their maximum likelihood values.

    The derivative of the log likelihood with respect to the logarithm of a variance is ``(A - B) / 2`` with
    A, B >= 0. At the maximum A = B, so the undamped step multiplies the variance by A/B.

    Parameters
    ----------
    system : System
        Linear system with that noise.
    step : ndarray, shape (P,)
        Step of the unknowns that `smooth` includes.
    damping : Damping
        Damping of the steps of the logarithms of the variances.
    """
    C, q = len(noise.measured), len(noise.process)
    ratio = np.zeros(C + q)
    e = left_of(system, smooth, step)
    # Channel c, with smoothed residual e and smoothed variance V:  A = sum e^2 / R,  B = sum (1 - V / R)
    for c in range(C):
        own = problem.seen[..., c]
        R = system.R[..., c][own]
        A = float((e[..., c][own] ** 2 / R).sum())
        B = float((1.0 - smooth.known[..., c][own] / R).sum())
        ratio[c] = np.log(A / B) if A > 0 and B > 0 else 0.0
    # Process noise j, with its share Q_j of Q and r, N of the smoother, Durbin and Koopman (4.38), (4.42):
    #   A = sum r' Q_j r,  B = sum tr(Q_j N)
    for j in np.flatnonzero(noise.process > 0.0).tolist():
        A, B = smooth.forces[:, j].sum(axis=0).tolist()
        ratio[C + j] = np.log(max(A, 1e-300) / max(B, 1e-300))
    limit = np.log(FARTHEST)
    step = np.clip(damping.taken(np.clip(ratio, -limit, limit)), -limit, limit)
    process = noise.process * np.exp(0.5 * step[C:])
    process = np.where(process < NOISE.none * problem.accelerations, 0.0, process)
    measured = np.maximum(noise.measured * np.exp(0.5 * step[:C]), least_measured(problem))
    return replace(noise, measured=measured, process=process)


def left_of(system: System, smooth: Smoothed, step: Array) -> Array:
    """Return measured minus smoothed channels after a step of the unknowns, shape (K, W, C)."""
    # seen [1; theta] - H x, of which a frozen fit has column 0 alone
    left, at = np.zeros(system.R.shape), 0
    weights = np.concatenate([[1.0], step])
    for (_, seen), count in zip(system.columns, system.counts, strict=True):
        own = weights[at : at + count]
        if seen is not None and own.any():
            left += seen @ own
        at += count
    return np.asarray(left - (system.H @ smooth.state[..., : system.H.shape[-1], None])[..., 0])


def least_measured(problem: Problem) -> Array:
    """Return the smallest measurement noise of each channel, shape (C,)."""
    # From tick to tick a sampled model may jump: third differences then tell nothing about noise.
    least = 0.0 if problem.period else NOISE.least
    spread = np.nanstd(problem.rows.values, axis=(0, 1))
    return np.maximum(least * problem.data.noise, NOISE.tiny * spread)


def noisy(problem: Problem, noise: Noise) -> NDArray[np.intp]:
    """Return the driven states with process noise large enough to have a correlation time."""
    size = averaged(noise, averaging_time(problem))
    return np.flatnonzero(size > NOISE.small * problem.accelerations)


def time_range(problem: Problem) -> tuple[float, float]:
    """Return the shortest and the longest correlation time [s]."""
    return (WHITE if problem.period else NOISE.white) * problem.shortest, problem.longest


def _steps(problem: Problem, noise: Noise) -> tuple[Array, Array, Array, Array, Array]:
    """Return the moments of the missing accelerations over each step, five arrays of shape (K-1, W, q).

    For an acceleration of 1 at the start of the step: its mean at the end and the mean of its integral. Then
    the variance of the stochastic part xi of the integral, its covariance with the stochastic part eta of the
    acceleration, and the variance of eta.
    """
    # Ornstein-Uhlenbeck process of variance sigma^2, s = h/tau:
    #   mean: exp(-s);  mean of integral: tau (1 - exp(-s));  var eta = sigma^2 (1 - exp(-2 s))
    #   var xi = sigma^2 tau^2 (2 s - 3 + 4 exp(-s) - exp(-2 s));  cov(xi, eta) = sigma^2 tau (1 - exp(-s))^2
    tau, variance, h = noise.seconds, noise.process**2, problem.dt[..., None]
    if problem.period:
        # a(k+1) = rho a(k) + eta, of integral correlation time tau = h/2 (1 + rho)/(1 - rho): h/2 if white
        rho, none = (2.0 * tau - h) / (2.0 * tau + h), np.zeros((*problem.dt.shape, tau.size))
        return rho, none + h, none, none, variance * (1.0 - rho**2)
    s = h / tau
    less, less2 = np.expm1(-s), np.expm1(-2.0 * s)  # exp(-s) - 1, exp(-2 s) - 1
    series = s**3 * (2.0 / 3.0 - s / 2.0 + 7.0 * s**2 / 30.0)  # Taylor series of var xi, without cancellation
    integrated = np.where(s < 1e-2, series, 2.0 * s + 4.0 * less - less2)
    return (
        1.0 + less,
        -tau * less,
        variance * tau**2 * integrated,
        variance * tau * less**2,
        -variance * less2,
    )


def averaging_time(problem: Problem) -> float:
    """Return the averaging time of the missing accelerations [s]; at most half of a block."""
    wanted = max(NOISE.averaging * problem.tempo, NOISE.averaging_rows * problem.shortest)
    return min(wanted, 0.5 * float(problem.rows.seconds.max()))


def averaged(noise: Noise, over: float) -> Array:
    """Return the root mean square of each missing acceleration, averaged over a time [s], shape (q,)."""
    # Mean of an Ornstein-Uhlenbeck process over T, s = T/tau:  var = 2 sigma^2 (s - 1 + exp(-s)) / s^2
    s = over / noise.seconds
    return np.asarray(noise.process * np.sqrt(np.maximum(2.0 * (s + np.expm1(-s)), 0.0)) / s)


def timed(problem: Problem, linear: Linear, noise: Noise, factor: float) -> tuple[Noise, bool]:
    """Return the noise with more likely correlation times, and whether any changed.

    Each correlation time is multiplied and divided by `factor`. Each time is tried twice: with the same
    spectral density at low frequency (``process**2 * seconds`` kept) and with the same increments over short
    times (``process**2 / seconds`` kept).
    """
    least, most = time_range(problem)
    tries, places = [noise], []
    for j in noisy(problem, noise).tolist():
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
    for one in tries:  # one at a time: together they would not fit into the processor's cache
        try:
            costs.append(run_filter(augment(problem, linear, one, unknowns=False)).cost)
        except np.linalg.LinAlgError:  # the path diverged: the next pass corrects it
            return noise, False
    seconds, process, moved_on = noise.seconds.copy(), noise.process.copy(), False
    for j in sorted(set(places)):
        own = [1 + k for k, place in enumerate(places) if place == j]
        best = min(own, key=lambda k: costs[k])
        if costs[best] < costs[0] - NOISE.gain:
            seconds[j], process[j], moved_on = tries[best].seconds[j], tries[best].process[j], True
    return replace(noise, seconds=seconds, process=process), moved_on
