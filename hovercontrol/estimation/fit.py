"""Maximum likelihood under process noise: path, unknowns and noise of one model on logs.

Each pass linearises the model from row to row about the path, runs one Kalman filter with a column for every
unknown, solves for the unknowns, and smooths: a step of Gauss and Newton on path and unknowns together (Bell,
SIAM J. Optim. 4 (1994): the iterated Kalman smoother), with a prior. The same smoother says how the levels of
noise should move (Koopman and Shephard, Biometrika 79 (1992)).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.kalman import Filtered, Smoothed, System, run_filter, run_smoother
from hovercontrol.estimation.noise import Noise, augment, moved, timed
from hovercontrol.estimation.outliers import outliers
from hovercontrol.estimation.prior import Prior
from hovercontrol.estimation.problem import MOST as MOST_PIECES
from hovercontrol.estimation.problem import Linear, Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Passes at most in which the levels of noise move, and afterwards.
MOVING, STILL = 14, 8

#: Passes at most in which samples are left out before levels of noise move: large outliers hide small ones.
GATES = 8

#: Times at most that samples are left out of a fit that has settled, and passes in which levels then move.
ROUNDS, AGAIN = 12, 4

#: Change of the cost by halved sub-steps that does not matter: an effect must bring ten times as much.
FINE = 2.0

#: Factors by which correlation times are tried, the largest and the smallest.
COARSEST, FINEST = 2.0, 1.2

#: Passes of a refit before levels of noise move.
HOLD = 2

#: Change of minus twice the log likelihood at which a fit has settled, moving and still.
SETTLED, STOPPED = 1.0, 0.05

#: Passes after which a path that flips between two sides of a kink (stick or slip) is taken as settled.
ENOUGH = 3

#: Largest step of an unknown that is sought by its logarithm.
FARTHEST = 1.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit ended.

    Attributes
    ----------
    problem : Problem
    p : ndarray, shape (P,)
    path : ndarray, shape (K, W, n_states)
    noise : Noise
    prior : Prior
    linear : Linear
        About the path.
    cost : float
        Minus twice the log likelihood and the log prior, but for constants.
    block_costs : ndarray, shape (B,)
        What each block adds to the cost.
    S, g : ndarray, shapes (B, P, P), (B, P)
        Normal equations of each block, in the coordinates in which unknowns are sought.
    missing : ndarray, shape (K, W, q)
        The smoothed missing accelerations.
    drift : ndarray, shape (K, W, C)
        The smoothed error of a navigation in each channel.
    covariance_of_path : ndarray, shape (K, W, n + q, n + q)
        Of free states and missing accelerations (and drift), the unknowns as they are.
    left : ndarray, shape (K, W, C)
        Measured minus smoothed path, in standard deviations of that; zero where not measured.
    converged : bool
    """

    problem: Problem
    p: Array
    path: Array
    noise: Noise
    prior: Prior
    linear: Linear
    cost: float
    block_costs: Array
    S: Array
    g: Array
    missing: Array
    drift: Array
    covariance_of_path: Array
    left: Array
    converged: bool

    @property
    def model(self):  # type: ignore[no-untyped-def]
        """The model with the unknowns as fitted."""
        return self.problem.model.with_coefficients(self.problem.coefficients(self.p))

    @property
    def movable(self) -> NDArray[np.intp]:
        """Unknowns that no bound holds."""
        slope = self.g.sum(axis=0) - self.prior.slope(self.problem.inside(self.p))
        return np.flatnonzero(~_held(self.problem, self.p, slope))

    @property
    def covariance(self) -> Array:
        """Covariance of the unknowns in their own units, shape (P, P): what noise leaves open.

        Blocks that scatter more than noise explains widen it (a sandwich; Liang and Zeger, Biometrika 73,
        1986): process noise has a shape that no model knows.
        """
        problem, z = self.problem, self.problem.inside(self.p)
        S = self.S.sum(axis=0) + np.diag(self.prior.precision)
        C = inverse(S)
        W = len(self.S)
        if W >= 8 and np.any(self.noise.process > 0):
            scores = self.g - self.prior.slope(z) / W
            meat = scores.T @ scores * W / (W - 1)
            robust = C @ meat @ C
            widen = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(C), 1e-300), 1.0))
            C = C * np.outer(widen, widen)
        slope = problem.slope(self.p)
        return C * np.outer(slope, slope)


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


@dataclass(frozen=True, eq=False)
class _Pass:
    """One linearisation with its filter and smoother."""

    linear: Linear
    system: System
    filtered: Filtered
    smooth: Smoothed
    cost: float
    block_costs: Array
    S: Array
    g: Array
    dz: Array
    gain: float  # predicted reduction of the cost


def _held(problem: Problem, p: Array, slope: Array) -> Mask:
    return np.asarray(((p <= problem.lower) & (slope < 0)) | ((p >= problem.upper) & (slope > 0)))


def _newton(problem: Problem, prior: Prior, p: Array, S: Array, g: Array) -> tuple[Array, float]:
    """Return the step of the unknowns within their bounds, and the reduction that it predicts."""
    z = problem.inside(p)
    total = S.sum(axis=0) + np.diag(prior.precision)
    slope = g.sum(axis=0) - prior.slope(z)
    free = ~_held(problem, p, slope)
    dz = np.zeros(len(z))
    for _ in range(len(z) + 1):
        dz[:] = 0.0
        if free.any():
            dz[free] = inverse(total[np.ix_(free, free)]) @ slope[free]
        back = free & _held(problem, p, dz)
        if not back.any():
            break
        free &= ~back
    dz = np.where(problem.log_scale, np.clip(dz, -FARTHEST, FARTHEST), dz)
    dz = problem.inside(problem.outside(z + dz)) - z
    return dz, float(2.0 * dz @ slope - dz @ total @ dz)


def _run(problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool) -> _Pass:
    linear = problem.linearise(path, p, unknowns=not frozen)
    system = augment(problem, linear, [noise])
    filtered = run_filter(system, keep=True)
    every = products(filtered.white)
    costs = every[:, 0, 0] + filtered.log_det
    S, g = every[:, 1:, 1:], -every[:, 1:, 0]
    dz, gain = np.zeros(len(p)), 0.0
    if not frozen and len(p):
        dz, gain = _newton(problem, prior, p, S, g)
    weights = np.ones(1) if frozen else np.concatenate([[1.0], dz])
    smooth = run_smoother(system, filtered, weights)
    cost = float(costs.sum()) + prior.cost(problem.inside(p))
    return _Pass(linear, system, filtered, smooth, cost, costs, S, g, dz, gain)


def _tried(problem: Problem, noise: Noise, prior: Prior, p: Array, path: Array, frozen: bool) -> _Pass | None:
    """Return a pass; None where the model runs away."""
    try:
        with np.errstate(all="ignore"):
            now = _run(problem, noise, prior, p, path, frozen)
    except np.linalg.LinAlgError:
        return None
    return now if np.isfinite(now.cost) else None


def estimate(
    problem: Problem,
    prior: Prior,
    noise: Noise,
    *,
    p: Array | None = None,
    path: Array | None = None,
    frozen: bool = False,
    levels: bool = True,
    gate: bool = False,
    most: int = MOVING,
    hold: int = 0,
    times: bool = True,
    trace: Callable[[str], None] | None = None,
) -> Fit:
    """Fit path, unknowns and levels of noise.

    Parameters
    ----------
    problem : Problem
    prior : Prior
    noise : Noise
        To begin with.
    p, path : ndarray, optional
        To begin with; default: the problem's.
    frozen : bool, optional
        Whether the unknowns stay as they are.
    levels : bool, optional
        Whether the levels of noise move.
    gate : bool, optional
        Whether samples that stand out are left out (:mod:`.outliers`).
    most : int, optional
        Passes at most in which they do.
    hold : int, optional
        Passes before they do: a path that begins beside what the model says must not look like noise.
    times : bool, optional
        Whether correlation times of process noise move, too.
    trace : callable, optional
        Called with a line on each pass.

    Raises
    ------
    FloatingPointError
        If no path leads along the logs: the model runs away.
    """
    p = problem.start.copy() if p is None else problem.outside(problem.inside(p))
    path = problem.guess if path is None else path
    last = np.inf
    best: tuple[float, Array, Array] | None = None
    safe: tuple[Array, Array] | None = None
    push = np.zeros(0)
    k, still, converged, gated, rounds = 0, 0, False, 0, 0
    moving, factor = levels, COARSEST
    while True:
        now = _tried(problem, noise, prior, p, path, frozen)
        if trace and now:
            trace(f"  pass {k}: {now.cost:.2f} predicted {now.gain:.2f} {noise.process} {noise.seconds}")
        if now is None:
            if safe is None:
                raise FloatingPointError("the model runs away from the first row on")
            p, path = 0.5 * (p + safe[0]), 0.5 * (path + safe[1])
            k += 1
            if k > most + STILL:
                raise FloatingPointError("the model runs away")
            continue
        safe = p, path
        change = last - now.cost
        last = now.cost
        if not moving and (best is None or now.cost < best[0]):
            best = now.cost, p, path
        if gate and gated < GATES:
            stands_out = outliers(residuals(problem, now.system, now.smooth), problem.seen)
            gated = gated + 1 if stands_out.any() else GATES
            if stands_out.any():
                problem, last = problem.without(stands_out), np.inf
                p, path, k = _onward(problem, now, p), _moved_path(problem, now, path), k + 1
                continue
        enough = SETTLED if moving else STOPPED if still < ENOUGH else 2.0 * SETTLED
        settled = abs(change) < enough and now.gain < SETTLED
        while moving and settled and times and factor > FINEST:  # not before all factors were tried
            noise, further = timed(problem, now.linear, noise, factor)
            settled, factor = not further, factor if further else factor**0.5
        if moving and ((settled and k > hold) or k >= most + hold):
            moving = False
        elif not moving and (settled or still >= STILL):
            again = outliers(residuals(problem, now.system, now.smooth), problem.seen)
            if gate and again.any() and rounds < ROUNDS:
                rounds, best, still, moving = rounds + 1, None, 0, levels
                problem, last, most = problem.without(again), np.inf, k + AGAIN
                continue
            converged = bool(settled)
            break
        if moving and k >= hold:
            noise, push = moved(problem, noise, now.system, now.smooth, push)
            if times and (k - hold) % 3 == 1 and factor > FINEST:
                noise, further = timed(problem, now.linear, noise, factor)
                factor = factor if further else factor**0.5
        elif not moving:
            still += 1
        before = path
        p, path, k = _onward(problem, now, p), _moved_path(problem, now, path), k + 1
        if not moving and change < 0:  # to and fro about a kink of dry friction
            path = 0.5 * (before + path)
    if best is not None and best[0] < now.cost - STOPPED:
        _, p, path = best
        now = _run(problem, noise, prior, p, path, frozen)
    left = residuals(problem, now.system, now.smooth)
    n, rows = len(problem.free), problem.rows
    end = n + len(problem.driven)
    drift = (now.system.H[..., end:] @ now.smooth.state[..., end:, None])[..., 0]
    return Fit(
        problem, p, path, noise, prior, now.linear, now.cost,
        rows.by_block(now.block_costs), rows.by_block(now.S), rows.by_block(now.g),
        now.smooth.state[..., n:end], drift, now.smooth.covariance, left, converged,
    )  # fmt: skip


def _onward(problem: Problem, now: _Pass, p: Array) -> Array:
    """Return the unknowns a step further."""
    return problem.outside(problem.inside(p) + now.dz)


def _moved_path(problem: Problem, now: _Pass, path: Array) -> Array:
    """Return the path as smoothed."""
    step = np.zeros_like(path)
    step[..., list(problem.free)] = now.smooth.state[..., : len(problem.free)]
    return path + step


def residuals(problem: Problem, system: System, smooth: Smoothed) -> Array:
    """Return measured minus smoothed path over that difference's standard deviation, shape (K, W, C)."""
    e = system.seen[..., 0] - (system.H @ smooth.state[..., None])[..., 0]
    known = np.einsum("kwci,kwij,kwcj->kwc", system.H, smooth.covariance, system.H)
    spread = np.maximum(system.R - known, 1e-6 * system.R)
    return np.where(problem.seen, e / np.sqrt(spread), 0.0)


def refit(
    near: Fit,
    problem: Problem,
    prior: Prior,
    *,
    noise: Noise | None = None,
    p: Array | None = None,
    frozen: bool = False,
    levels: bool = True,
    times: bool = True,
    trace: Callable[[str], None] | None = None,
) -> Fit:
    """Fit another problem on the same rows from where a fit ended.

    Parameters
    ----------
    near : Fit
    problem : Problem
        Unknowns of the same name start where `near` ended, others where their model has them.
    prior : Prior
    noise : Noise, optional
        To begin with; default: that of `near`.
    p : ndarray, optional
        Unknowns to begin with.
    frozen, levels, times, trace
        As for :func:`estimate`.
    """
    ended = dict(zip(near.problem.names, near.p.tolist(), strict=True))
    if p is None:
        p = problem.start.copy()
        if not frozen:
            p = np.array([ended.get(name, v) for name, v in zip(problem.names, p.tolist(), strict=True)])
    path = problem.path_of(near.problem.block, near.path)
    return estimate(
        problem, prior, noise or near.noise, p=p, path=path, frozen=frozen, levels=levels, times=times,
        hold=HOLD, trace=trace,
    )  # fmt: skip


def first_noise(problem: Problem) -> Noise:
    """Return levels of noise to begin with: of the measurements as seen, and all acceleration missing."""
    data, q = problem.data, len(problem.driven)
    return Noise(data.noise, data.scales, problem.accelerations, np.full(q, 5.0 * problem.shortest))


def fine_enough(fit: Fit) -> Fit:
    """Return a fit in sub-steps so fine that finer ones do not change its likelihood.

    Each time sub-steps are halved, the cost at the same path and unknowns is compared.
    """
    while fit.problem.pieces < MOST_PIECES:
        finer = copy(fit.problem)
        finer.set_pieces(2 * fit.problem.pieces)
        linear = finer.linearise(fit.path, fit.p, unknowns=False)
        filtered = run_filter(augment(finer, linear, [fit.noise], unknowns=False))
        cost = float((filtered.white**2).sum() + filtered.log_det.sum())
        same = run_filter(augment(fit.problem, fit.linear, [fit.noise], unknowns=False))
        if abs(cost - float((same.white**2).sum() + same.log_det.sum())) < FINE:
            return fit
        fit = estimate(finer, fit.prior, fit.noise, p=fit.p, path=fit.path)
    return fit
