"""Kalman filter and smoother of a linearised problem, over many blocks of rows at once, with columns.

A filter is linear in what drives it. So one run of gains whitens the residuals and, beside them, the answers
to every unknown and to every candidate: weighted least squares of the whitened columns is then the maximum
likelihood under process noise (Kristensen, Madsen, Jorgensen, Automatica 40 (2004); de Jong, Biometrika 76
(1989): the augmented filter). Smoothing is by adjoint variables (Durbin and Koopman, Time Series Analysis by
State Space Methods, 2nd ed., 4.4), which needs no inverse of a covariance: process noise may be zero.

NumPy does it until a library is built, where there is a compiler; the two agree but for rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.kalman_compiled import compiled

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class System:
    """A linear system over W blocks of K rows, about a path.

    Attributes
    ----------
    A : ndarray, shape (K-1, W, n, n)
        From row to row.
    Q : ndarray, shape (K-1, W, n, n)
        Covariance of the process noise.
    drive : ndarray, shape (K-1, W, n, m)
        What each column adds to the state; column 0 is the defect of the path.
    H : ndarray, shape (K, W, C, n)
        Of the channels; zero where not measured.
    R : ndarray, shape (K, W, C)
        Variance of the measurements; 1 where not measured.
    seen : ndarray, shape (K, W, C, m)
        Column 0: measured minus path; others: minus what the column adds to the channel.
    P0 : ndarray, shape (W, n, n)
        Covariance of the first state.
    """

    A: Array
    Q: Array
    drive: Array
    H: Array
    R: Array
    seen: Array
    P0: Array


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter run leaves.

    Attributes
    ----------
    white : ndarray, shape (K, W, C, m)
        Innovations of every column, whitened.
    log_det : ndarray, shape (W,)
        Logarithm of the determinant of the innovations' covariance, by block.
    """

    white: Array
    log_det: Array
    _gain: Array | None = None
    _back: Array | None = None
    _P: Array | None = None
    _Z: Array | None = None


def run_filter(system: System, *, keep: bool = False) -> Filtered:
    """Run the filter over all blocks.

    Parameters
    ----------
    system : System
    keep : bool, optional
        Whether a smoother is to follow.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance of innovations is not positive.
    """
    A, Q, drive, H, R, seen = system.A, system.Q, system.drive, system.H, system.R, system.seen
    K, W, C, m = seen.shape
    n = H.shape[-1]
    white = np.empty((K, W, C, m))
    log_det = np.zeros(W)
    gains = np.empty((K, W, C, n)) if keep else None
    backs = np.empty((K, W, C, n)) if keep else None
    Ps = np.empty((K, W, n, n)) if keep else None
    Zs = np.empty((K, W, n, m)) if keep else None
    library = compiled(n, C)
    if library:
        library.filter(
            A=A, Q=Q, drive=drive, H=H, R=R, seen=seen, P0=system.P0,
            white=white, log_det=log_det, half=gains, back=backs, P=Ps, Z=Zs,
        )  # fmt: skip
        return Filtered(white, log_det, gains, backs, Ps, Zs)
    P, Z = system.P0.copy(), np.zeros((W, n, m))
    eye = np.arange(C)
    Ht = np.ascontiguousarray(np.swapaxes(H, 2, 3))
    At = np.ascontiguousarray(np.swapaxes(A, 2, 3))
    some = np.any(H, axis=(1, 2, 3))
    for k in range(K):
        if keep:
            Ps[k], Zs[k] = P, Z  # type: ignore[index]
        if some[k]:
            PH = P @ Ht[k]
            S = H[k] @ PH
            S[:, eye, eye] += R[k]
            L = np.linalg.cholesky(S)
            Li = np.linalg.inv(L)
            log_det += 2.0 * np.log(L[:, eye, eye]).sum(axis=1)
            half = Li @ np.swapaxes(PH, 1, 2)  # W, C, n
            w = Li @ (seen[k] - H[k] @ Z)
            white[k] = w
            gain = np.swapaxes(half, 1, 2)
            Z = Z + gain @ w
            P = P - gain @ half
            if keep:
                gains[k], backs[k] = half, Li @ H[k]  # type: ignore[index]
        else:
            white[k] = 0.0
            if keep:
                gains[k] = backs[k] = 0.0  # type: ignore[index]
        if k < K - 1:
            P = A[k] @ P @ At[k] + Q[k]
            P = 0.5 * (P + np.swapaxes(P, 1, 2))
            Z = A[k] @ Z + drive[k]
    return Filtered(white, log_det, gains, backs, Ps, Zs)


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed deviations from the path.

    Attributes
    ----------
    state : ndarray, shape (K, W, n)
    covariance : ndarray, shape (K, W, n, n)
        The weights of columns taken as known.
    push, information : ndarray, shapes (K-1, W, n), (K-1, W, n, n)
        r and N of Durbin and Koopman (4.38), (4.42) behind each step: by these the likelihood grows with the
        process noise's covariance, ``(r r' - N) / 2``.
    """

    state: Array
    covariance: Array
    push: Array
    information: Array


def run_smoother(system: System, filtered: Filtered, weights: Array) -> Smoothed:
    """Return smoothed deviations from the path.

    Parameters
    ----------
    system : System
    filtered : Filtered
        By ``run_filter(..., keep=True)``.
    weights : ndarray, shape (m,) or (W, m)
        How much of each column: 1 for the residual, the step for each unknown.
    """
    half, back, Ps, Zs = filtered._gain, filtered._back, filtered._P, filtered._Z
    assert half is not None and back is not None and Ps is not None and Zs is not None
    weights = np.broadcast_to(weights, (Zs.shape[1], Zs.shape[3]))
    K, W, n = Zs.shape[:3]
    x, V = np.empty((K, W, n)), np.empty((K, W, n, n))
    push, information = np.empty((K - 1, W, n)), np.empty((K - 1, W, n, n))
    library = compiled(n, half.shape[2])
    if library:
        library.smoother(
            A=system.A, half=half, back=back, P=Ps, Z=Zs, white=filtered.white, weights=weights,
            state=x, covariance=V, push=push, information=information,
        )  # fmt: skip
        return Smoothed(x, V, push, information)
    z = np.einsum("kwnm,wm->kwn", Zs, weights)
    e = np.einsum("kwcm,wm->kwc", filtered.white, weights)
    r, N = np.zeros((W, n)), np.zeros((W, n, n))
    eye = np.eye(n)
    for k in range(K - 1, -1, -1):
        if k < K - 1:
            push[k], information[k] = r, N
            r = (np.swapaxes(system.A[k], 1, 2) @ r[..., None])[..., 0]
            N = np.swapaxes(system.A[k], 1, 2) @ N @ system.A[k]
        T = np.swapaxes(back[k], 1, 2)  # W, n, C
        I_KH = eye - np.swapaxes(half[k], 1, 2) @ back[k]
        r = (np.swapaxes(I_KH, 1, 2) @ r[..., None])[..., 0] + (T @ e[k][..., None])[..., 0]
        N = np.swapaxes(I_KH, 1, 2) @ N @ I_KH + T @ back[k]
        x[k] = z[k] + (Ps[k] @ r[..., None])[..., 0]
        V[k] = Ps[k] - Ps[k] @ N @ Ps[k]
    return Smoothed(x, V, push, information)
