"""Step-size control along a path: sub-steps are halved until halving changes no state noticeably.

This is the usual error control by step halving (Hairer, Norsett and Wanner, Solving Ordinary Differential
Equations I, II.4), with the standard deviation of each state as its scale. :mod:`.substeps` says why short
sub-steps are needed. A body at rest stays at rest in sub-steps of any length. Therefore a second path, a
small distance away, shows whether small motions grow.
"""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy.ndimage import maximum_filter1d

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.problem import MOST, Problem
from hovercontrol.identification.engine.steps import Counts

#: CLOSE: largest change of a state by halving the sub-steps, in standard deviations of the state over the
#: root of the number of steps. Errors of one sign grow with the number of steps, noise with its root.
#: STEADY: largest relative change of a small motion by halving. ABOUT: number of rows about a step that are
#: refined with it, because the next pass runs along another path.
CLOSE, STEADY, ABOUT = 0.3, 0.1, 5

#: Size of a small motion, and smallest standard deviation of a state, relative to the spread of the state. A
#: body that dry friction holds would have the standard deviation zero.
SMALL = 1e-4

#: Standard deviation of a state before the first pass, relative to the spread of the state.
FIRST = 1e-2


def deviations(problem: Problem, variance: Array) -> Array:
    """Return the standard deviations of the free states, (K, W, n), from variances, (K, W, N)."""
    return np.sqrt(np.maximum(variance[..., : len(problem.free)], (SMALL * problem.spread) ** 2))


def controlled(problem: Problem, path: Array, p: Array, std: Array | None = None) -> Problem:
    """Return the problem with sub-steps that are short enough along a path; no sub-step becomes longer.

    Parameters
    ----------
    path : ndarray, shape (K, W, n_states)
    p : ndarray, shape (P,)
        Unknowns.
    std : ndarray, shape (K, W, n), optional
        Result of :func:`deviations`; None before the first pass.
    """
    if problem.period:
        return problem  # one step from tick to tick is exact
    # Of N steps, a step of end F(x; h) is halved while, for a small motion d about the path,
    #   |F(x; h) - F(x; h/2)| > CLOSE std / sqrt(N)  or  |dF(h) - dF(h/2)| > STEADY d,  dF = F(x + d) - F(x)
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
    """Return the problem with other numbers of sub-steps."""
    other = copy(problem)
    other.set_pieces(pieces)
    return other
