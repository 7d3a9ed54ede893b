"""How fine sub-steps must be along a path: until halved ones change no state by more than logs can tell.

The error control of every integrator (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
II.4), with the standard deviation of each state as its scale. What it is for is said in :mod:`.substeps`.
A body at rest stays there in sub-steps of any length: whether small motions of it grow is seen beside the
path.
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from hovercontrol.estimation.problem import MOST, Problem
from hovercontrol.estimation.steps import Counts

Array = NDArray[np.float64]

#: Largest change of a state by halved sub-steps, in its standard deviations over the root of the number of
#: steps: errors of one sign add up over all steps, noise over their root. Largest change of a small motion,
#: relative to it. Rows about such a step that are divided with it: the next pass runs along another path.
CLOSE, STEADY, ABOUT = 0.3, 0.1, 5

#: A small motion, and the least standard deviation of a state (a body that dry friction holds has none), in
#: parts of how far the state ranges.
SMALL = 1e-4

#: Standard deviation of a state before the first pass tells it, in parts of how far it ranges.
FIRST = 1e-2


def deviations(problem: Problem, covariance: Array) -> Array:
    """Return standard deviations of the free states, (K, W, n), of their covariance, (K, W, N, N)."""
    variance = np.diagonal(covariance, axis1=2, axis2=3)[..., : len(problem.free)]
    return np.sqrt(np.maximum(variance, (SMALL * problem.spread) ** 2))


def controlled(problem: Problem, path: Array, p: Array, std: Array | None = None) -> Problem:
    """Return a problem in sub-steps that are short enough along a path; none becomes longer.

    Parameters
    ----------
    problem : Problem
    path : ndarray, shape (K, W, n_states)
    p : ndarray, shape (P,)
        Unknowns.
    std : ndarray, shape (K, W, n), optional
        By :func:`deviations`; None before the first pass.
    """
    least = (FIRST * problem.spread if std is None else std[1:]) * CLOSE / np.sqrt(problem.dt.size)
    beside = path.copy()
    beside[..., list(problem.free)] += SMALL * problem.spread

    def ends(problem: Problem) -> tuple[Array, Array]:
        here, there = (problem.advance(x, p, jacobian=False)[0] for x in (path, beside))
        return here, there - here

    end, motion = ends(problem)
    while True:
        finer = _divided(problem, np.minimum(2 * problem.each, MOST))
        finer_end, finer_motion = ends(finer)
        with np.errstate(all="ignore"):
            off = np.abs(end - finer_end) / least
            grown = np.abs(motion - finer_motion) / (STEADY * SMALL * problem.spread)
            worst = np.nan_to_num(np.maximum(off, grown).max(axis=-1), nan=np.inf)
        coarse = maximum_filter1d(worst, ABOUT, axis=0) > 1.0
        coarse &= problem.each.reshape(coarse.shape) < MOST
        if not coarse.any():
            return problem
        problem = _divided(problem, np.where(coarse.ravel(), finer.each, problem.each))
        end = np.where(coarse[..., None], finer_end, end)
        motion = np.where(coarse[..., None], finer_motion, motion)


def _divided(problem: Problem, pieces: Counts) -> Problem:
    """Return a problem in other sub-steps."""
    other = copy(problem)
    other.set_pieces(pieces)
    return other
