"""Kalman filter and Rauch-Tung-Striebel smoother of independent channels driven by white jerk.

Each channel has its own process ``p''' = w`` with ``E[w(t) w(s)] = jerk * delta(t - s)`` and is
measured as ``z = p + e`` with ``E[e^2] = noise``. All channels share the times and the selection of
samples, and are computed together along the leading axis of the arrays. On evenly spaced rows the
covariances soon become constant; from then on only the means are computed, in blocks.

Source: Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation"
(2001), 6.2.3 (white-jerk model) and 8.6 (fixed-interval smoother); Rauch, Tung, Striebel, AIAA J.
3 (1965) 1445.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.logs.log import Floats, Mask

SMALLEST = 1e-16
"""Measurement variance that is always assumed, for simulated logs without noise."""

STANDS = 1e-12
"""Largest relative change, from row to row, of covariances that stand still."""

ROUNDING = 1e-13
"""Part of a variance that rounding may take."""

BLOCK = 32
"""Rows of a block whose means are computed at once."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Means and covariances of (position, velocity, acceleration) at every time.

    Attributes
    ----------
    mean : ndarray (n, c, 3)
    covariance : ndarray (n, c, 3, 3)
    """

    mean: Floats
    covariance: Floats

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Filtered(Estimate):
    """The filter's estimates, its predictions and its innovations.

    Attributes
    ----------
    predicted_mean, predicted_covariance : ndarray (n, c, 3), (n, c, 3, 3)
    innovation, innovation_variance : ndarray (n, c)
        Sample minus prediction, and its variance.
    transition : ndarray (n, 3, 3)
        Transition matrix from the previous row; zero where the filter restarted.
    """

    predicted_mean: Floats
    predicted_covariance: Floats
    innovation: Floats
    innovation_variance: Floats
    transition: Floats

    __repr__ = short_repr


def run_filter(
    time: Floats, z: Floats, used: Mask, restart: Mask, jerk: Floats, noise: Floats, prior: Floats
) -> Filtered:
    """Run the filter forward.

    Parameters
    ----------
    time : ndarray (n,)
    z : ndarray (n, c)
        Samples; those not ``used`` are ignored.
    used, restart : ndarray (n,) of bool
        The samples that update the estimate, and the rows (including the first) at which the filter
        restarts from the prior.
    jerk, noise : ndarray (c,)
        Jerk density and measurement variance of each channel.
    prior : ndarray (c, 3)
        Variances of position (about the sample), velocity and acceleration at a restart.
    """
    # With h = [1, 0, 0]:  x <- F x,  P <- F P F' + jerk Q;  S = h P h' + noise,  K = P h' / S,
    # x <- x + K (z - h x),  P <- P - K h P.  In steady state the predictions obey
    # x[k+1] = F (I - K h) x[k] + F K z[k] with constant K.
    n, c = z.shape
    transition, process = _model(time, restart)
    fresh = np.einsum("ci,ij->cij", prior, np.eye(3))
    unit = np.eye(3)[:, :1]
    mean, covariance = np.zeros((n, c, 3)), np.zeros((n, c, 3, 3))
    predicted, spread = np.zeros_like(mean), np.zeros_like(covariance)
    innovation, variance = np.zeros((n, c)), np.zeros((n, c))
    x, P = np.zeros((c, 3)), fresh
    scale = jerk[:, None, None]
    even = _even_until(time, used & ~restart)
    i = 0
    while i < n:
        if even[i] - i > BLOCK and _same(spread[i - 1], spread[i - 2]) and even[i] == even[i - 2]:
            rows = slice(i, even[i])
            K = spread[i - 1][:, :, 0] / variance[i - 1][:, None]
            step = transition[i] - (transition[i] @ K[:, :, None]) * unit[:, 0]  # F (I - K h)
            drive = (transition[i] @ K[:, :, None])[..., 0] * z[i - 1 : even[i] - 1, :, None]
            predicted[rows] = _recursion(step, drive, predicted[i - 1])
            spread[rows], variance[rows] = spread[i - 1], variance[i - 1]
            innovation[rows] = z[rows] - predicted[rows, :, 0]
            mean[rows] = predicted[rows] + K * innovation[rows, :, None]
            covariance[rows] = covariance[i - 1]
            x, P, i = mean[even[i] - 1], covariance[i - 1], even[i]
            continue
        if restart[i]:
            x, P = z[i][:, None] * unit[:, 0], fresh
        else:
            F = transition[i]
            x = x @ F.T
            P = F @ P @ F.T + scale * process[i]
        predicted[i], spread[i] = x, P
        innovation[i] = z[i] - x[:, 0]
        variance[i] = P[:, 0, 0] + noise
        if used[i]:
            K = P[:, :, 0] / variance[i][:, None]
            x = x + K * innovation[i][:, None]
            P = P - K[:, :, None] * P[:, None, 0, :]
        mean[i], covariance[i] = x, P
        i += 1
    return Filtered(mean, covariance, predicted, spread, innovation, variance, transition)


def run_smoother(filtered: Filtered) -> Estimate:
    """Run the Rauch-Tung-Striebel smoother backward over a filter's result."""
    # G = P F' P_next^-1 with the filtered P and the predicted P_next of the next row:
    # x_s = x + G (x_s,next - x_next),  P_s = P + G (P_s,next - P_next) G'.
    F, P_next = filtered.transition[1:, None], filtered.predicted_covariance[1:]
    G = _gains(P_next, F @ filtered.covariance[:-1])
    mean, covariance = filtered.mean.copy(), filtered.covariance.copy()
    x, P = mean[-1], covariance[-1]
    last = _alike_from(G, P_next, covariance)
    i = len(mean) - 2
    while i >= 0:
        g, first = G[i], last[i]
        if i - first > BLOCK and i + 2 < len(mean) and _same(covariance[i + 1], covariance[i + 2]):
            drive = (
                filtered.mean[first : i + 1]
                - (g @ filtered.predicted_mean[first + 1 : i + 2, ..., None])[..., 0]
            )
            mean[first : i + 1] = _recursion(g, drive[::-1], x)[::-1]
            covariance[first : i + 1] = P
            x, i = mean[first], first - 1
            continue
        x = mean[i] + (g @ (x - filtered.predicted_mean[i + 1])[..., None])[..., 0]
        P = covariance[i] + g @ (P - P_next[i]) @ g.swapaxes(-1, -2)
        mean[i], covariance[i] = x, P
        i -= 1
    return Estimate(mean, covariance)


def _gains(P_next: Floats, FP: Floats) -> Floats:
    """Return the smoother's gains P F' P_next^-1, solved for all rows at once.

    Without measurement noise a sample reduces the variance to zero, and rounding may make P_next singular.
    In that case its diagonal is increased by the relative size of rounding errors, ``ROUNDING``.
    """
    try:
        G = np.linalg.solve(P_next, FP)
    except np.linalg.LinAlgError:
        taken = ROUNDING * np.diagonal(P_next, axis1=-2, axis2=-1)
        G = np.linalg.solve(P_next + taken[..., None] * np.eye(P_next.shape[-1]), FP)
    return np.asarray(G.swapaxes(-1, -2), dtype=float)


def _recursion(A: Floats, b: Floats, x: Floats) -> Floats:
    """Return the solution of x[k] = A x[k-1] + b[k], shape (n, c, 3), from the x before the first.

    Parameters
    ----------
    A : ndarray (c, 3, 3)
    b : ndarray (n, c, 3)
    x : ndarray (c, 3)
    """
    # In a block that follows x0:  x[k] = A^k x0 + o[k],  o[k] = A o[k-1] + b[k],  o[0] = 0,  k = 1 ... BLOCK.
    n, c, size = b.shape
    powers = [np.broadcast_to(np.eye(size), A.shape)]
    for _ in range(BLOCK):
        powers.append(A @ powers[-1])
    blocks = -(-n // BLOCK)
    padded = np.concatenate([b, np.zeros((blocks * BLOCK - n, c, size))]).reshape(blocks, BLOCK, c, size)
    own = padded.copy()  # o[k], the response of a block to b from zero
    for k in range(1, BLOCK):
        own[:, k] += (A @ own[:, k - 1, ..., None])[..., 0]
    starts = np.empty((blocks, c, size))
    for j in range(blocks):
        starts[j] = x
        x = (powers[BLOCK] @ x[..., None])[..., 0] + own[j, -1]
    every = np.stack(powers[1:])  # BLOCK, c, 3, 3
    found = own + (every @ starts[:, None, ..., None])[..., 0]
    return found.reshape(-1, c, size)[:n]


def _same(one: Floats, other: Floats) -> bool:
    return bool((np.abs(one - other) <= STANDS * np.abs(other).max(axis=(-1, -2), keepdims=True)).all())


def _even_until(time: Floats, plain: Mask) -> list[int]:
    """Return for each row the end of its run of evenly spaced plain rows, or the row itself if in none."""
    step = np.diff(time, prepend=time[0] - 1.0)
    joined = plain & (np.abs(step - np.roll(step, 1)) <= 1e-9 * np.abs(step))
    ends = np.flatnonzero(~joined)
    places = np.arange(time.size)
    following = np.append(ends, time.size)[np.searchsorted(ends, places)]
    found: list[int] = np.where(joined, following, places).tolist()
    return found


def _alike_from(G: Floats, ahead: Floats, covariance: Floats) -> list[int]:
    """Return for each row the first row of the run with the same gains and covariances."""
    same = np.zeros(len(G), dtype=bool)
    same[1:] = (
        (G[1:] == G[:-1]).all(axis=(1, 2, 3))
        & (ahead[1:] == ahead[:-1]).all(axis=(1, 2, 3))
        & (covariance[1:-1] == covariance[:-2]).all(axis=(1, 2, 3))
    )
    places = np.arange(len(G))
    found: list[int] = np.maximum.accumulate(np.where(same, 0, places)).tolist()
    return found


def fit_noise(
    time: Floats, z: Floats, used: Mask, restart: Mask, groups: tuple[tuple[int, ...], ...]
) -> tuple[Floats, Floats]:
    """Return the maximum-likelihood jerk density and measurement variance of each channel, shapes (c,).

    The likelihood is that of the innovations. The variance follows in closed form; the ratio jerk/noise
    is found on a logarithmic grid that is then refined. Channels of one group share both.

    Parameters
    ----------
    time, z, used, restart
        As for :func:`run_filter`.
    groups : tuple of tuples
        Channels by index.

    Raises
    ------
    InputError
        If no samples follow each other closely.
    """
    # With R = noise and the innovation variances R S_k, where S_k depends on the ratio jerk/noise alone,
    # -2 ln L = sum (ln S_k + ln R + nu_k^2 / (R S_k)) + const. is least at R = mean nu_k^2 / S_k,
    # which leaves mean ln S_k + ln R to minimise over the ratio.
    step = float(np.median(np.diff(time)))
    c = z.shape[1]
    centre, reach = np.full(c, -1.0), 6.0
    variance = np.ones(c)
    warm = _warm_up(used, restart)
    if not warm.any():
        raise InputError("too few samples follow each other closely to tell noise from motion")
    for points in (13, 9):
        grid = np.linspace(-reach, reach, points)
        ratio = 10.0 ** (centre[:, None] + grid) / step**5  # (c, points)
        rows = np.repeat(z, points, axis=1)
        ones = np.ones(c * points)
        wide = np.tile(np.array([1e4, 1e4 / step**2, 1e4 / step**4]), (ones.size, 1))
        run = run_filter(time, rows, used, restart, ratio.ravel(), ones, wide)
        S = run.innovation_variance[warm].reshape(-1, c, points)
        squares = run.innovation[warm].reshape(-1, c, points) ** 2 / S
        for group in groups:
            g = list(group)
            R = squares[:, g].mean(axis=(0, 1)) + SMALLEST
            likelihood = -np.log(S[:, g]).mean(axis=(0, 1)) - np.log(R)
            best = int(likelihood.argmax())
            centre[g] += grid[best]
            variance[g] = R[best]
        reach = 1.5 * (grid[1] - grid[0])
    return 10.0**centre / step**5 * variance, variance


def _warm_up(used: Mask, restart: Mask) -> Mask:
    """Return the used rows from the fourth after each restart."""
    count = np.cumsum(used)
    start = np.maximum.accumulate(np.where(restart, count, 0))
    rows: Mask = used & (count - start >= 3)
    return rows


def _model(time: Floats, restart: Mask) -> tuple[Floats, Floats]:
    """Return transition matrix and unit process covariance from the previous row, both (n, 3, 3)."""
    # F = exp(A d) of p''' = w,  Q = integral from 0 to d of exp(A s) b b' exp(A' s) ds,  b = [0, 0, 1]'
    # (Bar-Shalom et al., 6.2.3).
    d = np.diff(time, prepend=time[0])
    one, zero = np.ones_like(d), np.zeros_like(d)
    F = np.array([[one, d, d**2 / 2], [zero, one, d], [zero, zero, one]])
    Q = np.array(
        [
            [d**5 / 20, d**4 / 8, d**3 / 6],
            [d**4 / 8, d**3 / 3, d**2 / 2],
            [d**3 / 6, d**2 / 2, d],
        ]
    )
    keep = ~restart
    return np.moveaxis(F * keep, -1, 0), np.moveaxis(Q * keep, -1, 0)
