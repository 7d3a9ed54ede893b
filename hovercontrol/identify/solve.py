"""The solver of multiple shooting: Levenberg-Marquardt with bounds, noise levels re-estimated.

Each round minimises the weighted squares with the channels' noise levels fixed, then sets every
level to the scatter of its residuals: together the maximum of the likelihood with unknown noise of
each channel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hovercontrol.errors import InputError
from hovercontrol.identify.problem import Point, Problem
from hovercontrol.identify.shooting import stable_step

Array = NDArray[np.float64]

#: Rounds of noise levels, iterations in each, and in all. Fits that come to an end take some ten;
#: logs that tell next to nothing would wander on for hundreds.
ROUNDS, ITERATIONS, MOST_ITERATIONS = 8, 20, 30

#: A fall of the cost (twice the log of the likelihood) that means nothing: standard errors are a
#: fall of 1.
SMALL = 0.02


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the solver ended.

    Attributes
    ----------
    point : Point
    information : ndarray, shape (P, P)
        About the coefficients, weighted by the residuals' scatter; states that are at rest but for
        noise are taken to be at rest.
    scores : ndarray, shape (W, P)
        What each window adds to the gradient.
    residual : ndarray, shape (C,)
        Standard deviation of each channel's residuals.
    chi2_per_dof : float
        Against the measurement noise.
    converged : bool
    """

    point: Point
    information: Array
    scores: Array
    residual: Array
    chi2_per_dof: float
    converged: bool


class Solver:
    """Minimises a :class:`Problem`.

    Parameters
    ----------
    problem : Problem
    noise : ndarray, shape (C,)
        Measurement noise of each channel: the reference of chi2, and the floor (one hundredth) of
        the residuals' scatter.
    huber : float or None
        Threshold of Huber's loss in standard deviations.
    step : float
        Longest sub-step of the simulation [s].
    tell : callable
        Progress.
    iterations : int
        Iterations done before, for the progress.
    """

    def __init__(
        self,
        problem: Problem,
        noise: Array,
        huber: float | None,
        step: float,
        tell: Callable[[float, str], None],
        iterations: int = 0,
    ) -> None:
        self.problem, self.noise, self.huber, self._tell = problem, noise, huber, tell
        self.step, self.iterations = step, iterations
        self._last = iterations + MOST_ITERATIONS
        seen = [np.isfinite(g.values).transpose(1, 2, 0) for g in problem.groups]
        self._seen = seen
        self._counts = np.sum([s.sum(axis=(0, 1)) for s in seen], axis=0)

    def solve(self, p: Array, x0: list[Array], pull: Array) -> Solution:
        """Minimise from a start; again with finer sub-steps where the friction found is stiffer.

        Parameters
        ----------
        p : ndarray, shape (P,)
        x0 : list of ndarray
            Initial states by group.
        pull : ndarray, shape (P, P)
            Precision with which the coefficients are pulled to the Block's own values.

        Raises
        ------
        InputError
            If the simulation runs away at the start.
        """
        used = self._needed_step(p)
        while True:
            self.problem.set_step(used)
            solution = self._rounds(p, x0, pull)
            p, x0 = solution.point.p, solution.point.x0
            needed = self._needed_step(p)
            if needed > 0.7 * used or self.iterations >= self._last:
                return solution
            used = needed

    def _needed_step(self, p: Array) -> float:
        every, block = self.problem.parameters(p), self.problem.block
        return min(stable_step(block, g, every, self.step) for g in self.problem.groups)

    def _rounds(self, p: Array, x0: list[Array], Q: Array) -> Solution:
        """Minimise and set the noise levels, in turn."""
        problem = self.problem
        p = np.clip(p, problem.lower, problem.upper)
        point = problem.linearise(p, x0)
        if not point.finite:
            raise InputError(
                f"block {problem.block.name!r}: the simulation runs away within a window at the "
                "start values: shorter windows or other start values may help"
            )
        sigma = self._scatter(point, self._counts.sum())
        for _ in range(ROUNDS):
            point, converged = self._minimise(point, sigma, Q)
            stds = problem.reduce(point, self._weights(point, sigma)).state_std
            dof = max(int(self._counts.sum() - sum(np.isfinite(s).sum() for s in stds)) - p.size, 1)
            new = self._scatter(point, dof)
            steady = bool(np.all(np.abs(np.log(new / sigma)) < 0.01))
            sigma = new
            if (steady and converged) or self.iterations >= self._last:
                break
        reduced = problem.reduce(point, self._weights(point, sigma))
        rested = problem.linearise(point.p, problem.at_rest(point.x0, reduced.state_std))
        information = problem.reduce(rested, self._weights(point, sigma)).S
        chi2 = sum(float(((r / self.noise) ** 2).sum()) for r in point.residual)
        return Solution(point, information, reduced.scores, sigma, chi2 / dof, steady and converged)

    def _minimise(self, point: Point, sigma: Array, Q: Array) -> tuple[Point, bool]:
        """Return the minimum for fixed noise levels, and whether it was reached."""
        start, problem = self.problem.start, self.problem
        costs, damping = self._costs(point, sigma), 0.0
        window_damping = [np.zeros(len(c)) for c in costs]
        total = _sum(costs) + (point.p - start) @ Q @ (point.p - start)
        history = [total]
        for _ in range(min(ITERATIONS, self._last - self.iterations)):
            self.iterations += 1
            self._tell(1 - 1 / (1 + self.iterations / 8), "fitting")
            reduced = problem.reduce(point, self._weights(point, sigma), window_damping)
            S, g = reduced.S + Q, reduced.g - Q @ (point.p - start)
            dp = bounded_step(
                S, g, problem.lower - point.p, problem.upper - point.p, problem.nominal, damping
            )
            trial = problem.linearise(
                np.clip(point.p + dp, problem.lower, problem.upper),
                problem.move(point.x0, reduced.back, dp),
            )
            new = self._costs(trial, sigma)
            new_total = _sum(new) + (trial.p - start) @ Q @ (trial.p - start)
            better = bool(new_total <= total)
            window_damping = [
                np.where(b <= a, np.where(d > 1e-6, d / 4, 0.0), np.maximum(10 * d, 1e-3))
                for a, b, d in zip(costs, new, window_damping, strict=True)
            ]
            small = dp @ S @ dp < 1e-4 and abs(total - new_total) < SMALL
            if better:
                point, costs, total = trial, new, float(new_total)
                damping = damping / 10 if damping > 1e-6 else 0.0
            else:
                damping = max(10 * damping, 1e-4)
            history.append(total)
            if small or (better and len(history) > 5 and history[-6] - total < SMALL):
                return point, True
        return point, False

    def _costs(self, point: Point, sigma: Array) -> list[Array]:
        """Return the cost of each window, by group; infinite where the simulation ran away."""
        costs = []
        with np.errstate(invalid="ignore", over="ignore"):
            for r in point.residual:
                z = np.abs(r / sigma)
                cost, k = z**2, self.huber
                if k is not None:
                    cost = np.where(z <= k, cost, 2 * k * z - k**2)
                costs.append(np.nan_to_num(cost.sum(axis=(1, 2)), nan=np.inf, posinf=np.inf))
        return costs

    def _weights(self, point: Point, sigma: Array) -> list[Array]:
        weights = []
        for r in point.residual:
            weight = np.broadcast_to(1 / sigma, r.shape)
            if self.huber is not None:
                z = np.abs(r / sigma)
                weight = weight * np.sqrt(np.minimum(1.0, self.huber / np.maximum(z, 1e-12)))
            weights.append(weight)
        return weights

    def _scatter(self, point: Point, dof: float) -> Array:
        """Return each channel's standard deviation of residuals; by the median with Huber's loss."""
        share = np.maximum(self._counts * (dof / self._counts.sum()), 1.0)
        if self.huber is None:
            squares = np.sum([(r**2).sum(axis=(0, 1)) for r in point.residual], axis=0)
            level = np.sqrt(squares / share)
        else:
            level = (
                np.array(
                    [
                        np.median(
                            np.concatenate(
                                [
                                    np.abs(r[..., c][s[..., c]])
                                    for r, s in zip(point.residual, self._seen, strict=True)
                                ]
                            )
                        )
                        for c in range(len(self.noise))
                    ]
                )
                / 0.6745
                * np.sqrt(self._counts / share)
            )
        return np.maximum(level, 0.01 * self.noise)


def _sum(costs: list[Array]) -> float:
    return float(sum(c.sum() for c in costs))


def bounded_step(S: Array, g: Array, lower: Array, upper: Array, size: Array, damping: float = 0.0) -> Array:
    """Return the d within bounds that minimises ``d'S d/2 - g'd``, shape (P,).

    Parameters
    ----------
    S, g : ndarray, shapes (P, P), (P,)
    lower, upper : ndarray, shape (P,)
        ``lower <= 0 <= upper``.
    size : ndarray, shape (P,)
        Typical sizes; in directions that S does not know, d stays near zero in these.
    damping : float
        Relative to the diagonal of S.
    """
    scaled = S * np.outer(size, size)
    diagonal = np.diag(scaled)
    scaled = scaled + np.diag(damping * diagonal + 1e-12 * diagonal.max() + 1e-12)
    L = _root(scaled)
    y = np.linalg.solve(L, g * size)
    d = np.linalg.solve(L.T, y)
    low, high = lower / size, upper / size
    if (d < low).any() or (d > high).any():
        d = lsq_linear(L.T, y, (low - 1e-15, high + 1e-15), method="bvls").x
    return np.clip(d, low, high) * size


def _root(S: Array) -> Array:
    """Return the Cholesky factor of S, raised on its diagonal as far as rounding made it indefinite."""
    raised = 1e-10 * float(np.diag(S).max())
    while True:
        try:
            found: Array = np.asarray(np.linalg.cholesky(S), dtype=float)
            return found
        except np.linalg.LinAlgError:
            if not np.isfinite(S).all():
                raise
            S, raised = S + raised * np.eye(len(S)), 10.0 * raised
