"""Linear algebra of observability: the unobservable subspace of a pair, and the Gramian over a window."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg

from hovercontrol.base.arrays import Array

#: Relative size below which a singular value counts as zero. Jacobians are exact to rounding, 1e-16, but the
#: bases of subspaces lose some digits.
ZERO = 1e-9


def unobservable(A: Array, C: Array) -> Array:
    """Return an orthonormal basis of the unobservable subspace as columns, shape (n, n - rank)."""
    # V <- null(C), then V <- {v in V : A v in V} until the dimension no longer changes.
    basis = _null_space(C)
    scale = max(float(np.linalg.norm(A, 2)), np.finfo(float).tiny)
    while basis.shape[1]:
        # (I - V V') A V: the part of A V outside the subspace; keep the directions for which it is zero.
        out = (A @ basis - basis @ (basis.T @ (A @ basis))) / scale
        kept = _null_space(out, 1.0)
        if kept.shape[1] == basis.shape[1]:
            break
        basis = np.linalg.qr(basis @ kept)[0]
    return basis


def _null_space(matrix: Array, size: float | None = None) -> Array:
    _, s, Vt = np.linalg.svd(matrix)
    largest = (s[0] if s.size else 0.0) if size is None else size
    return np.asarray(Vt[int((s > ZERO * largest).sum()) :].T)


def gramian_over(A: Array, C: Array, window: float) -> Array:
    """Return the observability Gramian W(window) of the pair (A, C).

    W of a short window follows from Van Loan's matrix exponential, and W of the whole window from the
    doubling W(2T) = W(T) + Phi(T)' W(T) Phi(T). Van Loan, Computing integrals involving the matrix
    exponential, IEEE TAC 23 (1978). Over a long window Van Loan's matrix would contain exp(-A T), which
    overflows for fast modes.
    """
    # exp([[-A', C'C], [0, A]] T) = [[., M], [0, Phi]]:  W(T) = Phi' M.
    n = len(A)
    doublings = max(0, math.ceil(math.log2(max(float(np.linalg.norm(A, 2)) * window, 1.0))))
    short = window / 2**doublings
    whole = scipy.linalg.expm(np.block([[-A.T, C.T @ C], [np.zeros((n, n)), A]]) * short)
    Phi = whole[n:, n:]
    W = Phi.T @ whole[:n, n:]
    for _ in range(doublings):
        W, Phi = W + Phi.T @ W @ Phi, Phi @ Phi
    return np.asarray((W + W.T) / 2)


def gramian_over_steps(A: Array, C: Array, steps: int) -> Array:
    """Return the observability Gramian of ``x+ = A x, y = C x`` over a number of samples.

    ``W(N) = sum over k < N of A'^k C' C A^k``, by the doubling W(2 N) = W(N) + A'^N W(N) A^N.

    Examples
    --------
    >>> gramian_over_steps(np.array([[0.5]]), np.array([[1.0]]), 3)  # 1 + 1/4 + 1/16
    array([[1.3125]])
    """
    W, before = np.zeros(A.shape), np.eye(len(A))  # of the samples so far; A to their number
    piece, Phi = C.T @ C, A  # W(2^j), A^(2^j)
    while steps:
        if steps % 2:
            W, before = W + before.T @ piece @ before, Phi @ before
        piece, Phi, steps = piece + Phi.T @ piece @ Phi, Phi @ Phi, steps // 2
    return np.asarray((W + W.T) / 2)


def readable(rows: Array) -> Array:
    """Return an equivalent basis of the row space, by Gauss-Jordan elimination.

    Each row has a pivot column in which it is 1 and all other rows are 0.
    """
    rows = rows.copy()
    for k in range(len(rows)):
        size = np.abs(rows[k:]).max(axis=0)
        lead = int(np.flatnonzero(size >= size.max() * (1 - 1e-6))[0])
        pick = k + int(np.abs(rows[k:, lead]).argmax())
        rows[[k, pick]] = rows[[pick, k]]
        rows[k] /= rows[k, lead]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, lead] * rows[k]
    return rows
