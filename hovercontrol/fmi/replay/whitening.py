"""Whitening of residuals: what remains of an output error depends on its past where a model is disturbed.

Each channel's residual e is an autoregression (Ljung, System Identification, 2nd ed., 4.2 and 7.3)::

    e(k) = a_1 e(k-1) + ... + a_p e(k-p) + w(k),    cov w = Sigma over the channels

p is zero where the residual is white: the measurement noise alone. Process noise gives p > 0. The
order minimises Schwarz' criterion ``n log var(w) + p log n``.

Residuals are smaller than the noise by what the fit takes. For least squares weighted by the noise's
covariance V, with sensitivities J (Seber and Lee, Linear Regression Analysis, 2nd ed., 3.3 and 3.10)::

    E[r r'] = V - J C J',    C = (J' V^-1 J)^-1

so products of residuals are summed with those of J C J' added; of white noise this gives ``r'r / (n - P)``.

Schwarz' criterion finds an order above zero in some channels of white noise too. That costs a fit little, but
it is no evidence that a model lacks something. A residual is said to depend on its past if twice the log
likelihood of its order p, ``n log(var e / var w)``, exceeds the chi-square quantile of p degrees of freedom;
the level is divided by the number of orders tried in all channels (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from hovercontrol.base.arrays import Array

#: Largest order of the autoregression, and fewest samples for each of its coefficients.
MOST_ORDER, SAMPLES = 12, 20
#: Chance that white residuals are said to depend on their past, of all channels together.
FALSE = 0.001
#: A residual below this fraction of the spread of its channel is rounding, not noise.
ROUNDING = 1e-7


@dataclass(frozen=True, eq=False)
class Whitening:
    """A model of the residuals of all logs.

    Attributes
    ----------
    coefficients : tuple of ndarray
        a_1 ... a_p of each channel.
    root : ndarray, shape (C, C)
        Whitens over the channels: ``root.T @ root`` is the inverse of Sigma.
    log_det : float
        Logarithm of the determinant of Sigma.
    count : float
        Residuals of a channel, on average over the channels.
    gains : tuple of float
        Twice the log likelihood that the autoregression of each channel gains.
    """

    coefficients: tuple[Array, ...]
    root: Array
    log_det: float
    count: float
    gains: tuple[float, ...]

    @property
    def orders(self) -> tuple[int, ...]:
        """The order of each channel."""
        return tuple(len(a) for a in self.coefficients)

    @property
    def coloured(self) -> tuple[bool, ...]:
        """Whether the residual of each channel depends on its past beyond chance."""
        level = FALSE / (MOST_ORDER * len(self.gains))
        return tuple(
            len(a) > 0 and gain > float(chi2.isf(level, len(a)))
            for a, gain in zip(self.coefficients, self.gains, strict=True)
        )

    @property
    def log_likelihood(self) -> float:
        """Of the residuals from which it was estimated, without constants: ``-n/2 log det Sigma``."""
        return -0.5 * self.count * self.log_det

    def apply(self, residual: Array, seen: NDArray[np.bool_]) -> Array:
        """Return whitened residuals or sensitivities, shape (K, C, ...); zero where nothing was measured."""
        extra = (1,) * (residual.ndim - 2)
        own = seen.reshape(*seen.shape, *extra)
        e = np.where(own, residual, 0.0)
        w = e.copy()
        for c, a in enumerate(self.coefficients):
            for i, value in enumerate(a, start=1):
                w[i:, c] -= value * e[:-i, c]
        w = np.einsum("ij,kj...->ki...", self.root, np.where(own, w, 0.0))
        return np.asarray(np.where(own, w, 0.0))


def whitening_of(
    residuals: Sequence[Array],
    spread: Array,
    *,
    most: int = MOST_ORDER,
    taken: Sequence[Array] | None = None,
) -> Whitening:
    """Estimate the model of residuals.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (K, C)
        Of each log; NaN where nothing was measured.
    spread : ndarray, shape (C,)
        Spread of the measured values.
    most : int, optional
        Largest order; 0 takes the residuals as white.
    taken : sequence of ndarray, shape (K, C, P), optional
        Of each log a root L of what the fit took: ``L L' = J C J'``.
    """
    C = residuals[0].shape[1]
    floor = np.maximum(ROUNDING * spread, 1e-300)
    if taken is None:
        taken = [np.zeros((*r.shape, 0)) for r in residuals]
    # the residual, and each column of L, as series side by side: shape (K, C, 1 + P)
    series = [
        np.concatenate([r[..., None], np.where(np.isfinite(r)[..., None], L, np.nan)], axis=2)
        for r, L in zip(residuals, taken, strict=True)
    ]
    coefficients, gains, innovations = [], [], []
    for c in range(C):
        parts = [s[:, c] for s in series]
        a, gain = _autoregression(parts, float(floor[c]), most)
        coefficients.append(a)
        gains.append(gain)
        innovations.append(np.concatenate([_filtered(part, a) for part in parts]))
    W = np.stack(innovations, axis=1)
    seen = np.isfinite(W[..., 0])
    sigma = np.sqrt(np.nansum(W**2, axis=(0, 2)) / np.maximum(seen.sum(axis=0), 1))
    sigma = np.maximum(sigma, floor)
    Sigma = np.diag(sigma**2)
    both = seen.all(axis=1)
    if C > 1 and both.sum() > 20 * C and (sigma > floor).all():
        scaled = W[both] / sigma[:, None]
        R = np.tensordot(scaled, scaled, axes=((0, 2), (0, 2))) / both.sum()
        shrunk = 0.999 * R / np.sqrt(np.outer(np.diag(R), np.diag(R))) + 0.001 * np.eye(C)
        Sigma = shrunk * np.outer(sigma, sigma)
    root = np.linalg.inv(np.linalg.cholesky(Sigma))
    log_det = float(np.linalg.slogdet(Sigma)[1])
    count = float(seen.sum()) / C
    return Whitening(tuple(coefficients), np.asarray(root, dtype=float), log_det, count, tuple(gains))


def _filtered(e: Array, a: Array) -> Array:
    """Return the innovations; those after a missing sample take it as zero."""
    filled = np.nan_to_num(e)
    w = filled.copy()
    for i, value in enumerate(a, start=1):
        w[i:] -= value * filled[:-i]
    return np.asarray(np.where(np.isfinite(e), w, np.nan))


def _autoregression(parts: Sequence[Array], floor: float, most: int) -> tuple[Array, float]:
    """Return the coefficients of the best order, of series of shape (K, 1 + P), and its gain."""
    every = np.concatenate([p[:, 0] for p in parts])
    total = int(np.isfinite(every).sum())
    most = min(most, total // SAMPLES, *(len(p) // 4 for p in parts))
    if most < 1 or np.sqrt(np.nanmean(every**2)) <= floor:
        return np.zeros(0), 0.0
    gram, n = np.zeros((most + 1, most + 1)), 0
    for p in parts:
        lagged = np.stack([np.nan_to_num(p)[most - i : len(p) - i] for i in range(most + 1)], axis=1)
        lagged = lagged[np.isfinite(p[most:, 0])]
        gram, n = gram + np.tensordot(lagged, lagged, axes=((0, 2), (0, 2))), n + len(lagged)
    white = n * math.log(max(gram[0, 0] / n, floor**2))
    best, chosen = white, np.zeros(0)
    for order in range(1, most + 1):
        own = slice(1, order + 1)
        a = np.linalg.lstsq(gram[own, own], gram[own, 0], rcond=1e-13)[0]
        left = gram[0, 0] - a @ gram[own, 0]  # y'y - a'X'y, the sum of squares that is left
        score = n * math.log(max(left / n, floor**2)) + order * math.log(n)
        if score < best:
            best, chosen = score, np.asarray(a, dtype=float)
    return chosen, white - best + len(chosen) * math.log(n)
