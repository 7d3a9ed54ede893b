"""Maximum likelihood estimation under process noise: path, unknowns and noise levels of one model on logs.

Each pass linearises the model from row to row about the path, runs one Kalman filter with a column for every
unknown, solves for the unknowns and smooths. This is a Gauss-Newton step on path and unknowns together, with
a prior (Bell, SIAM J. Optim. 4 (1994): the iterated Kalman smoother). The same smoother gives the derivative
of the likelihood with respect to the noise levels (Koopman and Shephard, Biometrika 79 (1992)).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.damping import Damping, Relaxation
from hovercontrol.identification.engine.kalman import run_filter, run_smoother
from hovercontrol.identification.engine.noise import ONWARD, Noise, moved, timed
from hovercontrol.identification.engine.outliers import OUTLIERS, outliers
from hovercontrol.identification.engine.passes import (
    Pass,
    costs_of,
    inverse,
    leave_one_out,
    newton,
    residuals,
    tried_pass,
)
from hovercontrol.identification.engine.prior import Prior
from hovercontrol.identification.engine.problem import Linear, Problem
from hovercontrol.identification.engine.scoring import EXCESS, NO_LEVELS, Levels, excess, of_unknowns, scores
from hovercontrol.identification.engine.step_control import controlled, deviations

#: Maximum number of passes that update the noise levels, and of passes afterwards.
MOVING, STILL = 14, 8

#: Maximum number of passes that remove outliers before noise levels are updated. Large outliers hide small
#: ones.
GATES = 8

#: Maximum number of rounds of outlier removal after a fit has settled, and of passes that then update the
#: noise levels.
ROUNDS, AGAIN = 12, 4

#: Maximum number of times that samples are down-weighted. The first times lower the noise of the channels, so
#: more samples stand out.
WEIGHTINGS = 4


@dataclass(frozen=True)
class Convergence:
    """When a fit has converged.

    Costs are minus twice the log likelihood. No published source: set by hand, exercised by
    tests/identification/engine/test_fit.py; an effect must gain 20 to be named (:class:`.Criteria`).

    Attributes
    ----------
    settled : float
        Largest change of the cost in a pass while noise levels are updated, and largest increase of the sum
        of squares in an accepted step. An unknown one standard error from its optimum raises the cost by 1.
    stopped : float
        Largest change of the cost in a pass under fixed noise levels.
    reached : float
        Largest predicted reduction of the cost by a step of the unknowns at convergence. It is the square of
        their distance from the optimum in standard errors: 0.01 is a tenth of a standard error.
    enough : int
        Number of passes after which a path that alternates between stick and slip counts as converged.
    idle : int
        Number of passes without a reduction of the lowest cost by `settled` after which a fit stops. Steep
        dry friction makes a path oscillate from pass to pass.
    """

    settled: float = 1.0
    stopped: float = 0.05
    reached: float = 0.01
    enough: int = 3
    idle: int = 4


#: The values in use.
CONVERGENCE = Convergence()


#: Largest and smallest factor by which correlation times are changed on trial.
COARSEST, FINEST = 2.0, 1.2

#: Maximum number of times that such a step is repeated with the same factor.
FURTHER = 3

#: Shortest fraction of a step that is tried, and the same if the model diverges at its end.
SHORTEST, TINIEST = 0.05, 1e-6

#: Fraction of the observed acceleration as which the process noise begins where a state has no guess.
HIDDEN = 1e-4
#: Level of the test whether the scores of blocks scatter more than the noise explains.
SCATTER = 0.05

#: Maximum number of scoring steps, and shortest fraction of one that is tried.
SCORED, LEAST_SCORED = 8, 0.1

#: Passes of a refit before the noise levels are updated.
HOLD = 2


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    problem : Problem
    p : ndarray, shape (P,)
        Estimated unknowns in their own units.
    path : ndarray, shape (K, W, n_states)
        Estimated states.
    noise : Noise
    prior : Prior
    cost : float
        Minus twice the sum of log likelihood and log prior, up to a constant.
    block_costs : ndarray, shape (B,)
        Minus twice the log likelihood of each block, up to a constant.
    S, g : ndarray, shapes (B, P, P), (B, P)
        Normal equations ``S dz = g`` of each block, in the scaled coordinates z of :class:`.Unknowns`.
    missing : ndarray, shape (K, W, q)
        The smoothed missing accelerations.
    drift : ndarray, shape (K, W, C)
        The smoothed error of a navigation in each channel.
    variance_of_path : ndarray, shape (K, W, N)
        Variance of all states of :func:`.augment` (free states first, then missing accelerations), given
        the unknowns.
    left : ndarray, shape (K, W, C)
        Measured minus smoothed path, in standard deviations of that difference; zero where not measured.
    converged : bool
    scored : bool
        Whether it, and each fit that starts from it, is at the optimum of unknowns and noise levels together
        (:mod:`.scoring`).
    """

    problem: Problem
    p: Array
    path: Array
    noise: Noise
    prior: Prior
    cost: float
    block_costs: Array
    S: Array
    g: Array
    missing: Array
    drift: Array
    variance_of_path: Array
    left: Array
    converged: bool
    scored: bool = False

    def __repr__(self) -> str:
        return f"Fit of {self.problem.model.name!r}: {len(self.p)} unknowns, cost {self.cost:.6g}"

    @property
    def linear(self) -> Linear:
        """Linearisation about the path; made anew each time, since a search keeps many fits."""
        with np.errstate(all="ignore"):
            return self.problem.linearise(self.path, self.p, unknowns=self.S.shape[-1] > 0)

    @property
    def model(self):  # type: ignore[no-untyped-def]
        """The model with the estimated unknowns."""
        return self.problem.model.with_coefficients(self.problem.coefficients(self.p))

    @property
    def movable(self) -> NDArray[np.intp]:
        """Indices of the unknowns that no active bound holds."""
        slope = self.g.sum(axis=0) - self.prior.slope(self.problem.inside(self.p))
        return np.flatnonzero(~self.problem.held(self.p, slope))

    @property
    def scores(self) -> Array:
        """Scores of the blocks, whose scatter widens the standard errors, (B, P); zero if unknown.

        They are zero, too, if they scatter no more than the noise explains.
        """
        # s_b = (W/(W - 1))^(1/2) (g_b - Lambda (z - c) / W) of W blocks;  sum s_b' C s_b is chi-square
        # distributed with P (W - 1) degrees of freedom if the noise is as assumed
        W, P = self.g.shape
        if W < 8 or not P or not np.any(self.noise.process > 0):
            return np.zeros_like(self.g)
        pull = self.prior.slope(self.problem.inside(self.p))
        found = np.asarray((self.g - pull / W) * np.sqrt(W / (W - 1)))
        C = inverse(self.S.sum(axis=0) + np.diag(self.prior.precision))
        scatter = float(np.einsum("wi,ij,wj->", found, C, found))
        return found if scatter > chi2.isf(SCATTER, P * (W - 1)) else np.zeros_like(found)

    @property
    def covariance(self) -> Array:
        """Covariance of the unknowns in their own units, shape (P, P).

        The standard errors are widened if the blocks scatter more than the noise explains: the true process
        noise need not have the assumed correlation. The estimate of the scatter is the sandwich estimator
        (Liang and Zeger, Biometrika 73, 1986).
        """
        # C = (S + Lambda)^-1,  robust covariance C M C,  M = sum s_b s_b' of the scores s_b
        # C_ij <- C_ij k_i k_j,  k_i^2 = max((C M C)_ii / C_ii, 1);  in own units: times dp_i/dz_i dp_j/dz_j
        problem = self.problem
        S = self.S.sum(axis=0) + np.diag(self.prior.precision)
        C = inverse(S)
        robust = C @ (self.scores.T @ self.scores) @ C
        widen = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(C), 1e-300), 1.0))
        C = C * np.outer(widen, widen)
        slope = problem.slope(self.p)
        return C * np.outer(slope, slope)


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
    score: bool = False,
    trace: Callable[[str], None] | None = None,
) -> Fit:
    """Estimate path, unknowns and noise levels.

    Parameters
    ----------
    noise : Noise
        Initial noise levels.
    p, path : ndarray, optional
        Initial unknowns and path; default: those of the problem.
    frozen : bool, optional
        Whether the unknowns keep their values.
    levels : bool, optional
        Whether the noise levels are estimated.
    gate : bool, optional
        Whether outliers are removed or down-weighted (:mod:`.outliers`).
    most : int, optional
        Maximum number of passes that update the noise levels.
    hold : int, optional
        Number of passes before the first update of the noise levels. An initial path far from the model must
        not be mistaken for noise.
    times : bool, optional
        Whether the correlation times of the process noise are estimated, too.
    score : bool, optional
        Whether unknowns and noise levels are moved together to the optimum in the end.
    trace : callable, optional
        Called with one line of text after each pass.

    Raises
    ------
    FloatingPointError
        If the model diverges, so that no path follows the logs.
    """
    start = problem.start.copy() if p is None else problem.outside(problem.inside(p))
    run = _Iteration(problem, prior.first, noise.of(problem), frozen, times, most, hold, trace)
    if path is None and problem.unguessed and not frozen:
        # Noise would take the place of a state that only the model tells: first the equations are believed.
        quiet = replace(run.noise, process=HIDDEN * run.noise.process)
        again = replace(run, noise=quiet)
        again.first(start, problem.with_bristles(problem.guess, start))
        again.settled(False)
        start, path, run = again.now.p, again.now.path, replace(run, noise=quiet)
    run.first(start, problem.with_bristles(problem.guess, start) if path is None else path)
    if gate:
        run.gated()
    converged = run.settled(levels)
    for _ in range(ROUNDS if gate else 0):
        if not run.judged(levels):
            break
        run.most, run.hold = run.k + AGAIN, 0
        converged = run.settled(levels)
    if score:
        run.scored(prior.first, levels)
    return replace(run.fit(converged), scored=score)


def scored(near: Fit, prior: Prior) -> Fit:
    """Return the fit at the optimum of unknowns and noise levels together (:mod:`.scoring`)."""
    run = _Iteration(near.problem, near.prior, near.noise, False, True, MOVING, 0, None)
    run.first(near.p, near.path)
    run.scored(prior, True)
    return replace(run.fit(near.converged), scored=True)


@dataclass(eq=False)
class _Iteration:
    """State of the iteration: problem, noise, number of passes, previous cost, damping of the steps.

    A step may raise the cost by at most `rise`. While noise levels are updated, `rise` is infinite.

    Only the latest pass is kept: a pass over long logs takes 200 MB.
    """

    problem: Problem
    prior: Prior
    noise: Noise
    frozen: bool
    times: bool
    most: int
    hold: int
    trace: Callable[[str], None] | None
    k: int = 0
    weightings: int = 0
    before: float = np.inf
    change: float = np.inf
    least: float = np.inf
    idle: int = 0
    factor: float = COARSEST
    stalled: bool = False
    rise: float = np.inf
    relaxation: Relaxation = field(default_factory=Relaxation)
    of_levels: Damping = field(default_factory=lambda: Damping(most=ONWARD))
    now: Pass = field(init=False)
    normal: tuple[Array, Array] | None = None

    def first(self, p: Array, path: Array) -> None:
        """Make the first pass."""
        self.problem = controlled(self.problem, path, p)
        now = tried_pass(self.problem, self.noise, self.prior, p, path, self.frozen)
        if now is None:
            raise FloatingPointError("the model diverges, or its equations are not defined along the logs")
        self._come_to(now)

    def onward(self, judged: Problem | None = None) -> None:
        """Make the next pass, on the problem `judged` if samples were removed or down-weighted.

        A step is halved while it raises both the sum of squares and the cost by more than `rise`, or while
        the model diverges at its end. Steps that oscillate about a kink of dry friction are damped. If no
        tried fraction of the step is acceptable, the iteration has stalled.
        """
        if judged is not None:
            self.problem, self.before, self.least, self.rise = judged, np.inf, np.inf, np.inf
            self.of_levels = Damping(most=ONWARD)  # other samples have another level
        now, problem, self.k = self.now, self.problem, self.k + 1
        squares, cost = now.squares + self.rise, now.cost + self.rise
        if judged is None and math.isinf(self.rise) and problem.unguessed:  # under the new noise levels
            squares, cost = (
                v + max(now.predicted, CONVERGENCE.settled)
                for v in costs_of(problem, self.noise, self.prior, now)
            )
        (step, along), here, there = now.steps(problem), problem.inside(now.p), now.path
        std = deviations(problem, now.smooth.variance)
        known = np.diag(now.S.sum(axis=0)) + self.prior.precision if step.any() else np.zeros_like(step)
        moves = (along[..., list(problem.free)] / std).ravel()
        # Step in standard deviations: dz_j sqrt((S + Lambda)_jj) of the unknowns, dx / sigma_x of the path
        part = self.relaxation.of(np.r_[step * np.sqrt(known), moves])
        del self.now, now  # free its memory before the next pass

        def behind(part: float) -> Pass | None:
            p, path = problem.outside(here + part * step), there + part * along
            with np.errstate(all="ignore"):  # a step may lead to where the model diverges
                self.problem = controlled(problem, path, p, std)
            return tried_pass(self.problem, self.noise, self.prior, p, path, self.frozen)

        def rises(there: Pass | None) -> bool:
            return there is None or (there.squares > squares and there.cost > cost)

        while rises(found := behind(part)) and part > (SHORTEST if found else TINIEST):
            part *= 0.5
        self.stalled = rises(found)
        found = behind(0.0) if self.stalled else found
        if found is None:
            raise FloatingPointError("the model runs away")
        self._come_to(found)

    def gated(self) -> None:
        """Remove outliers until none is left or the limit is reached: large outliers hide small ones."""
        for _ in range(GATES):
            stands_out = outliers(residuals(self.problem, self.now), self.problem.seen)
            if not stands_out.any():
                break
            self.onward(self.problem.without(stands_out))

    def judged(self, levels: bool) -> bool:
        """Remove or down-weight outliers until none is left; return whether there were any."""
        changed = False
        while (problem := self._less()) is not None:
            self.onward(problem)
            if levels:
                self.rise = np.inf
                self.noise = moved(
                    self.problem, self.noise, self.now.system, self.now.smooth, self.now.step, self.of_levels
                )
                self.onward()
            changed = True
        if changed and self.problem.data.down_weighted.any():  # with the updated noise levels
            variance = leave_one_out(self.problem, self.now)[1]
            self.onward(self.problem.weighted(np.where(self.problem.data.down_weighted, variance, 1.0)))
        return changed

    def _less(self) -> Problem | None:
        """Return the problem with more samples removed or down-weighted; None if there is no outlier."""
        problem = self.problem
        left, variance = leave_one_out(problem, self.now)
        out = outliers(left, problem.seen)
        before = problem.data.down_weighted
        doubtful = outliers(np.where(before, 0.0, left), problem.seen, OUTLIERS.doubtful)
        if self.weightings < WEIGHTINGS and (doubtful & ~out).any():
            self.weightings += 1
            return problem.without(out).weighted(np.where(doubtful | before, variance, 1.0))
        return problem.without(out) if out.any() else None

    def settled(self, levels: bool) -> bool:
        """Iterate to the end, first with noise levels updated, then fixed; return whether it converged."""
        if levels:
            self._moving()
        return self._still(1 if levels else 0)

    def scored(self, prior: Prior, levels: bool) -> None:
        """Move unknowns and noise levels together to the optimum (:mod:`.scoring`), under the given prior.

        Where the likelihood claims more information than a linear model can have (:data:`.scoring.EXCESS`),
        the model is not linear within the uncertainty of its states (dry friction at rest). Then the passes
        have the last word.
        """
        before = self.problem, self.noise, self.now, self.prior
        self._believe(prior)
        for k in range(SCORED + 1 if len(self.now.p) and not self.frozen else 0):
            problem, noise, now = self.problem, self.noise, self.now
            free = Levels.of(problem, noise, self.times) if levels else NO_LEVELS
            known = now.S.sum(axis=0)
            try:
                S, g = scores(problem, noise, now.p, now.path, free, np.diag(known))
            except np.linalg.LinAlgError:
                S = g = np.full((1, 1, 1), np.inf)
            normal = of_unknowns(S, g, len(now.p)) if np.isfinite(S).all() else None
            if normal is None or excess(normal[0].sum(axis=0), known, prior.precision) > EXCESS:
                self.problem, self.noise, self.now, self.prior = before
                self.normal = None
                return
            self.normal = normal
            step, predicted = newton(problem, self.prior, now.p, S, g)
            if self.trace:
                self.trace(f"  scoring {k}: {now.cost:.2f} predicted {predicted:.3f}")
            if predicted < CONVERGENCE.reached or k == SCORED or not self._steps_on(free, step):
                return

    def _believe(self, prior: Prior) -> None:
        """Continue under another prior."""
        z = self.problem.inside(self.now.p)
        more = prior.cost(z) - self.prior.cost(z)
        self.now = replace(self.now, cost=self.now.cost + more, squares=self.now.squares + more)
        self.prior = prior

    def _steps_on(self, free: Levels, step: Array) -> bool:
        """Take the largest fraction of a scoring step that lowers the cost; return whether there is one."""
        now, noise, problem, part = self.now, self.noise, self.problem, 1.0
        count = len(now.p)
        smooth = run_smoother(now.system, run_filter(now.system), np.concatenate([[1.0], step[:count]]))
        along = np.zeros_like(now.path)
        along[..., list(problem.free)] = smooth.state[..., : len(problem.free)]
        std = deviations(problem, smooth.variance)
        while part > LEAST_SCORED:
            p = problem.outside(problem.inside(now.p) + part * step[:count])
            path = now.path + part * along
            other = free.moved(problem, noise, part * step[count:])
            with np.errstate(all="ignore"):  # a step may lead to where the model diverges
                finer = controlled(problem, path, p, std)
            found = tried_pass(finer, other, self.prior, p, path, self.frozen)
            if found and found.cost < now.cost:
                self.problem, self.noise, self.k = finer, other, self.k + 1
                self._come_to(found)
                return True
            part *= 0.5
        return False

    def fit(self, converged: bool) -> Fit:
        """Return the result."""
        S, g = self.normal or (self.now.S, self.now.g)
        problem, now, smooth = self.problem, self.now, self.now.smooth
        n, rows = len(problem.free), problem.rows
        end = n + len(problem.driven)
        drift = (now.system.H[..., end:] @ smooth.state[..., end:, None])[..., 0]
        return Fit(
            problem, now.p, now.path, self.noise, self.prior, now.cost,
            rows.by_block(now.block_costs), rows.by_block(S), rows.by_block(g),
            smooth.state[..., n:end], drift, smooth.variance, residuals(problem, now), converged,
        )  # fmt: skip

    def _moving(self) -> None:
        """Iterate to the first pass in which noise levels and correlation times stay the same."""
        self.rise = np.inf  # a step that descends under one noise level may ascend under the next
        while True:
            there = self._little_changes(CONVERGENCE.settled) or self.idle >= CONVERGENCE.idle
            while there and self.times and self.factor > FINEST:  # all factors are tried first
                there = not self._timed()
            if (there and self.k > self.hold) or self.k >= self.most + self.hold:
                return self.onward()
            if self.k >= self.hold:
                self.noise = moved(
                    self.problem, self.noise, self.now.system, self.now.smooth, self.now.step, self.of_levels
                )
                if self.times and (self.k - self.hold) % 3 == 1 and self.factor > FINEST:
                    self._timed()
            self.onward()

    def _still(self, count: int) -> bool:
        """Iterate under fixed noise levels until the cost settles; return whether it converged."""
        self.least, self.idle, self.rise = self.now.cost, 0, CONVERGENCE.settled
        while True:
            enough = CONVERGENCE.stopped if count < CONVERGENCE.enough else 2.0 * CONVERGENCE.settled
            there = self._little_changes(enough, CONVERGENCE.reached)
            if there or count >= STILL or self.idle >= CONVERGENCE.idle or self.stalled:
                return there
            # A summable tolerance ensures convergence (Li and Fukushima, Optim. Methods Softw. 13, 2000).
            self.rise *= 0.5
            self.onward()
            count += 1

    def _little_changes(self, enough: float, left: float = CONVERGENCE.settled) -> bool:
        return bool(abs(self.change) < enough and self.now.predicted < left)

    def _timed(self) -> bool:
        """Try other correlation times; return whether any changed. If none did, reduce the factor."""
        self.noise, further = timed(self.problem, self.now.linear, self.noise, self.factor)
        for _ in range(FURTHER if further else 0):
            self.noise, again = timed(self.problem, self.now.linear, self.noise, self.factor)
            if not again:
                break
        self.factor = self.factor if further else self.factor**0.5
        self.idle = 0 if further else self.idle
        return bool(further)

    def _come_to(self, now: Pass) -> None:
        self.now = now
        self.change, self.before = self.before - now.cost, now.cost
        falls = now.cost < self.least - CONVERGENCE.settled
        self.least, self.idle = (now.cost, 0) if falls else (self.least, self.idle + 1)
        if self.trace:
            levels = f"{self.noise.process} {self.noise.seconds}"
            self.trace(f"  pass {self.k}: {now.cost:.2f} predicted {now.predicted:.2f} {levels}")


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
    """Fit another problem on the same rows, starting from a previous fit.

    Parameters
    ----------
    near : Fit
        The previous fit.
    problem : Problem
        Unknowns of the same name start from their values in `near`, others from their values in the model.
    noise : Noise, optional
        Initial noise levels; default: those of `near`.
    p : ndarray, optional
        Initial unknowns.
    frozen, levels, times, trace
        As for :func:`estimate`.
    """
    ended = dict(zip(near.problem.names, near.p.tolist(), strict=True))
    if p is None:
        p = problem.start.copy()
        if not frozen:
            p = np.array([ended.get(name, v) for name, v in zip(problem.names, p.tolist(), strict=True)])
    path = problem.path_of(near.problem.block, near.path, p)
    return estimate(
        problem, prior, noise or near.noise, p=p, path=path, frozen=frozen, levels=levels, times=times,
        hold=HOLD, score=near.scored, trace=trace,
    )  # fmt: skip


def first_noise(problem: Problem) -> Noise:
    """Return initial noise levels: the noise estimated from the logs, and all acceleration missing."""
    data, none = problem.data, np.empty(0)
    return Noise(data.noise, data.scales, none, none, ()).of(problem)
