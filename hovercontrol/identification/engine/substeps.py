"""States and sensitivities within the steps from row to row, in the sub-steps of :mod:`.step_control`.

Sub-steps must be short. Dry friction of strength c and width w has slopes up to c/w. Runge-Kutta with
sub-steps h is unstable for h c/w > 2.8 (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.2):
each sub-step multiplies differences, including rounding errors, by up to (h c/w)^4/24. The same log would
then give different coefficients on another processor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.shoot import shoot, shoot_with_slopes
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.steps import Group, InTime


@dataclass(frozen=True, eq=False)
class Within:
    """States and responses in the sub-steps from row to row.

    Attributes
    ----------
    steps : InTime
        M sub-steps of each of W stretches.
    states : ndarray, shape (n_states, M, W)
        States at the middle of each sub-step, simulated from the row before.
    response : tuple of ndarray, shape (n, n, S, N)
        One array for each group of steps. Element [j, i] is the change of free state i at the next row caused
        by a unit rate of free state j during a sub-step. It decays quickly if dry friction holds the body.
    """

    steps: InTime
    states: Array
    response: tuple[Array, ...]

    def become(self, push: Array) -> Array:
        """Return the effect of added rates, shape (n, M, W), at the next rows, shape (K-1, W, n)."""
        pushed = [j for j, one in enumerate(push) if one.any()]
        rows = len(self.steps.begin) - 1, push.shape[-1]
        return sum((self.carried(j, push[j : j + 1])[0] for j in pushed), np.zeros((*rows, len(push))))

    def carried(self, j: int, rates: Array) -> Array:
        """Return the effect of each of F rates of state j, (F, M, W), at the next rows, (F, K-1, W, n)."""
        rows, n = (len(self.steps.begin) - 1, rates.shape[-1]), len(self.response[0])
        found = np.zeros((len(rates), rows[0] * rows[1], n))
        for group, response in zip(self.steps.groups, self.response, strict=True):
            found[:, group.at] = np.einsum("isN,fsN->fNi", response[j], rates[:, group.place, group.stretch])
        return found.reshape(len(rates), *rows, n)


def within(fit: Fit) -> Within:
    """Return the states and responses within the steps of a fit."""
    problem = fit.problem
    parameters = problem.parameters(fit.p)
    steps = problem.steps.in_time(parameters)
    states = steps.between(fit.path)
    responses = []
    for group in steps.groups:
        middle, response = _group_within(fit, group, parameters)
        states[:, group.place, group.stretch] = middle
        responses.append(response)
    return Within(steps, states, tuple(responses))


def _group_within(fit: Fit, group: Group, parameters: list[float]) -> tuple[Array, Array]:
    """Return the states at the middles of S sub-steps of N steps, (n_states, S, N), and the responses."""
    problem, steps = fit.problem, group.steps
    n, (S, N) = len(problem.free), group.place.shape
    if problem.period:  # a rate at a tick acts for the period, and the state is that of the row
        start = np.moveaxis(fit.path[:-1], 2, 0).reshape(-1, problem.dt.size)[:, group.at]
        return start[:, None], np.eye(n)[:, :, None, None] * steps.h
    x = np.moveaxis(fit.path[:-1], 2, 0).reshape(-1, problem.dt.size)[:, group.at]
    known = {i: v[None] for i, v in steps.lagged.items()}
    path = shoot(problem.block, steps.t[None], steps.h, steps.u[:, None], known, parameters, x)
    # Backward through the sub-steps, with the Jacobian J_s = dx(s+1)/dx(s) and Phi = dx(end)/dx:
    #   Phi(s) = Phi(s+1) J_s,  Phi(end) = I,  response = h (Phi(s) + Phi(s+1))/2 * trapezoid correction
    response, after = np.empty((n, n, S, N)), np.broadcast_to(np.eye(n)[:, :, None], (n, n, N))
    for s in reversed(range(S)):
        held = {i: v[s, None, None] for i, v in steps.lagged.items()}
        slopes = shoot_with_slopes(
            problem.block, steps.t[s, None, None], steps.h[s], steps.u[:, s, None, None], held, parameters,
            path[s], problem.columns(unknowns=False),
        )[1]  # fmt: skip
        slopes = slopes[list(problem.free)]
        before = np.einsum("ikN,kjN->ijN", after, slopes)
        mean = 0.5 * (after + before) * _of_trapezoid(np.diagonal(slopes).T)
        response[:, :, s] = np.swapaxes(steps.h[s] * mean, 0, 1)
        after = before
    return np.moveaxis(0.5 * (path[:-1] + path[1:]), 1, 0), response


def _of_trapezoid(left: Array) -> Array:
    """Return the mean of an exponential decay relative to the trapezoidal rule, given its value at the end.

    For exp(-a s), s from 0 to 1, with e = exp(-a): (1 - e)/a over (1 + e)/2. The correction matters because
    friction decays fast.
    """
    e = np.clip(left, 1e-12, 1.0)
    with np.errstate(all="ignore"):
        found = 2.0 * (e - 1.0) / ((1.0 + e) * np.log(e))
    return np.asarray(np.where((left > 0.0) & (left < 0.99), found, 1.0))
