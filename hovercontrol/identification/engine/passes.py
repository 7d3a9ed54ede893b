"""One pass over the logs: linearise the model about a path, filter, solve for the unknowns, smooth.

Unknowns are the parameters of the model that a fit estimates. They are sought in scaled coordinates z: the
logarithm of parameters that keep their sign, the value itself for all others (:class:`.Unknowns`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.kalman import Smoothed, System, run_filter, run_smoother
from hovercontrol.identification.engine.noise import Noise, augment, left_of
from hovercontrol.identification.engine.prior import Prior
from hovercontrol.identification.engine.problem import Linear, Problem

#: Largest step of an unknown whose logarithm is estimated.
FARTHEST = 1.0

#: Smallest pivot of the Cholesky factor of scaled normal equations that are solved as they are. Its square is
#: the part of an unknown that no other stands for, so rounding changes a solution by some 2e-16 / 1e-10.
REGULAR = 1e-5


@dataclass(frozen=True, eq=False)
class Pass:
    """One linearisation with its filter and smoother.

    With the whitened residuals w0 and the whitened sensitivities J of a stretch, its normal equations are
    ``S dz = g`` with ``S = J'J`` and ``g = -J'w0``. They take the gains of the filter as fixed.

    Attributes
    ----------
    p : ndarray, shape (P,)
        Unknowns in their own units.
    path : ndarray, shape (K, W, n_states)
        States about which the model is linearised.
    linear : Linear
    system : System
    smooth : Smoothed
        Step of the path, and the missing accelerations.
    cost : float
        Minus twice the sum of log likelihood and log prior, up to a constant.
    block_costs : ndarray, shape (W,)
        Minus twice the log likelihood of each block, up to a constant.
    S, g : ndarray, shapes (W, P, P), (W, P)
        Normal equations of the unknowns, by block.
    step : ndarray, shape (P,)
        Step of the unknowns, in scaled coordinates.
    predicted : float
        Predicted reduction of the cost by this step.
    squares : float
        The cost without the log determinants of the filter: the part that the steps reduce.
    """

    p: Array
    path: Array
    linear: Linear
    system: System
    smooth: Smoothed
    cost: float
    block_costs: Array
    S: Array
    g: Array
    step: Array
    predicted: float
    squares: float

    def steps(self, problem: Problem) -> tuple[Array, Array]:
        """Return the step of the unknowns, in scaled coordinates, and the step of the path."""
        along = np.zeros_like(self.path)
        along[..., list(problem.free)] = self.smooth.state[..., : len(problem.free)]
        return self.step, along


def run_pass(problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool) -> Pass:
    """Return one pass; if `frozen`, the unknowns keep their values."""
    path = problem.rows.joined(path)
    linear = problem.linearise(path, p, unknowns=not frozen)
    system = augment(problem, linear, noise)
    filtered = run_filter(system)
    # With whitened columns [w0, J]:  w0'w0 + log det = -2 log likelihood,  S = J'J,  g = -J'w0
    every = filtered.products
    costs = every[:, 0, 0] + filtered.log_dets
    S, g = every[:, 1:, 1:], -every[:, 1:, 0]
    step, predicted = np.zeros(len(p)), 0.0
    if not frozen and len(p):
        step, predicted = newton(problem, prior, p, S, g)
    smooth = run_smoother(system, filtered, np.ones(1) if frozen else np.concatenate([[1.0], step]))
    squares = float(every[:, 0, 0].sum()) + prior.cost(problem.inside(p))
    cost = squares + float(filtered.log_dets.sum())
    return Pass(p, path, linear, system, smooth, cost, costs, S, g, step, predicted, squares)


def costs_of(problem: Problem, noise: Noise, prior: Prior, now: Pass) -> tuple[float, float]:
    """Return what the squares and the cost of a pass would be under other noise levels."""
    try:
        filtered = run_filter(augment(problem, now.linear, noise, unknowns=False))
    except np.linalg.LinAlgError:
        return np.inf, np.inf
    squares = float(filtered.products.sum()) + prior.cost(problem.inside(now.p))
    return squares, squares + float(filtered.log_dets.sum())


def tried_pass(
    problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool
) -> Pass | None:
    """Return a pass; None if the model diverges."""
    try:
        with np.errstate(all="ignore"):
            now = run_pass(problem, noise, prior, p, path, frozen)
    except np.linalg.LinAlgError:
        return None
    return now if np.isfinite(now.cost) else None


def newton(problem: Problem, prior: Prior, p: Array, S: Array, g: Array) -> tuple[Array, float]:
    """Return the step that solves normal equations within the bounds, and its predicted reduction.

    Parameters
    ----------
    S, g : ndarray, shapes (W, P + M, P + M), (W, P + M)
        Normal equations of the unknowns, in scaled coordinates, and of M noise levels on a log scale. The
        steps of these are kept short, as the information on a level changes with it: a proximal term adds 1.
    """
    # Minimise |w0 + J dz|^2 + (z + dz - c)' Lambda (z + dz - c), Lambda and c of the prior:
    #   (S + Lambda) dz = g - Lambda (z - c)
    # An unknown at a bound leaves the free set if the step would cross that bound. One of which the logs tell
    # nothing to working precision does not move: its step would be a rounding error over almost zero.
    z, P = problem.inside(p), len(p)
    total, slope = S.sum(axis=0), g.sum(axis=0)
    total[range(P), range(P)] += prior.precision
    total[range(P, len(slope)), range(P, len(slope))] += 1.0
    slope[:P] -= prior.slope(z)
    free = np.ones(len(slope), dtype=bool)
    known = np.diag(total)[:P]
    free[:P] = ~problem.held(p, slope[:P]) & (known > np.finfo(float).eps * known.max(initial=0.0))
    dz = np.zeros(len(slope))
    for _ in range(P + 1):
        dz[:] = 0.0
        if free.any():
            dz[free] = inverse(total[np.ix_(free, free)]) @ slope[free]
        back = free[:P] & problem.held(p, dz[:P])
        if not back.any():
            break
        free[:P] &= ~back
    logs = np.concatenate([problem.log_scale, np.ones(len(dz) - P, dtype=bool)])
    dz = np.where(logs, np.clip(dz, -FARTHEST, FARTHEST), dz)
    dz[:P] = problem.inside(problem.outside(z + dz[:P])) - z
    # Predicted reduction: 2 dz' (g - Lambda (z - c)) - dz' (S + Lambda) dz
    return dz, float(2.0 * dz @ slope - dz @ total @ dz)


def residuals(problem: Problem, now: Pass) -> Array:
    """Return measured minus smoothed path, over the standard deviation of that difference, shape (K, W, C).

    With the smoothed variance h V h' of a channel, ``var(y - h x) = R - h V h'``.
    """
    e, known = _smoothed(now)
    return np.where(problem.seen, e / np.sqrt(now.system.R - known), 0.0)


def leave_one_out(problem: Problem, now: Pass) -> tuple[Array, Array]:
    """Return the leave-one-out residual of each sample, and its maximum likelihood noise variance.

    Returns
    -------
    ndarray, shape (K, W, C)
        Deviation of the sample from its prediction by all other samples, over the standard deviation of that
        deviation if the sample has the usual noise of its channel.
    ndarray, shape (K, W, C)
        Maximum likelihood noise variance of the sample relative to that of its channel, at least 1.
    """
    # Leave-one-out residual d and prediction variance v from the smoothed residual e and variance V = h V h':
    #   d = e / (1 - V/R),  v = V / (1 - V/R),  z = d / sqrt(R_channel + v),  R_sample = d^2 - v
    (e, known), R = _smoothed(now), now.system.R
    part = 1.0 - known / R
    own = problem.data.variance
    usual = R if own is None else R / own
    off, open_ = e / part, known / part
    z = np.where(problem.seen, off / np.sqrt(usual + open_), 0.0)
    return z, np.where(problem.seen, np.maximum((off**2 - open_) / usual, 1.0), 1.0)


def _smoothed(now: Pass) -> tuple[Array, Array]:
    """Return measured minus smoothed path, and the smoothed variance ``h V h'`` of each channel.

    Both have shape (K, W, C). The variance is kept below R.
    """
    e = left_of(now.system, now.smooth, now.step)
    return e, np.clip(now.smooth.known, 0.0, (1.0 - 1e-6) * now.system.R)


def inverse(S: Array) -> Array:
    """Return the pseudo-inverse of normal equations, (..., P, P), whose unknowns differ in scale.

    ``D^-1 (D^-1 S D^-1)^+ D^-1`` with ``D = diag(sqrt(S_ii))``.
    """
    size = np.sqrt(np.maximum(np.diagonal(S, axis1=-2, axis2=-1), 1e-300))
    both = size[..., :, None] * size[..., None, :]
    return np.asarray(np.linalg.pinv(S / both, hermitian=True, rcond=1e-13) / both)


def solved(S: Array, f: Array) -> Array:
    """Return ``inverse(S) f`` of normal equations, (..., P), without the inverse where they are regular."""
    size = np.sqrt(np.maximum(np.diagonal(S, axis1=-2, axis2=-1), 1e-300))
    alike = S / (size[..., :, None] * size[..., None, :])
    try:
        pivots = np.diagonal(np.linalg.cholesky(alike), axis1=-2, axis2=-1)
        regular = bool(pivots.min(initial=1.0) > REGULAR)
    except np.linalg.LinAlgError:
        regular = False
    if regular:
        return np.asarray(np.linalg.solve(alike, (f / size)[..., None])[..., 0] / size)
    return np.asarray((inverse(S) @ f[..., None])[..., 0])


def left_out_gain(G: Array, f: Array, precision: Array, pull: Array) -> float:
    """Return the cross-validated gain of unknowns: each block is predicted from all others.

    With the sums G and f over all blocks and the precision Lambda of a prior::

        theta_(-b) = (G - G_b + Lambda)^-1 (f - f_b - pull),
        gain = sum over blocks b of (2 f_b' theta_(-b) - theta_(-b)' G_b theta_(-b))

    Parameters
    ----------
    G, f : ndarray, shapes (W, P, P), (W, P)
        Of each block.
    precision, pull : ndarray, shapes (P, P), (P,)
        Of the prior, and its slope.
    """
    theta = solved(G.sum(axis=0) - G + precision, f.sum(axis=0) - f - pull)
    return float(2.0 * (f * theta).sum() - np.einsum("wi,wij,wj->", theta, G, theta))


def products(white: Array) -> Array:
    """Return the inner products of the whitened columns of each block, shape (W, m, m)."""
    K, W, C, m = white.shape
    flat = white.transpose(1, 0, 2, 3).reshape(W, K * C, m)
    return np.asarray(np.swapaxes(flat, 1, 2) @ flat)
