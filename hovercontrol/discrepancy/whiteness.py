"""What a model that lacks nothing leaves: independent numbers of variance one, which no command foretells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.noise import whiten

Array = NDArray[np.float64]

#: Rows apart at which residuals are compared.
LAGS = 10

#: How long past commands are that residuals are compared with [s].
PAST = (0.0, 0.1, 0.2, 0.4, 0.8)

#: A row that the rows before it foretell no better than this many standard deviations of noise is left out.
UNKNOWN = 10.0

#: Standard deviations at which outliers are cut off.
FAR = 4.0


def recursive_residuals(fit: Fit) -> Array:
    """Return recursive residuals: each row against what the window's rows before it foretell.

    Where the model and its noise are right they are independent, with variance one, though the window's
    initial state was fitted (Brown, Durbin, Evans, J. R. Stat. Soc. B 37, 1975).

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    ndarray, shape (W, K, C)
        NaN where nothing was measured or nothing can be foretold yet.
    """
    w = fit.windowed
    n = len(w.free)
    columns = np.concatenate([fit.residual[..., None], fit.moves], axis=-1)
    white, _ = whiten(columns, w.seen, fit.noise, fit.response, w.errors)
    size = np.sqrt((white[..., 1:] ** 2).sum(axis=(1, 2)))  # W, n
    X = white[..., 1:] / np.where(size > 0, size, 1.0)[:, None, None, :]
    W, K, C, _ = white.shape
    P = np.broadcast_to(1e6 * np.eye(n), (W, n, n)).copy()
    b = np.zeros((W, n, 1))
    found = np.full((W, K, C), np.nan)
    for k in range(K):
        x = X[:, k]  # W, C, n
        G = P @ x.swapaxes(1, 2)
        F = x @ G + np.eye(C)
        inverse = np.linalg.inv(np.linalg.cholesky(F))
        e = inverse @ (white[:, k, :, :1] - x @ b)
        gain = G @ inverse.swapaxes(1, 2)
        b = b + gain @ e
        P = P - gain @ gain.swapaxes(1, 2)
        P = 0.5 * (P + P.swapaxes(1, 2))
        known = np.diagonal(F, axis1=1, axis2=2) < UNKNOWN**2
        found[:, k] = np.where(w.seen[:, k] & known, e[..., 0], np.nan)
    return found


def whiteness(z: Array) -> float:
    """Return the chance of correlations in time as large as found, were there none (Ljung, Box 1978).

    Parameters
    ----------
    z : ndarray, shape (W, K)
        Residuals of one channel by window; NaN where there is none.

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(size=(40, 101))
    >>> whiteness(e[:, 1:]) > 0.01, whiteness(e[:, 1:] + 0.3 * e[:, :-1]) < 1e-6
    (True, True)
    """
    z = _cut(z)
    there = np.isfinite(z)
    values = np.where(there, z, 0.0)
    square = float((values**2).sum()) / max(int(there.sum()), 1)
    total, used = 0.0, 0
    for lag in range(1, min(LAGS, z.shape[1] // 3) + 1):
        pairs = int((there[:, lag:] & there[:, :-lag]).sum())
        if pairs and square > 0:
            r = float((values[:, lag:] * values[:, :-lag]).sum()) / (pairs * square)
            total, used = total + pairs * r * r, used + 1
    return float(chi2.sf(total, used)) if used else 1.0


def independence(z: Array, past: Sequence[Array]) -> float:
    """Return the chance of correlations with past commands as large as found, were there none.

    Parameters
    ----------
    z : ndarray, shape (W, K)
    past : sequence of ndarray, shape (W, K)
        Commands at rows and before (:func:`past_commands`).
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
    """Return the commands of a log before each row of its windows, by one row and more, each (W, K)."""
    w = fit.windowed
    m = w.data.logs[log]
    K = w.seen.shape[1]
    rows = np.array([first + np.arange(K) for i, first, _ in w.ranges if i == log])
    step = float(np.median(np.diff(m.time)))
    ago = sorted({max(1, round(seconds / step)) for seconds in PAST})
    last = m.time.size - 1
    return [row[np.clip(rows - back, 0, last)] for row in m.inputs for back in ago]


def _cut(z: Array) -> Array:
    """Return residuals with outliers cut off, so that a few of them do not decide."""
    known = np.abs(z[np.isfinite(z)])
    scale = float(np.median(known)) / 0.6745 if known.size else 1.0
    return np.clip(z, -FAR * scale, FAR * scale)
