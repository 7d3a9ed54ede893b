"""How fine sub-steps must be along a path: until halved ones change no state by more than logs can tell.

The error control of every integrator (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
II.4), with the standard deviation of each state as its scale. What it is for is said in :mod:`.substeps`.
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from hovercontrol.estimation.problem import MOST, Problem
from hovercontrol.estimation.steps import Counts

Array = NDArray[np.float64]

#: Largest change of a state by halved sub-steps, in standard deviations of that state; and rows about such a
#: step that are divided with it: the next pass runs along another path.
CLOSE, ABOUT = 1e-2, 5

#: Least standard deviation of a state relative to how far it ranges: a body that dry friction holds has none.
TINY = 1e-9

#: Standard deviation of a state before the first pass tells it, relative to how far it ranges.
FIRST = 1e-2


def deviations(problem: Problem, covariance: Array) -> Array:
    """Return the standard deviations of the free states behind each step, (K-1, W, n), of (K, W, N, N)."""
    variance = np.diagonal(covariance[1:], axis1=2, axis2=3)[..., : len(problem.free)]
    return np.sqrt(np.maximum(variance, (TINY * problem.spread) ** 2))


def controlled(problem: Problem, path: Array, p: Array, std: Array | None = None) -> Problem:
    """Return a problem in sub-steps that are short enough along a path; none becomes longer.

    Parameters
    ----------
    problem : Problem
    path : ndarray, shape (K, W, n_states)
    p : ndarray, shape (P,)
        Unknowns.
    std : ndarray, shape (K-1, W, n), optional
        By :func:`deviations`; None before the first pass.
    """
    std = FIRST * problem.spread if std is None else std
    there = problem.advance(path, p, jacobian=False)[0]
    while True:
        finer = _divided(problem, np.minimum(2 * problem.each, MOST))
        halved = finer.advance(path, p, jacobian=False)[0]
        with np.errstate(invalid="ignore"):
            off = np.nan_to_num((np.abs(there - halved) / std).max(axis=-1), nan=np.inf)
        coarse = maximum_filter1d(off, ABOUT, axis=0) > CLOSE
        coarse &= problem.each.reshape(coarse.shape) < MOST
        if not coarse.any():
            return problem
        problem = _divided(problem, np.where(coarse.ravel(), finer.each, problem.each))
        there = np.where(coarse[..., None], halved, there)


def _divided(problem: Problem, pieces: Counts) -> Problem:
    """Return a problem in other sub-steps."""
    other = copy(problem)
    other.set_pieces(pieces)
    return other
