"""One pass over logs: the model linearised about a path, filtered, the unknowns solved for, smoothed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.kalman import Smoothed, System, run_filter, run_smoother
from hovercontrol.estimation.noise import Noise, augment
from hovercontrol.estimation.prior import Prior
from hovercontrol.estimation.problem import Linear, Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Largest step of an unknown that is sought by its logarithm.
FARTHEST = 1.0


@dataclass(frozen=True, eq=False)
class Pass:
    """One linearisation with its filter and smoother.

    Attributes
    ----------
    p : ndarray, shape (P,)
    path : ndarray, shape (K, W, n_states)
        About which the model is linearised.
    linear : Linear
    system : System
    smooth : Smoothed
        Steps of the path, and the missing accelerations.
    cost : float
        Minus twice the log likelihood and the log prior, but for constants.
    block_costs : ndarray, shape (W,)
    S, g : ndarray, shapes (W, P, P), (W, P)
        Normal equations of the unknowns.
    step : ndarray, shape (P,)
        Of the unknowns, in the coordinates in which they are sought.
    predicted : float
        Reduction of the cost that this step predicts.
    squares : float
        The cost without the determinants of the filter: what steps reduce.
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
        """Return the steps of the unknowns, in the coordinates in which they are sought, and of the path."""
        along = np.zeros_like(self.path)
        along[..., list(problem.free)] = self.smooth.state[..., : len(problem.free)]
        return self.step, along


def run_pass(problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool) -> Pass:
    """Return one pass; a frozen one leaves the unknowns as they are."""
    linear = problem.linearise(path, p, unknowns=not frozen)
    system = augment(problem, linear, noise)
    filtered = run_filter(system, keep=True)
    every = products(filtered.white)
    costs = every[:, 0, 0] + filtered.log_det
    S, g = every[:, 1:, 1:], -every[:, 1:, 0]
    step, predicted = np.zeros(len(p)), 0.0
    if not frozen and len(p):
        step, predicted = _newton(problem, prior, p, S, g)
    smooth = run_smoother(system, filtered, np.ones(1) if frozen else np.concatenate([[1.0], step]))
    squares = float(every[:, 0, 0].sum()) + prior.cost(problem.inside(p))
    cost = squares + float(filtered.log_det.sum())
    return Pass(p, path, linear, system, smooth, cost, costs, S, g, step, predicted, squares)


def tried_pass(
    problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool
) -> Pass | None:
    """Return a pass; None where the model runs away."""
    try:
        with np.errstate(all="ignore"):
            now = run_pass(problem, noise, prior, p, path, frozen)
    except np.linalg.LinAlgError:
        return None
    return now if np.isfinite(now.cost) else None


def held(problem: Problem, p: Array, slope: Array) -> Mask:
    """Return which unknowns a bound holds back from where the cost falls."""
    return np.asarray(((p <= problem.lower) & (slope < 0)) | ((p >= problem.upper) & (slope > 0)))


def _newton(problem: Problem, prior: Prior, p: Array, S: Array, g: Array) -> tuple[Array, float]:
    """Return the step of the unknowns within their bounds, and the reduction that it predicts."""
    z = problem.inside(p)
    total = S.sum(axis=0) + np.diag(prior.precision)
    slope = g.sum(axis=0) - prior.slope(z)
    free = ~held(problem, p, slope)
    dz = np.zeros(len(z))
    for _ in range(len(z) + 1):
        dz[:] = 0.0
        if free.any():
            dz[free] = inverse(total[np.ix_(free, free)]) @ slope[free]
        back = free & held(problem, p, dz)
        if not back.any():
            break
        free &= ~back
    dz = np.where(problem.log_scale, np.clip(dz, -FARTHEST, FARTHEST), dz)
    dz = problem.inside(problem.outside(z + dz)) - z
    return dz, float(2.0 * dz @ slope - dz @ total @ dz)


def residuals(problem: Problem, now: Pass) -> Array:
    """Return measured minus smoothed path over that difference's standard deviation, shape (K, W, C)."""
    e, known = _smoothed(now)
    return np.where(problem.seen, e / np.sqrt(now.system.R - known), 0.0)


def alone(problem: Problem, now: Pass) -> tuple[Array, Array]:
    """Return how far each sample is off what all others say, and the variance that makes it likeliest.

    Returns
    -------
    ndarray, shape (K, W, C)
        Over the standard deviation that the difference has if the sample is as good as its channel.
    ndarray, shape (K, W, C)
        The likeliest noise variance of the sample over that of its channel, at least 1.
    """
    (e, known), R = _smoothed(now), now.system.R
    part = 1.0 - known / R  # what a sample's own pull on the path leaves of its deviation from all others
    own = problem.data.variance
    usual = R if own is None else R / own
    off, open_ = e / part, known / part
    z = np.where(problem.seen, off / np.sqrt(usual + open_), 0.0)
    return z, np.where(problem.seen, np.maximum((off**2 - open_) / usual, 1.0), 1.0)


def _smoothed(now: Pass) -> tuple[Array, Array]:
    """Return measured minus smoothed path, and the variance of that path in each channel, (K, W, C)."""
    system, smooth = now.system, now.smooth
    e = system.seen[..., 0] - (system.H @ smooth.state[..., None])[..., 0]
    known = ((system.H @ smooth.covariance) * system.H).sum(axis=-1)
    return e, np.clip(known, 0.0, (1.0 - 1e-6) * system.R)


def inverse(S: Array) -> Array:
    """Return the inverse of normal equations whose unknowns differ in size."""
    size = np.sqrt(np.maximum(np.diag(S), 1e-300))
    scaled = S / np.outer(size, size)
    return np.asarray(np.linalg.pinv(scaled, hermitian=True, rcond=1e-13) / np.outer(size, size))


def products(white: Array) -> Array:
    """Return the products of whitened columns of each block, shape (W, m, m)."""
    K, W, C, m = white.shape
    flat = white.transpose(1, 0, 2, 3).reshape(W, K * C, m)
    return np.asarray(np.swapaxes(flat, 1, 2) @ flat)
