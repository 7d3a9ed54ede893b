"""Kalman filter and fixed-interval smoother of a linearised problem, for many stretches of rows at once.

The model is linearised about a path, a trajectory of the states. With x the deviation from that path, theta
the steps of the unknowns, w ~ N(0, Q) and e ~ N(0, R)::

    x(k+1) = A x(k) + drive(k) [1; theta] + w(k),    seen(k) [1; theta] = H x(k) + e(k)

The filter is linear in its inputs. One sequence of gains therefore whitens all columns: the residuals
(column 0) and the sensitivities to each unknown and each candidate term. Least squares on the whitened
columns gives the maximum likelihood estimate under process noise (Kristensen, Madsen, Jorgensen, Automatica
40 (2004); de Jong, Biometrika 76 (1989): the augmented filter). The smoother uses adjoint variables (Durbin
and Koopman, Time Series Analysis by State Space Methods, 2nd ed., 4.4). It inverts no state covariance, so
process noise may be zero.

A stretch that follows another begins with the state that the filter of that one ends with. Each innovation is
therefore the error of a prediction from all rows before it. Under feedback this matters: an input depends on
the measurement errors before it, so that a filter that begins anew has innovations that are correlated with
the inputs (Ljung, System Identification, 2nd ed. (1999), 13.4).

A compiled library does the work as soon as it is built. Until then, and without a compiler, NumPy does; the
two agree up to rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.identification.engine.kalman_compiled import compiled

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class System:
    """A linear system over W stretches of K rows, in deviations from a path.

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
    follows : ndarray of bool, shape (W,), optional
        Stretches whose first state is the last state of the stretch before; by default none.
    """

    A: Array
    Q: Array
    drive: Array
    H: Array
    R: Array
    seen: Array
    P0: Array
    follows: NDArray[np.bool_] | None = None

    @property
    def chains(self) -> NDArray[np.intp]:
        """First stretch of each chain of stretches that follow each other, and the number of stretches."""
        W = len(self.P0)
        first = np.ones(W, dtype=bool) if self.follows is None else ~self.follows
        return np.append(np.flatnonzero(first), W)

    def turns(self) -> list[NDArray[np.intp]]:
        """Return the first stretches of all chains, then the second ones, and so on."""
        chains = self.chains
        place = np.concatenate([np.arange(count) for count in np.diff(chains)])
        return [np.flatnonzero(place == turn) for turn in range(int(place.max(initial=-1)) + 1)]


@dataclass(frozen=True, eq=False)
class Filtered:
    """Result of a filter run.

    Attributes
    ----------
    white : ndarray, shape (K, W, C, m)
        Whitened innovations of every column, ``L^-1 (seen - H Z)`` with ``S = L L'``.
    log_det : ndarray, shape (K, W, C)
        Logarithm of the variance of each innovation given those before it. The sum over the channels of a row
        is the logarithm of the determinant of S.
    """

    white: Array
    log_det: Array
    _gain: Array | None = None
    _back: Array | None = None
    _P: Array | None = None
    _Z: Array | None = None


def run_filter(system: System, *, keep: bool = False) -> Filtered:
    """Run the filter over all stretches.

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
    K, W, C, m = system.seen.shape
    n = system.H.shape[-1]
    white = np.empty((K, W, C, m))
    log_det = np.zeros((K, W, C))
    gains = np.empty((K, W, C, n)) if keep else None
    backs = np.empty((K, W, C, n)) if keep else None
    Ps = np.empty((K, W, n, n)) if keep else None
    Zs = np.empty((K, W, n, m)) if keep else None
    found = Filtered(white, log_det, gains, backs, Ps, Zs)
    library = compiled(n, C)
    if library:
        library.filter(
            system.chains,
            A=system.A, Q=system.Q, drive=system.drive, H=system.H, R=system.R, seen=system.seen,
            P0=system.P0, white=white, log_det=log_det, half=gains, back=backs, P=Ps, Z=Zs,
        )  # fmt: skip
        return found
    P, Z = system.P0.copy(), np.zeros((W, n, m))
    for turn, own in enumerate(system.turns()):
        if turn:
            P[own], Z[own] = P[own - 1], Z[own - 1]
        P[own], Z[own] = _filter_stretches(system, found, own, P[own], Z[own])
    return found


def _filter_stretches(
    system: System, found: Filtered, own: NDArray[np.intp], P: Array, Z: Array
) -> tuple[Array, Array]:
    """Filter some stretches side by side from their first states; return their last states."""
    A, Q, drive, H, seen = (a[:, own] for a in (system.A, system.Q, system.drive, system.H, system.seen))
    R = system.R[:, own]
    eye = np.arange(seen.shape[2])
    Ht, At = np.swapaxes(H, 2, 3), np.swapaxes(A, 2, 3)
    some = np.any(H, axis=(1, 2, 3))
    half = back = np.zeros(0)
    for k in range(len(seen)):
        if found._P is not None and found._Z is not None:
            found._P[k, own], found._Z[k, own] = P, Z
        if some[k]:
            # S = H P H' + R = L L',  w = L^-1 (y - H Z),  half = L^-1 H P
            # Z <- Z + P H' S^-1 (y - H Z) = Z + half' w,  P <- P - P H' S^-1 H P = P - half' half
            # log det S = 2 sum log L_ii
            PH = P @ Ht[k]
            S = H[k] @ PH
            S[:, eye, eye] += R[k]
            L = np.linalg.cholesky(S)
            Li = np.linalg.inv(L)
            found.log_det[k, own] = 2.0 * np.log(L[:, eye, eye])
            half, back = Li @ np.swapaxes(PH, 1, 2), Li @ H[k]  # len(own), C, n
            w = Li @ (seen[k] - H[k] @ Z)
            gain = np.swapaxes(half, 1, 2)
            Z, P = Z + gain @ w, P - gain @ half
        else:
            w, half, back = np.zeros_like(seen[k]), np.zeros_like(H[k]), np.zeros_like(H[k])
        found.white[k, own] = w
        if found._gain is not None and found._back is not None:
            found._gain[k, own], found._back[k, own] = half, back
        if k < len(A):
            # Prediction: P <- A P A' + Q,  Z <- A Z + drive
            P = A[k] @ P @ At[k] + Q[k]
            P = 0.5 * (P + np.swapaxes(P, 1, 2))
            Z = A[k] @ Z + drive[k]
    return P, Z


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
    found = Smoothed(
        np.empty((K, W, n)), np.empty((K, W, n, n)), np.empty((K - 1, W, n)), np.empty((K - 1, W, n, n))
    )
    library = compiled(n, half.shape[2])
    if library:
        library.smoother(
            system.chains,
            A=system.A, half=half, back=back, P=Ps, Z=Zs, white=filtered.white, weights=weights,
            state=found.state, covariance=found.covariance, push=found.push, information=found.information,
        )  # fmt: skip
        return found
    r, N = np.zeros((W + 1, n)), np.zeros((W + 1, n, n))
    turns = system.turns()
    for own in reversed(turns):
        # The last stretch of a chain ends with r = N = 0, others with those of the one that follows.
        after = np.where(np.isin(own + 1, system.chains), W, own + 1)
        r[own], N[own] = _smooth_stretches(system, filtered, weights, found, own, r[after], N[after])
    return found


def _smooth_stretches(
    system: System,
    filtered: Filtered,
    weights: Array,
    found: Smoothed,
    own: NDArray[np.intp],
    r: Array,
    N: Array,
) -> tuple[Array, Array]:
    """Smooth some stretches side by side from r and N at their ends; return these at their begins."""
    kept = (filtered._gain, filtered._back, filtered._P, filtered._Z)
    half, back, Ps, Zs = (a[:, own] for a in kept if a is not None)
    A = system.A[:, own]
    z = np.einsum("kwnm,wm->kwn", Zs, weights[own])
    e = np.einsum("kwcm,wm->kwc", filtered.white[:, own], weights[own])
    eye = np.eye(Zs.shape[2])
    # Backward recursion, Durbin and Koopman (4.38), (4.42), with G = A (I - P H' S^-1 H) and v = y - H z:
    #   r <- H' S^-1 v + G' r,  N <- H' S^-1 H + G' N G,  x = z + P r,  V = P - P N P
    # In whitened form: back = L^-1 H, half = L^-1 H P, e = L^-1 v, so H' S^-1 v = back' e.
    for k in range(len(Zs) - 1, -1, -1):
        if k < len(A):
            found.push[k, own], found.information[k, own] = r, N
            r = (np.swapaxes(A[k], 1, 2) @ r[..., None])[..., 0]
            N = np.swapaxes(A[k], 1, 2) @ N @ A[k]
        T = np.swapaxes(back[k], 1, 2)  # len(own), n, C
        I_KH = eye - np.swapaxes(half[k], 1, 2) @ back[k]
        r = (np.swapaxes(I_KH, 1, 2) @ r[..., None])[..., 0] + (T @ e[k][..., None])[..., 0]
        N = np.swapaxes(I_KH, 1, 2) @ N @ I_KH + T @ back[k]
        found.state[k, own] = z[k] + (Ps[k] @ r[..., None])[..., 0]
        found.covariance[k, own] = Ps[k] - Ps[k] @ N @ Ps[k]
    return r, N
