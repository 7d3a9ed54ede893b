"""Maximum likelihood under process noise: path, unknowns and noise of one model on logs.

Each pass linearises the model from row to row about the path, runs one Kalman filter with a column for every
unknown, solves for the unknowns, and smooths: a step of Gauss and Newton on path and unknowns together (Bell,
SIAM J. Optim. 4 (1994): the iterated Kalman smoother), with a prior. The same smoother says how the levels of
noise should move (Koopman and Shephard, Biometrika 79 (1992)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.damping import Damping, Relaxation
from hovercontrol.estimation.noise import ONWARD, Noise, moved, timed
from hovercontrol.estimation.outliers import OUTLIERS, outliers
from hovercontrol.estimation.passes import Pass, alone, held, inverse, residuals, tried_pass
from hovercontrol.estimation.prior import Prior
from hovercontrol.estimation.problem import Linear, Problem
from hovercontrol.estimation.step_control import controlled, deviations

Array = NDArray[np.float64]

#: Passes at most in which the levels of noise move, and afterwards.
MOVING, STILL = 14, 8

#: Passes at most in which samples are left out before levels of noise move: large outliers hide small ones.
GATES = 8

#: Times at most that samples are left out of a fit that has settled, and passes in which levels then move.
ROUNDS, AGAIN = 12, 4

#: Times at most that samples are down-weighted: the first make channels less noisy, so that more stand out.
WEIGHTINGS = 4


@dataclass(frozen=True)
class Convergence:
    """When a fit has converged.

    Costs are minus twice the log likelihood. No published source: set by hand, exercised by
    tests/estimation/test_fit.py; an effect must gain 20 to be named (:class:`.Criteria`).

    Attributes
    ----------
    settled : float
        Largest change of the cost in a pass while noise levels move, and largest rise of the sum of squares
        by a step that is taken: a number that moves by a standard error changes it by one.
    stopped : float
        Largest change of the cost in a pass under fixed noise levels.
    reached : float
        Largest fall of the cost that a step of the unknowns predicts at the end: the square of their distance
        from the optimum in standard errors, a tenth of one.
    enough : int
        Passes after which a path that alternates between stick and slip counts as converged.
    idle : int
        Passes without a cost lower than before, by `settled`, after which a fit gains no more: steep dry
        friction throws a path to and fro.
    """

    settled: float = 1.0
    stopped: float = 0.05
    reached: float = 0.01
    enough: int = 3
    idle: int = 4


#: The values in use.
CONVERGENCE = Convergence()


#: Factors by which correlation times are tried, the largest and the smallest.
COARSEST, FINEST = 2.0, 1.2

#: Times at most that one such step is followed by another of the same factor.
FURTHER = 3

#: Shortest part of a step that is tried, and where the model runs away behind it.
SHORTEST, TINIEST = 0.05, 1e-6

#: Passes of a refit before levels of noise move.
HOLD = 2


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
    covariance_of_path : ndarray, shape (K, W, N, N)
        Of free states, missing accelerations and what follows these (:func:`.augment`), the unknowns as they
        are.
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

    def __repr__(self) -> str:
        return f"Fit of {self.problem.model.name!r}: {len(self.p)} unknowns, cost {self.cost:.6g}"

    @property
    def model(self):  # type: ignore[no-untyped-def]
        """The model with the unknowns as fitted."""
        return self.problem.model.with_coefficients(self.problem.coefficients(self.p))

    @property
    def movable(self) -> NDArray[np.intp]:
        """Unknowns that no bound holds."""
        slope = self.g.sum(axis=0) - self.prior.slope(self.problem.inside(self.p))
        return np.flatnonzero(~held(self.problem, self.p, slope))

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
        Whether samples that stand out are left out or down-weighted (:mod:`.outliers`).
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
    start = problem.start.copy() if p is None else problem.outside(problem.inside(p))
    run = _Iteration(problem, prior, noise.of(problem), frozen, times, most, hold, trace)
    run.first(start, problem.with_bristles(problem.guess, start) if path is None else path)
    if gate:
        run.gated()
    converged = run.settled(levels)
    for _ in range(ROUNDS if gate else 0):
        if not run.judged(levels):
            break
        run.most, run.hold = run.k + AGAIN, 0
        converged = run.settled(levels)
    return run.fit(converged)


@dataclass(eq=False)
class _Iteration:
    """Where an iteration is: what is fitted, noise, passes done, the cost before, damping of each step.

    A step may raise the cost by `rise` at most; under noise that moves, by anything.

    Only the pass it has come to is kept: those of long logs take 200 MB each.
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

    def first(self, p: Array, path: Array) -> None:
        """Make the first pass."""
        self.problem = controlled(self.problem, path, p)
        now = tried_pass(self.problem, self.noise, self.prior, p, path, self.frozen)
        if now is None:
            raise FloatingPointError("the model runs away from the first row on")
        self._come_to(now)

    def onward(self, judged: Problem | None = None) -> None:
        """Make the next pass, with samples left out or down-weighted if they were judged again.

        A step that raises both the sum of squares and the cost is halved, and so is one behind which the
        model runs away; what goes to and fro about a kink of dry friction is damped. Where no part of a step
        will do, the iteration has stalled.
        """
        if judged is not None:
            self.problem, self.before, self.least, self.rise = judged, np.inf, np.inf, np.inf
        now, problem, self.k = self.now, self.problem, self.k + 1
        squares, cost = now.squares + self.rise, now.cost + self.rise
        (step, along), here, there = now.steps(problem), problem.inside(now.p), now.path
        std = deviations(problem, now.smooth.covariance)
        known = np.diag(now.S.sum(axis=0)) + self.prior.precision if step.any() else np.zeros_like(step)
        moves = (along[..., list(problem.free)] / std).ravel()
        part = self.relaxation.of(np.r_[step * np.sqrt(known), moves])  # in standard deviations
        del self.now, now  # before the next takes as much memory

        def behind(part: float) -> Pass | None:
            p, path = problem.outside(here + part * step), there + part * along
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
        """Go on until nothing stands out: large outliers hide small ones."""
        for _ in range(GATES):
            stands_out = outliers(residuals(self.problem, self.now), self.problem.seen)
            if not stands_out.any():
                break
            self.onward(self.problem.without(stands_out))

    def judged(self, levels: bool) -> bool:
        """Leave out or down-weight what stands out until nothing does; tell whether anything did."""
        changed = False
        while (problem := self._less()) is not None:
            self.onward(problem)
            if levels:
                self.rise = np.inf
                self.noise = moved(self.problem, self.noise, self.now.system, self.now.smooth, self.of_levels)
                self.onward()
            changed = True
        if changed and self.problem.data.down_weighted.any():  # under the noise as it came out
            variance = alone(self.problem, self.now)[1]
            self.onward(self.problem.weighted(np.where(self.problem.data.down_weighted, variance, 1.0)))
        return changed

    def _less(self) -> Problem | None:
        """Return the problem with further samples left out or down-weighted; None where none stands out."""
        problem = self.problem
        left, variance = alone(problem, self.now)
        out = outliers(left, problem.seen)
        before = problem.data.down_weighted
        doubtful = outliers(np.where(before, 0.0, left), problem.seen, OUTLIERS.doubtful)
        if self.weightings < WEIGHTINGS and (doubtful & ~out).any():
            self.weightings += 1
            return problem.without(out).weighted(np.where(doubtful | before, variance, 1.0))
        return problem.without(out) if out.any() else None

    def settled(self, levels: bool) -> bool:
        """Go on to the end, and tell whether that converged: levels of noise move first, then they stay."""
        if levels:
            self._moving()
        return self._still(1 if levels else 0)

    def fit(self, converged: bool) -> Fit:
        """Return what was fitted."""
        problem, now, smooth = self.problem, self.now, self.now.smooth
        n, rows = len(problem.free), problem.rows
        end = n + len(problem.driven)
        drift = (now.system.H[..., end:] @ smooth.state[..., end:, None])[..., 0]
        return Fit(
            problem, now.p, now.path, self.noise, self.prior, now.linear, now.cost,
            rows.by_block(now.block_costs), rows.by_block(now.S), rows.by_block(now.g),
            smooth.state[..., n:end], drift, smooth.covariance, residuals(problem, now), converged,
        )  # fmt: skip

    def _moving(self) -> None:
        """Go on to the first pass whose levels and correlation times of noise stay."""
        self.rise = np.inf  # what descends under one noise need not under the next
        while True:
            there = self._little_changes(CONVERGENCE.settled) or self.idle >= CONVERGENCE.idle
            while there and self.times and self.factor > FINEST:  # not before all factors were tried
                there = not self._timed()
            if (there and self.k > self.hold) or self.k >= self.most + self.hold:
                return self.onward()
            if self.k >= self.hold:
                self.noise = moved(self.problem, self.noise, self.now.system, self.now.smooth, self.of_levels)
                if self.times and (self.k - self.hold) % 3 == 1 and self.factor > FINEST:
                    self._timed()
            self.onward()

    def _still(self, count: int) -> bool:
        """Go on until little changes under the noise as it is, and tell whether that converged."""
        self.least, self.idle, self.rise = self.now.cost, 0, CONVERGENCE.settled
        while True:
            enough = CONVERGENCE.stopped if count < CONVERGENCE.enough else 2.0 * CONVERGENCE.settled
            there = self._little_changes(enough, CONVERGENCE.reached)
            if there or count >= STILL or self.idle >= CONVERGENCE.idle or self.stalled:
                return there
            self.rise *= 0.5  # summable: it comes to rest (Li and Fukushima, Optim. Methods Softw. 13, 2000)
            self.onward()
            count += 1

    def _little_changes(self, enough: float, left: float = CONVERGENCE.settled) -> bool:
        return bool(abs(self.change) < enough and self.now.predicted < left)

    def _timed(self) -> bool:
        """Try correlation times by a factor; tell whether they moved. The next factor is smaller if not."""
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
    path = problem.path_of(near.problem.block, near.path, p)
    return estimate(
        problem, prior, noise or near.noise, p=p, path=path, frozen=frozen, levels=levels, times=times,
        hold=HOLD, trace=trace,
    )  # fmt: skip


def first_noise(problem: Problem) -> Noise:
    """Return levels of noise to begin with: of the measurements as seen, and all acceleration missing."""
    data, none = problem.data, np.empty(0)
    return Noise(data.noise, data.scales, none, none, ()).of(problem)
