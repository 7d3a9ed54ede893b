"""Weighting and resampling of the particles of a bootstrap filter.

N. Gordon, D. Salmond, A. Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state estimation", IEE
Proc. F 140 (1993); systematic resampling after G. Kitagawa (1996); roughening along the principal axes of the
particles' covariance, and measurements incorporated in several partial steps, after N. Oudjane and C. Musso,
"Progressive correction for regularized particle filters" (2000).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array

#: A measurement is incorporated in steps if it would leave an effective sample size below this share.
LEAST = 0.3
#: After a measurement the particles are resampled if the effective sample size is below this share.
RESAMPLED = 0.5
#: Smallest step of a measurement (exponent of its likelihood); it bounds the number of steps.
SMALLEST = 1e-5


def systematic(weights: Array, offset: float) -> NDArray[np.intp]:
    """Return the indices of the particles drawn by systematic resampling.

    Particle i is drawn ``n w_i / sum w`` times, rounded up or down.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Not negative; they need not be normalised.
    offset : float
        Uniform random number from 0 to 1.

    Examples
    --------
    >>> systematic(np.array([0.5, 0.0, 0.25, 0.25]), 0.5).tolist()
    [0, 0, 2, 3]
    """
    # Draw i_k, the first index whose cumulative weight exceeds (k + offset) / n of the sum, k = 0 ... n - 1.
    ends = np.cumsum(weights)
    found = np.searchsorted(ends, (np.arange(len(weights)) + offset) / len(weights) * ends[-1], "right")
    return np.minimum(found, len(weights) - 1)


def effective(log_weights: Array) -> float:
    """Return the effective sample size, ``(sum w)^2 / sum w^2`` (Kong)."""
    w = np.exp(log_weights - log_weights.max())
    return float(w.sum() ** 2 / (w**2).sum())


class Cloud:
    """The particles of several runs.

    Parameters
    ----------
    x : ndarray, shape (runs, n, particles)
        Drawn from the initial distribution.
    near : ndarray, shape (n,)
        Length scale of each state, in its unit: particles within it belong to the same mode.
    roughening : float
        Standard deviation of the noise added after resampling, as a share of the particles' spread along each
        principal axis. The spread counts at most as `near`, so that distant modes stay separate.
    """

    def __init__(self, x: Array, near: Array, roughening: float, rng: np.random.Generator) -> None:
        self.x, self._near, self._roughening, self._rng = x, near, roughening, rng
        self.log_weights = np.zeros((x.shape[0], x.shape[2]))

    @property
    def weights(self) -> Array:
        """The normalised weights of each run, shape (runs, particles)."""
        w = np.exp(self.log_weights - self.log_weights.max(axis=1, keepdims=True))
        return np.asarray(w / w.sum(axis=1, keepdims=True))

    def meet(self, run: int, log_likelihood: Callable[[Array], Array]) -> None:
        """Weight one run's particles by a measurement, and resample where the effective size is too small.

        Parameters
        ----------
        log_likelihood : callable
            Maps states, shape (n, particles), to log-likelihoods, shape (particles,).
        """
        # Progressive correction: w_i <- w_i p(z | x_i)^a in steps with sum of a = 1, resampled between them.
        left, count = 1.0, self.x.shape[2]
        while True:
            told = log_likelihood(self.x[run])
            part = self._part(self.log_weights[run], told, left)
            weights = self.log_weights[run] + part * told
            self.log_weights[run] = weights - weights.max()
            left -= part
            if left > 0 or effective(self.log_weights[run]) < RESAMPLED * count:
                self._resample(run, 1.0 / max(1.0 - left, SMALLEST) ** 0.5)
            if left <= 0:
                return

    def _part(self, weights: Array, told: Array, left: float) -> float:
        """Return the largest exponent a of the likelihood that leaves a sufficient effective sample size."""
        enough = LEAST * len(weights)
        if effective(weights + left * told) >= enough or left <= SMALLEST:
            return left
        low, high = 0.0, left
        for _ in range(20):
            middle = (low + high) / 2
            low, high = (middle, high) if effective(weights + middle * told) >= enough else (low, middle)
        return min(left, max(low, SMALLEST))

    def _resample(self, run: int, wide: float) -> None:
        """Resample a run's particles by their weights and roughen them.

        `wide` enlarges the length scales `near` while only part of the measurement has been incorporated.
        """
        # With y = axes^T (x - mean) / near of covariance diag(lambda):  y <- sqrt(1 - s^2/lambda) y + s e,
        # e ~ N(0, I),  s^2 = roughening^2 min(lambda, wide^2).
        x, w = self.x[run], self.weights[run]
        mean, near = (x @ w)[:, None], self._near[:, None]
        off = (x - mean) / near
        sizes, axes = np.linalg.eigh((off * w) @ off.T)
        added = self._roughening**2 * np.clip(sizes, 0.0, wide**2)
        # The particles are first shrunk towards the mean (M. West), so that the covariance is unchanged.
        kept = np.sqrt(1.0 - added / np.where(sizes > 0, sizes, 1.0))[:, None]
        drawn = axes.T @ off[:, systematic(w, self._rng.random())]
        drawn = kept * drawn + np.sqrt(added)[:, None] * self._rng.standard_normal(x.shape)
        self.x[run] = mean + near * (axes @ drawn)
        self.log_weights[run] = 0.0
