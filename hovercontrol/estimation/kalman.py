"""Kalman filter and fixed-interval smoother of a linearised problem, for many blocks of rows at once.

The model is linearised about a path, a trajectory of the states. With x the deviation from that path, theta
the steps of the unknowns, w ~ N(0, Q) and e ~ N(0, R)::

    x(k+1) = A x(k) + drive(k) [1; theta] + w(k),    seen(k) [1; theta] = H x(k) + e(k)

The filter is linear in its inputs. One sequence of gains therefore whitens all columns: the residuals
(column 0) and the sensitivities to each unknown and each candidate term. Least squares on the whitened
columns gives the maximum likelihood estimate under process noise (Kristensen, Madsen, Jorgensen, Automatica
40 (2004); de Jong, Biometrika 76 (1989): the augmented filter). The smoother uses adjoint variables (Durbin
and Koopman, Time Series Analysis by State Space Methods, 2nd ed., 4.4). It inverts no state covariance, so
process noise may be zero.

A compiled library does the work as soon as it is built. Until then, and without a compiler, NumPy does; the
two agree up to rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.kalman_compiled import compiled

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class System:
    """A linear system over W blocks of K rows, in deviations from a path.

    Attributes
    ----------
    A : ndarray, shape (K-1, W, n, n)
        Transition matrix from each row to the next.
    Q : ndarray, shape (K-1, W, n, n)
        Covariance of the process noise.
    drive : ndarray, shape (K-1, W, n, m)
        Input of each column to the state; column 0 is the defect of the path.
    H : ndarray, shape (K, W, C, n)
        Measurement matrix of the channels; zero where not measured.
    R : ndarray, shape (K, W, C)
        Variance of the measurements; 1 where not measured.
    seen : ndarray, shape (K, W, C, m)
        Column 0: measured minus path. Other columns: minus their direct contribution to the channel.
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
    """Result of a filter run.

    Attributes
    ----------
    white : ndarray, shape (K, W, C, m)
        Whitened innovations of every column, ``L^-1 (seen - H Z)`` with ``S = L L'``.
    log_det : ndarray, shape (W,)
        Logarithm of the determinant of the innovations' covariance S, summed over the rows of each block.
    """

    white: Array
    log_det: Array
    _gain: Array | None = None
    _back: Array | None = None
    _P: Array | None = None
    _Z: Array | None = None


def run_filter(system: System, *, keep: bool = False) -> Filtered:
    """Run the filter over all blocks.

    For column 0 the whitened innovations w satisfy ``-2 log likelihood = sum w'w + log det S``, up to a
    constant.

    Parameters
    ----------
    keep : bool, optional
        Whether to keep the arrays that :func:`run_smoother` needs.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance of innovations is not positive definite.
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
            # S = H P H' + R = L L',  w = L^-1 (y - H Z),  half = L^-1 H P
            # Z <- Z + P H' S^-1 (y - H Z) = Z + half' w,  P <- P - P H' S^-1 H P = P - half' half
            # log det S = 2 sum log L_ii
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
            # Prediction: P <- A P A' + Q,  Z <- A Z + drive
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
        Covariance given the weights of the columns, without their own uncertainty.
    push, information : ndarray, shapes (K-1, W, n), (K-1, W, n, n)
        r and N of Durbin and Koopman (4.38), (4.42) after each step. The derivative of the log likelihood
        with respect to the covariance Q of that step is ``(r r' - N) / 2``.
    """

    state: Array
    covariance: Array
    push: Array
    information: Array


def run_smoother(system: System, filtered: Filtered, weights: Array) -> Smoothed:
    """Return smoothed deviations from the path.

    Parameters
    ----------
    filtered : Filtered
        Result of ``run_filter(..., keep=True)``.
    weights : ndarray, shape (m,) or (W, m)
        Weight of each column: 1 for the residual, the step for each unknown.
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
    # Backward recursion, Durbin and Koopman (4.38), (4.42), with G = A (I - P H' S^-1 H) and v = y - H z:
    #   r <- H' S^-1 v + G' r,  N <- H' S^-1 H + G' N G,  x = z + P r,  V = P - P N P
    # In whitened form: back = L^-1 H, half = L^-1 H P, e = L^-1 v, so H' S^-1 v = back' e.
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
