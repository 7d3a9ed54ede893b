"""Tests of the innovations of a fit.

If nothing is missing they are white, have variance one and do not depend on commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment


@dataclass(frozen=True)
class WhitenessCriteria:
    """Settings of the tests of innovations for correlation.

    The tests are of Ljung and Box, Biometrika 65 (1978); no published source for these values, exercised
    by tests/identification/diagnose/test_compare.py.

    Attributes
    ----------
    lags : int
        Largest lag at which innovations are correlated [rows].
    past : tuple
        Delays at which they are correlated with commands [s].
    far : float
        Innovations are clipped at this many standard deviations.
    """

    lags: int = 10
    past: tuple[float, float, float, float, float] = (0.0, 0.1, 0.2, 0.4, 0.8)
    far: float = 4.0


#: The values in use.
WHITENESS = WhitenessCriteria()


def innovations(fit: Fit) -> Array:
    """Return innovations (row minus prediction) in standard deviations, shape (K, W, C).

    If a model and its noise are right, they are independent with variance one: ``z = L^-1 (y - H x)``, with
    ``L L' = H P H' + R`` and P the covariance of the predicted state x.

    Returns
    -------
    ndarray, shape (K, W, C)
        NaN where nothing was measured, and until a block has more than twice as many samples as free states.
    """
    problem = fit.problem
    white = run_filter(augment(problem, fit.linear, fit.noise, unknowns=False), rows=True).white[..., 0]
    so_far = np.cumsum(problem.seen.sum(axis=2), axis=0)[..., None]
    return np.where(problem.seen & (so_far > 2 * len(problem.free)), white, np.nan)


def whiteness(z: Array) -> float:
    """Return the p-value of the autocorrelations of innovations (Ljung, Box 1978).

    With n_k pairs at lag k, all of one block, and the mean square s^2::

        r_k = sum z_t z_(t-k) / (n_k s^2),    Q = sum over k of n_k r_k^2

    Q is chi-squared distributed with one degree of freedom per lag.

    Parameters
    ----------
    z : ndarray, shape (K, W)
        Innovations of one channel by block; NaN where there is none.

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(size=(101, 40))
    >>> whiteness(e[1:]) > 0.01, whiteness(e[1:] + 0.3 * e[:-1]) < 1e-6
    (True, True)
    """
    z = _cut(z)
    there = np.isfinite(z)
    values = np.where(there, z, 0.0)
    square = float((values**2).sum()) / max(int(there.sum()), 1)
    total, used = 0.0, 0
    for lag in range(1, min(WHITENESS.lags, z.shape[0] // 3) + 1):
        pairs = int((there[lag:] & there[:-lag]).sum())
        if pairs and square > 0:
            r = float((values[lag:] * values[:-lag]).sum()) / (pairs * square)
            total, used = total + pairs * r * r, used + 1
    return float(chi2.sf(total, used)) if used else 1.0


def random_remainder(fit: Fit, level: float) -> bool:
    """Return whether what a fit leaves is noise to it: the innovations of every channel are white.

    Then process noise of the fitted size and correlation time holds all that is left (gusts), and likelihood
    ratios mean what they say. A load that swings, bumps or an oscillating torque leave correlations.

    Parameters
    ----------
    fit : Fit
    level : float
        Probability of calling noise something else, shared among the channels (Bonferroni).
    """
    z = innovations(fit)
    return all(whiteness(z[..., c]) >= level / z.shape[2] for c in range(z.shape[2]))


def independence(z: Array, past: Sequence[Array]) -> float:
    """Return the p-value of the correlations of innovations with past commands.

    With N innovations z and the standardised commands U, shape (N, m), of ``U'U / N = V S V'`` and rank r::

        Q = |S^(-1/2) V'U'z|^2 / (N mean(z^2)),    chi-squared with r degrees of freedom

    Parameters
    ----------
    z : ndarray, shape (K, W)
    past : sequence of ndarray, shape (K, W)
        Commands before each row (:func:`past_commands`).
    """
    z = _cut(z)
    there = np.isfinite(z)
    if not past or there.sum() < 10 * len(past):
        return 1.0
    values = z[there]
    U = np.stack([u[there] for u in past], axis=-1)
    U = U - U.mean(axis=0)
    size = np.sqrt((U**2).mean(axis=0))
    U = U[:, size > 1e-12] / size[size > 1e-12]
    if not U.shape[1]:
        return 1.0
    _, s, Vt = np.linalg.svd(U.T @ U / len(U))
    kept = s > 1e-6 * s[0]
    scores = Vt[kept] @ (U.T @ values) / np.sqrt(s[kept] * len(U))
    return float(chi2.sf(float((scores**2).sum()) / float(np.mean(values**2)), int(kept.sum())))


def past_commands(fit: Fit, log: int) -> list[Array]:
    """Return the commands of a log one or more rows before each row of its blocks, each (K, W)."""
    problem = fit.problem
    m, at = problem.logs[log], problem.rows.at[:, problem.rows.log == log]
    step = float(np.median(np.diff(m.time)))
    ago = sorted({max(1, round(seconds / step)) for seconds in WHITENESS.past})
    last = m.time.size - 1
    return [row[np.clip(at - back, 0, last)] for row in m.inputs for back in ago]


def _cut(z: Array) -> Array:
    """Return innovations clipped at a multiple of the standard deviation, median(abs(z)) / 0.6745."""
    known = np.abs(z[np.isfinite(z)])
    scale = float(np.median(known)) / 0.6745 if known.size else 1.0
    return np.clip(z, -WHITENESS.far * scale, WHITENESS.far * scale)
