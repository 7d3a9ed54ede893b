"""Least squares with each window's initial states eliminated (Schur complement)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of whitened columns, each window's initial states eliminated.

    Attributes
    ----------
    S, g : ndarray, shapes (P, P), (P,)
    rest : float
        Sum of squares at zero step, the initial states at their best.
    back : tuple of ndarray
        ``dx0 = a - B dp``; shapes (W, n), (W, n, P).
    scores : ndarray, shape (W, P)
        What each window adds to g.
    """

    S: Array
    g: Array
    rest: float
    back: tuple[Array, Array]
    scores: Array


def reduce(whitened: Array, n: int, damping: Array | float = 0.0) -> Normal:
    """Eliminate the first `n` columns behind the residual, window by window.

    Parameters
    ----------
    whitened : ndarray, shape (W, K, C, 1 + n + P)
        Residual, then the columns of the initial states, then those of the unknowns.
    n : int
        Initial states.
    damping : ndarray, shape (W,), optional
        Levenberg-Marquardt's of each window's initial states, relative to the diagonal.
    """
    W = len(whitened)
    A = whitened.reshape(W, -1, whitened.shape[-1])
    products = A.swapaxes(1, 2) @ A
    squares, f, H = products[:, 0, 0], products[:, 1:, 0], products[:, 1:, 1:]
    size = np.sqrt(np.diagonal(H[:, :n, :n], axis1=1, axis2=2))
    size = np.where(size > 0, size, 1.0)
    scaled = H[:, :n, :n] / (size[:, :, None] * size[:, None, :])
    scaled = scaled + (1e-10 + np.broadcast_to(damping, W))[:, None, None] * np.eye(n)
    inverse = np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :])
    a = (inverse @ f[:, :n, None])[..., 0]
    B = inverse @ H[:, :n, n:]
    S = (H[:, n:, n:] - H[:, n:, :n] @ B).sum(axis=0)
    scores = f[:, n:] - np.einsum("wnp,wn->wp", H[:, :n, n:], a)
    rest = float((squares - np.einsum("wn,wn->w", f[:, :n], a)).sum())
    return Normal((S + S.T) / 2, scores.sum(axis=0), rest, (a, B), scores)


def scaled_inverse(S: Array) -> Array:
    """Return the inverse of normal equations whose unknowns differ in size; zero where they say nothing."""
    size = np.sqrt(np.maximum(np.diag(S), 0.0))
    scale = np.where(size > 1e-9, 1.0 / np.maximum(size, 1e-9), 0.0)
    both = np.outer(scale, scale)
    inverse: Array = np.linalg.inv(S * both + 1e-12 * np.eye(len(S)))
    return inverse * both


def inflation(scores: Array, S: Array, blocks: NDArray[np.intp]) -> float:
    """Return how much more scores vary from block to block than if windows were independent; 1 or more.

    Gusts outlast a window, so that neighbours are not independent.

    Parameters
    ----------
    scores : ndarray, shape (W, M)
    S : ndarray, shape (M, M)
        Their covariance if windows were independent.
    blocks : ndarray of int, shape (W,)
        To which block each window belongs.
    """
    sums = np.zeros((int(blocks.max()) + 1, scores.shape[1]))
    np.add.at(sums, blocks, scores)
    expected = np.diag(S)
    known = expected > 0
    if not known.any():
        return 1.0
    return max(1.0, float(np.median((sums**2).sum(axis=0)[known] / expected[known])))
