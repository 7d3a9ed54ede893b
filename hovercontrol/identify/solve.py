"""The solver of the multiple-shooting problem: Levenberg-Marquardt with bounds, noise levels re-estimated.

Each round minimises the weighted squares with the channels' noise levels fixed, then sets every level to the
scatter of its residuals: together the maximum of the likelihood with unknown noise of each channel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hovercontrol.errors import InputError
from hovercontrol.identify.problem import Point, Problem, Reduced

Array = NDArray[np.float64]

#: Rounds of noise levels, iterations in each, and in all.
ROUNDS, ITERATIONS = 12, 25

#: How stiffly directions without excitation are held, in (1/size)^2.
STIFFNESS = 1e6


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the solver ended.

    Attributes
    ----------
    point : Point
    reduced : Reduced
        Normal equations there, without damping, weighted by the residuals' scatter.
    residual : ndarray, shape (C,)
        Standard deviation of each channel's residuals.
    chi2_per_dof : float
        Against the measurement noise.
    converged : bool
    """

    point: Point
    reduced: Reduced
    residual: Array
    chi2_per_dof: float
    converged: bool


class Solver:
    """Minimises a :class:`Problem`.

    Parameters
    ----------
    problem : Problem
    noise : ndarray, shape (C,)
        Measurement noise of each channel: the reference of chi2, and the floor (one hundredth) of the
        residuals' scatter.
    huber : float or None
        Threshold of Huber's loss in standard deviations.
    tell : callable
        Progress.
    """

    def __init__(
        self, problem: Problem, noise: Array, huber: float | None, tell: Callable[[float, str], None]
    ) -> None:
        self.problem, self.noise, self.huber, self._tell = problem, noise, huber, tell
        seen = [np.isfinite(g.values).transpose(1, 2, 0) for g in problem.groups]
        self._seen = seen
        self._counts = np.sum([s.sum(axis=(0, 1)) for s in seen], axis=0)
        self.iterations = 0

    def run(self, p: Array, x0: list[Array], hold: Array | None = None) -> Solution:
        """Minimise from a start.

        Parameters
        ----------
        p : ndarray, shape (P,)
        x0 : list of ndarray
            Initial states by group.
        hold : ndarray, shape (P, m), optional
            Directions, per unit of the coefficients, along which the start values are kept.

        Raises
        ------
        InputError
            If the simulation runs away at the start.
        """
        Q = STIFFNESS * hold @ hold.T if hold is not None else np.zeros((p.size, p.size))
        p = np.clip(p, self.problem.lower, self.problem.upper)
        point = self.problem.linearise(p, x0)
        if not point.finite:
            raise InputError(
                f"block {self.problem.block.name!r}: the simulation runs away within a window at the start "
                "values: shorter windows or other start values may help"
            )
        sigma = self._scatter(point, self._counts.sum())
        for _ in range(ROUNDS):
            point, converged = self._minimise(point, sigma, Q)
            states = self.problem.reduce(point, self._weights(point, sigma)).states
            dof = max(int(self._counts.sum()) - states - p.size, 1)
            new = self._scatter(point, dof)
            steady = bool(np.all(np.abs(np.log(new / sigma)) < 0.01))
            sigma = new
            if steady and converged:
                break
        reduced = self.problem.reduce(point, self._weights(point, sigma))
        chi2 = sum(float(((r / self.noise) ** 2).sum()) for r in point.residual)
        return Solution(point, reduced, sigma, chi2 / dof, steady and converged)

    def _minimise(self, point: Point, sigma: Array, Q: Array) -> tuple[Point, bool]:
        """Return the minimum for fixed noise levels, and whether it was reached."""
        start, problem = self.problem.start, self.problem
        cost = self._cost(point, sigma, Q)
        damping = 0.0
        for _ in range(ITERATIONS):
            self.iterations += 1
            self._tell(1 - 1 / (1 + self.iterations / 8), "fitting")
            reduced = problem.reduce(point, self._weights(point, sigma), damping)
            S, g = reduced.S + Q, reduced.g - Q @ (point.p - start)
            dp = bounded_step(S, g, problem.lower - point.p, problem.upper - point.p,
                              problem.nominal, damping)
            trial = problem.linearise(
                np.clip(point.p + dp, problem.lower, problem.upper),
                problem.move(point.x0, reduced.back, dp),
            )
            new = self._cost(trial, sigma, Q) if trial.finite else np.inf
            small = dp @ S @ dp < 1e-4 and abs(cost - new) < 0.01 + 1e-9 * cost
            if new <= cost:
                point, cost = trial, new
                damping = damping / 10 if damping > 1e-6 else 0.0
            else:
                damping = max(10 * damping, 1e-4)
            if small or damping > 1e8:
                return point, True
        return point, False

    def _cost(self, point: Point, sigma: Array, Q: Array) -> float:
        away = point.p - self.problem.start
        total = float(away @ Q @ away)
        for r in point.residual:
            z = np.abs(r / sigma)
            if self.huber is None:
                total += float((z**2).sum())
            else:
                k = self.huber
                total += float(np.where(z <= k, z**2, 2 * k * z - k**2).sum())
        return total

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
        """Return the standard deviation of each channel's residuals; with Huber's loss by the median."""
        share = np.maximum(self._counts * (dof / self._counts.sum()), 1.0)
        if self.huber is None:
            squares = np.sum([(r**2).sum(axis=(0, 1)) for r in point.residual], axis=0)
            level = np.sqrt(squares / share)
        else:
            level = np.array([
                np.median(np.concatenate([np.abs(r[..., c][s[..., c]]) for r, s in
                                          zip(point.residual, self._seen, strict=True)]))
                for c in range(len(self.noise))
            ]) / 0.6745 * np.sqrt(self._counts / share)
        return np.maximum(level, 0.01 * self.noise)


def bounded_step(
    S: Array, g: Array, lower: Array, upper: Array, size: Array, damping: float = 0.0
) -> Array:
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
    L = np.linalg.cholesky(scaled)
    y = np.linalg.solve(L, g * size)
    d = np.linalg.solve(L.T, y)
    low, high = lower / size, upper / size
    if (d < low).any() or (d > high).any():
        d = lsq_linear(L.T, y, (low - 1e-15, high + 1e-15), method="bvls").x
    return np.clip(d, low, high) * size
