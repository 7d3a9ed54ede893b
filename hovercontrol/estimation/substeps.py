"""Sub-steps from row to row: how many (so many that more change nothing), and what happens within them."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from hovercontrol.estimation.fit import CONVERGENCE, Fit, estimate
from hovercontrol.estimation.kalman import run_filter
from hovercontrol.estimation.noise import augment
from hovercontrol.estimation.problem import MOST as MOST_PIECES
from hovercontrol.estimation.problem import Problem
from hovercontrol.targets.shoot import shoot, shoot_with_slopes

Array = NDArray[np.float64]
Counts = NDArray[np.intp]


#: What halved sub-steps may change of a state in a step that keeps its long ones, in standard deviations of
#: that state, and rows about it whose steps must not need shorter ones: the next fit's path is another.
CLOSE, ABOUT = 1e-3, 5

#: Least standard deviation of a state relative to how far it ranges: a body that dry friction holds has none.
TINY = 1e-9

#: Fewest steps from row to row that are worth sub-steps of their own.
WORTH = 64


def pieces_needed(fit: Fit) -> Counts:
    """Return in how many sub-steps, of each step, finer ones do not change a fit's likelihood.

    The path and the unknowns are as fitted.

    Returns
    -------
    ndarray of int, shape (N,)
    """
    found, cost = fit.problem, float(fit.block_costs.sum())
    if found.each.min() < found.pieces:  # do the long ones still do?
        fine = _divided(found, found.pieces)
        if abs((of_fine := _cost(fit, fine)) - cost) >= CONVERGENCE.fine:
            found, cost = fine, of_fine
    while found.pieces < MOST_PIECES:
        finer = _divided(found, 2 * found.pieces)
        before, cost = cost, _cost(fit, finer)
        if abs(cost - before) < CONVERGENCE.fine:
            cost = before
            break
        found = finer
    return found.each if found is fit.problem else np.maximum(_sparing(fit, found, cost), fit.problem.each)


def _sparing(fit: Fit, fine: Problem, cost: float) -> Counts:
    """Return fewer sub-steps for the steps that need no more: friction is steep near standstill only."""
    n, coarse = len(fine.free), int(fit.problem.each.min())
    variance = np.diagonal(fit.covariance_of_path[1:], axis1=2, axis2=3)[..., :n]
    spread = np.sqrt(np.maximum(variance, (TINY * fine.spread) ** 2))
    wanted = fine.advance(fit.path, fit.p, jacobian=False)[0]
    each, pieces = np.full(fine.dt.shape, fine.pieces), fine.pieces // 2
    while pieces >= coarse:
        there = _divided(fine, pieces).advance(fit.path, fit.p, jacobian=False)[0]
        off = (np.abs(there - wanted) / spread).max(axis=-1)
        each[(each == 2 * pieces) & (maximum_filter1d(off, ABOUT, axis=0) < CLOSE)] = pieces
        pieces //= 2
    kinds, of = np.unique(each, return_counts=True)
    for kind, larger, count in zip(kinds[:-1], kinds[1:], of[:-1], strict=True):
        if count < WORTH:
            each[each == kind] = larger
    if abs(_cost(fit, _divided(fine, each.ravel())) - cost) < CONVERGENCE.fine:
        return np.asarray(each.ravel())
    return fine.each


def _divided(problem: Problem, pieces: int | Counts) -> Problem:
    """Return the problem in other sub-steps."""
    other = copy(problem)
    other.set_pieces(pieces)
    return other


def _cost(fit: Fit, problem: Problem) -> float:
    """Return what a fit's path and unknowns cost in a problem's sub-steps."""
    linear = problem.linearise(fit.path, fit.p, unknowns=False)
    filtered = run_filter(augment(problem, linear, fit.noise, unknowns=False))
    return float((filtered.white**2).sum() + filtered.log_det.sum())


def in_pieces(fit: Fit, pieces: Counts) -> Fit:
    """Return a fit in other sub-steps, begun where it ended."""
    if np.array_equal(pieces, fit.problem.each):
        return fit
    return estimate(_divided(fit.problem, pieces), fit.prior, fit.noise, p=fit.p, path=fit.path)


def settled_pieces(fit: Fit) -> Counts:
    """Return in how many sub-steps finer ones would change nothing after the model is fitted in them, too.

    In finer steps friction is often found to be steeper, and then wants still finer ones.

    Returns
    -------
    ndarray of int, shape (N,)
    """
    while not np.array_equal(pieces := pieces_needed(fit), fit.problem.each):
        try:
            fit = in_pieces(fit, pieces)
        except FloatingPointError:  # the caller's fit will tell
            break
    return pieces


def fine_enough(fit: Fit) -> Fit:
    """Return a fit in sub-steps so fine that finer ones do not change its likelihood.

    Sub-steps are halved until the cost at the same path and unknowns stays; then it is fitted once more.
    """
    return in_pieces(fit, pieces_needed(fit))


@dataclass(frozen=True, eq=False)
class Within:
    """What happens from row to row: N steps of S sub-steps each.

    Attributes
    ----------
    states : ndarray, shape (n_states, S, N)
        In the middles of sub-steps, as the model leads there from each row.
    response : ndarray, shape (n, n, S, N)
        [j, i]: what a unit push on free state j during a sub-step has become of free state i at the next row.
        A body that dry friction holds forgets it.
    """

    states: Array
    response: Array

    def become(self, push: Array) -> Array:
        """Return what pushes, shape (n, S, N), have become at the next rows, shape (n, N)."""
        found = np.zeros((len(push), push.shape[-1]))
        for own, response in zip(push, self.response, strict=True):
            if own.any():
                found += (response * own).sum(axis=1)
        return found


def within(fit: Fit) -> Within:
    """Return what happens within the steps of a fit."""
    problem = fit.problem
    n, S, N = len(problem.free), problem.pieces, problem.dt.size
    parameters = problem.parameters(fit.p)
    steps = problem.steps.finest(parameters)
    x = np.moveaxis(fit.path[:-1], 2, 0).reshape(-1, N)
    known = {i: v[None] for i, v in steps.lagged.items()}
    path = shoot(problem.block, steps.t[None], steps.h, steps.u[:, None], known, parameters, x)
    response, after = np.empty((n, n, S, N)), np.broadcast_to(np.eye(n)[:, :, None], (n, n, N))
    for s in reversed(range(S)):
        held = {i: v[s, None, None] for i, v in steps.lagged.items()}
        slopes = shoot_with_slopes(
            problem.block, steps.t[s, None, None], steps.h[s], steps.u[:, s, None, None], held, parameters,
            path[s], problem.columns(unknowns=False),
        )[1]  # fmt: skip
        before = np.einsum("ikN,kjN->ijN", after, slopes[list(problem.free)])
        response[:, :, s] = np.swapaxes(0.5 * steps.h[s] * (after + before), 0, 1)
        after = before
    return Within(np.moveaxis(0.5 * (path[:-1] + path[1:]), 1, 0), response)
