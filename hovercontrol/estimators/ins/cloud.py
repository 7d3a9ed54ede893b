"""Weighted particles that move, meet measurements and are resampled: the bootstrap filter itself.

N. Gordon, D. Salmond, A. Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state estimation", IEE
Proc. F 140 (1993); systematic resampling after G. Kitagawa (1996); roughening along the particles' own
covariance and measurements taken in parts after N. Oudjane and C. Musso, "Progressive correction for
regularized particle filters" (2000).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A measurement is taken in parts where fewer than this share of the particles would count effectively.
LEAST = 0.3
#: After a measurement the particles are drawn anew where fewer than this share count effectively.
RESAMPLED = 0.5
#: Smallest part of a measurement; it bounds the number of parts.
SMALLEST = 1e-5


def systematic(weights: Array, offset: float) -> NDArray[np.intp]:
    """Return which particles are drawn, each as often as its weight asks, rounded up or down.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Not negative; their sum does not matter.
    offset : float
        Drawn evenly from 0 to 1.

    Examples
    --------
    >>> systematic(np.array([0.5, 0.0, 0.25, 0.25]), 0.5).tolist()
    [0, 0, 2, 3]
    """
    ends = np.cumsum(weights)
    found = np.searchsorted(ends, (np.arange(len(weights)) + offset) / len(weights) * ends[-1], "right")
    return np.minimum(found, len(weights) - 1)


def effective(log_weights: Array) -> float:
    """Return how many particles count, ``(sum w)^2 / sum w^2`` (Kong)."""
    w = np.exp(log_weights - log_weights.max())
    return float(w.sum() ** 2 / (w**2).sum())


class Cloud:
    """The particles of several runs.

    Parameters
    ----------
    x : ndarray, shape (runs, n, particles)
        Drawn from what is known at the start.
    near : ndarray, shape (n,)
        How far apart two particles may be and still be of one kind, of each value.
    roughening : float
        What is added after resampling, as a share of the particles' own spread, in each of its axes at most
        `near`: kinds far apart stay apart.
    rng : numpy.random.Generator
    """

    def __init__(self, x: Array, near: Array, roughening: float, rng: np.random.Generator) -> None:
        self.x, self._near, self._roughening, self._rng = x, near, roughening, rng
        self.log_weights = np.zeros((x.shape[0], x.shape[2]))

    @property
    def weights(self) -> Array:
        """The weights of each run, of sum 1, shape (runs, particles)."""
        w = np.exp(self.log_weights - self.log_weights.max(axis=1, keepdims=True))
        return np.asarray(w / w.sum(axis=1, keepdims=True))

    def meet(self, run: int, log_likelihood: Callable[[Array], Array]) -> None:
        """Weight one run's particles by a measurement, and draw them anew where too few count.

        Parameters
        ----------
        run : int
        log_likelihood : callable
            Of states, shape (n, particles): shape (particles,).
        """
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
        """Return the largest part of a measurement that leaves enough particles."""
        enough = LEAST * len(weights)
        if effective(weights + left * told) >= enough or left <= SMALLEST:
            return left
        low, high = 0.0, left
        for _ in range(20):
            middle = (low + high) / 2
            low, high = (middle, high) if effective(weights + middle * told) >= enough else (low, middle)
        return min(left, max(low, SMALLEST))

    def _resample(self, run: int, wide: float) -> None:
        """Draw a run's particles by their weights and roughen them, `wide` times where half-measured."""
        x, w = self.x[run], self.weights[run]
        mean, near = (x @ w)[:, None], self._near[:, None]
        off = (x - mean) / near
        sizes, axes = np.linalg.eigh((off * w) @ off.T)
        added = self._roughening**2 * np.clip(sizes, 0.0, wide**2)
        # What is added to the spread is taken off first (M. West), so that it stays what it was.
        kept = np.sqrt(1.0 - added / np.where(sizes > 0, sizes, 1.0))[:, None]
        drawn = axes.T @ off[:, systematic(w, self._rng.random())]
        drawn = kept * drawn + np.sqrt(added)[:, None] * self._rng.standard_normal(x.shape)
        self.x[run] = mean + near * (axes @ drawn)
        self.log_weights[run] = 0.0
