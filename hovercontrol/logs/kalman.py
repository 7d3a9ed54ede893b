"""Kalman filter and Rauch-Tung-Striebel smoother of independent channels driven by white jerk.

Each channel has its own process ``p''' = w`` with ``E[w(t) w(s)] = jerk * delta(t - s)`` and is
seen as ``z = p + e`` with ``E[e^2] = noise``. All channels share the times and the choice of
samples used, and run through the recursions together as the leading axis of the arrays.

Source: Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation"
(2001), 6.2.3 (white-jerk model) and 8.6 (fixed-interval smoother); Rauch, Tung, Striebel, AIAA J.
3 (1965) 1445.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.logs.log import Floats, Mask

SMALLEST = 1e-16
"""Measurement variance that is always assumed, for simulated logs without noise."""


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


@dataclass(frozen=True, eq=False)
class Filtered(Estimate):
    """The filter's estimates, its predictions, and what the samples said about them.

    Attributes
    ----------
    predicted_mean, predicted_covariance : ndarray (n, c, 3), (n, c, 3, 3)
    innovation, innovation_variance : ndarray (n, c)
        Sample minus prediction, and its variance.
    transition : ndarray (n, 3, 3)
        From the row before; zero where the filter started afresh.
    """

    predicted_mean: Floats
    predicted_covariance: Floats
    innovation: Floats
    innovation_variance: Floats
    transition: Floats


def run_filter(
    time: Floats, z: Floats, used: Mask, restart: Mask, jerk: Floats, noise: Floats, prior: Floats
) -> Filtered:
    """Run the filter forward.

    Parameters
    ----------
    time : ndarray (n,)
    z : ndarray (n, c)
        Samples; those not ``used`` do not matter.
    used, restart : ndarray (n,) of bool
        Which samples update the estimate, and at which rows (the first among them) the past is
        forgotten.
    jerk, noise : ndarray (c,)
        Jerk density and measurement variance of each channel.
    prior : ndarray (c, 3)
        Variances of position (about the sample), velocity and acceleration at a restart.
    """
    n, c = z.shape
    transition, process = _model(time, restart)
    fresh = np.einsum("ci,ij->cij", prior, np.eye(3))
    unit = np.eye(3)[:, :1]
    mean, covariance = np.zeros((n, c, 3)), np.zeros((n, c, 3, 3))
    predicted, spread = np.zeros_like(mean), np.zeros_like(covariance)
    innovation, variance = np.zeros((n, c)), np.zeros((n, c))
    x, P = np.zeros((c, 3)), fresh
    scale = jerk[:, None, None]
    for i in range(n):
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
    return Filtered(mean, covariance, predicted, spread, innovation, variance, transition)


def run_smoother(filtered: Filtered) -> Estimate:
    """Run the smoother backward over a filter's result."""
    F, P_next = filtered.transition[1:, None], filtered.predicted_covariance[1:]
    # G = P F' P_next^-1, solved for all rows at once
    G = np.linalg.solve(P_next, F @ filtered.covariance[:-1]).swapaxes(-1, -2)
    mean, covariance = filtered.mean.copy(), filtered.covariance.copy()
    x, P = mean[-1], covariance[-1]
    for i in range(len(mean) - 2, -1, -1):
        g = G[i]
        x = mean[i] + (g @ (x - filtered.predicted_mean[i + 1])[..., None])[..., 0]
        P = covariance[i] + g @ (P - P_next[i]) @ g.swapaxes(-1, -2)
        mean[i], covariance[i] = x, P
    return Estimate(mean, covariance)


def fit_noise(
    time: Floats, z: Floats, used: Mask, restart: Mask, groups: tuple[tuple[int, ...], ...]
) -> tuple[Floats, Floats]:
    """Return the most likely jerk density and measurement variance of each channel, shapes (c,).

    Maximum likelihood of the innovations; the variance is solved for in closed form, the ratio
    jerk/noise found on a logarithmic grid, twice refined. Channels of one group share both.

    Parameters
    ----------
    time, z, used, restart
        As for :func:`run_filter`.
    groups : tuple of tuples
        Channels by index.
    """
    step = float(np.median(np.diff(time)))
    c = z.shape[1]
    centre, reach = np.full(c, -1.0), 6.0
    variance = np.ones(c)
    warm = _warm_up(used, restart)
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
    """Return transition and unit process covariance from the row before, both (n, 3, 3)."""
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
