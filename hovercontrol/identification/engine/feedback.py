"""Whether inputs of a log answer its measurements: feedback by a controller or a pilot.

Estimates from predictions of the next row need not know of feedback. Predictions over many rows do: an input
then tells of the disturbances that it answered, and the rows in between, which would tell the same, are not
used (Ljung, System Identification, 2nd ed. (1999), 13.4).
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment

#: Number of innovations up to each row that predict an input, less one; number of its own values before. With
#: few of these, innovations of an incomplete model would tell of the input what its older values tell.
LAGS, PAST = 10, 40


def fed_back(fit: Fit, level: float) -> bool:
    """Return whether an input depends on innovations of the fit, beyond its own past.

    Parameters
    ----------
    level : float
        Probability of a false answer, for all inputs together.
    """
    # Regression of an input u on its past, residual v, then of v on innovations e up to the same row: with
    # R^2 of the latter, N R^2 is chi-square distributed if only its own past tells of u (Lagrange multiplier
    # form of the test of Granger, Econometrica 37 (1969)).
    problem, pieces = fit.problem, pieces_of(fit)
    for i in range(len(problem.block.inputs)):
        own, past, errors = (
            np.concatenate([part for part in parts if len(part)] or [np.zeros((0, 1))])
            for parts in zip(*(_lagged(u[i], e) for u, e in pieces), strict=True)
        )
        if len(own) <= 4 * (past.shape[1] + errors.shape[1]) or not np.any(own != own[0]):
            continue
        left = own - past @ np.linalg.lstsq(past, own, rcond=None)[0]
        errors -= past @ np.linalg.lstsq(past, errors, rcond=None)[0]
        fitted = errors @ np.linalg.lstsq(errors, left, rcond=None)[0]
        share = float((fitted**2).sum() / max((left**2).sum(), 1e-300))
        rank = int(np.linalg.matrix_rank(errors))
        if stats.chi2.sf(len(own) * share, rank) < level / len(problem.block.inputs):
            return True
    return False


def pieces_of(fit: Fit) -> list[tuple[Array, Array]]:
    """Return the inputs (n_inputs, N) and whitened innovations (N, C) of each unbroken piece, by row."""
    white = run_filter(augment(fit.problem, fit.linear, fit.noise, unknowns=False), rows=True).white[..., 0]
    return [_piece(fit, white, int(n)) for n in np.unique(fit.problem.rows.piece)]


def _piece(fit: Fit, white: Array, number: int) -> tuple[Array, Array]:
    rows = fit.problem.rows
    own = np.flatnonzero(rows.piece == number)
    at = rows.at[:, own].T.ravel()
    there = at >= 0
    log = fit.problem.logs[int(rows.log[own[0]])]
    return log.inputs[:, at[there]], white[:, own].swapaxes(0, 1).reshape(-1, white.shape[2])[there]


def _lagged(u: Array, e: Array) -> tuple[Array, Array, Array]:
    """Return an input from row PAST on, (n, 1), 1 and its past values, and the innovations up to each row."""
    n = max(len(u) - PAST, 0)
    back = [u[PAST - k : PAST - k + n] for k in range(1, PAST + 1)]
    errors = [e[PAST - k : PAST - k + n] for k in range(LAGS + 1)]
    return u[PAST:, None][:n], np.stack([np.ones(n), *back], axis=1), np.concatenate(errors, axis=1)
