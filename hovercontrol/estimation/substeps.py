"""In how many sub-steps the model is stepped from row to row: so many that more change nothing."""

from __future__ import annotations

from copy import copy

from hovercontrol.estimation.fit import CONVERGENCE, Fit, estimate
from hovercontrol.estimation.kalman import run_filter
from hovercontrol.estimation.noise import augment
from hovercontrol.estimation.problem import MOST as MOST_PIECES


def pieces_needed(fit: Fit) -> int:
    """Return in how many sub-steps finer ones do not change a fit's likelihood at its path and unknowns."""
    problem, cost = fit.problem, float(fit.block_costs.sum())
    while problem.pieces < MOST_PIECES:
        finer = copy(problem)
        finer.set_pieces(2 * problem.pieces)
        linear = finer.linearise(fit.path, fit.p, unknowns=False)
        filtered = run_filter(augment(finer, linear, fit.noise, unknowns=False))
        before, cost = cost, float((filtered.white**2).sum() + filtered.log_det.sum())
        if abs(cost - before) < CONVERGENCE.fine:
            break
        problem = finer
    return problem.pieces


def in_pieces(fit: Fit, pieces: int) -> Fit:
    """Return a fit in other sub-steps, begun where it ended."""
    if pieces == fit.problem.pieces:
        return fit
    problem = copy(fit.problem)
    problem.set_pieces(pieces)
    return estimate(problem, fit.prior, fit.noise, p=fit.p, path=fit.path)


def fine_enough(fit: Fit) -> Fit:
    """Return a fit in sub-steps so fine that finer ones do not change its likelihood.

    Sub-steps are halved until the cost at the same path and unknowns stays; then it is fitted once more.
    """
    return in_pieces(fit, pieces_needed(fit))
