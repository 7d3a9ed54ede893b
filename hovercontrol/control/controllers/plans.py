"""The plan of a sample: the solver's, or another one that is predicted to cost less.

A solver follows derivatives. At rest the thrust ``k n abs(n)`` of a propeller has none by its speed n, a
command within a dead zone has none, and of a product of two commands neither has one while the other is zero:
there the solver finds a stationary point that is no minimum, and stays. So plans are compared by their
predicted cost, which needs no derivatives:

- the last plan, shifted by one period, and points between it and the solver's (a line search),
- the inputs before, held,
- for each input, each pair of inputs (of up to three inputs all together) and each direction constants of
  several sizes within the bounds, over several lengths, in place of the last plan.

If a constant costs less, the solver begins again from it. The plan with the least predicted cost is taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.constant_inputs import constant_inputs, directions
from hovercontrol.blocks.singular import finite_jacobian
from hovercontrol.control.controllers.optimizer import TOLERANCE, Optimizer, UnsolvedError
from hovercontrol.control.controllers.shooting import Problem, Stage

#: Points between a plan and the solver's, as fractions of the way to the solver's, if that one costs more.
LINE = 0.5 ** np.arange(1, 6)


#: Number of constants that are tried at each sample after the first, in turn.
LATER = 8
#: Lengths of the constants, as fractions of the horizon: of one period at least.
LENGTHS = np.array([1.0, 0.25, 0.0])


class Plan(NamedTuple):
    """A plan, and how it was found.

    Parameters
    ----------
    w : ndarray, shape (n_w,)
        The unknowns.
    fault : str
        Why the solver has none, else empty.
    moves : bool
        Whether it is predicted to cost less than constant inputs, at the first sample.
    """

    w: Array
    fault: str
    moves: bool


class Sample(NamedTuple):
    """What is known at a sample.

    Parameters
    ----------
    number : int
        All constants are tried at sample 0, later some at each.
    x : ndarray, shape (n_states,)
    before : ndarray, shape (n_inputs,)
        The input before.
    p : ndarray, shape (n_p,)
        The references.
    """

    number: int
    x: Array
    before: Array
    p: Array


class Planner:
    """Chooses the plan of each sample.

    Parameters
    ----------
    stage : Stage
    problem : Problem
    optimizer : Optimizer
    weights : ndarray, shape (n_inputs,)
        Of the squared inputs.
    """

    def __init__(self, stage: Stage, problem: Problem, optimizer: Optimizer, weights: Array) -> None:
        self._stage, self._problem, self._optimizer, self._weights = stage, problem, optimizer, weights
        self._directions = directions(len(stage.lower))
        self._nominal = np.array([s.nominal for s in stage.plant.inputs])

    def plan(self, last: Array, at: Sample) -> Plan:
        """Return the plan of a sample.

        Parameters
        ----------
        last : ndarray, shape (n_w,)
            The last plan, shifted.

        Raises
        ------
        UnsolvedError
            If the cost of no plan is finite, or at the first sample if a derivative is not.
        """
        stay = np.inf
        if not at.number:  # the first plan has constant inputs
            u = last[self._problem.inputs]
            states, (stay,) = self._predicted(u[None], at)
            last = self._problem.join(states[0], u, at.before)
        w, least, fault = self._improved(last, at)
        u = last[self._problem.inputs]
        held = np.broadcast_to(at.before, (1, *u.shape))
        for plans in [held, *self._constants(u, least, at.number)]:
            plans = self._limited(plans, at.before)
            states, costs = self._predicted(plans, at)
            k = int(np.argmin(costs))
            # at the first sample the best constants of each length are improved, later those that cost less
            if costs[k] < least or (not at.number and np.isfinite(costs[k])):
                other = self._problem.join(states[k], plans[k], at.before)
                found, cost, also = self._improved(other, at)
                fault = fault and also
                if cost < least:
                    w, least = found, cost
        if not np.isfinite(least):
            raise UnsolvedError(fault or "no finite prediction")
        return Plan(w, fault, bool(least < stay * (1.0 - TOLERANCE)))

    def _predicted(self, plans: Array, at: Sample) -> tuple[Array, Array]:
        return self._problem.predict(at.x, at.before, plans, at.p)

    def _improved(self, w: Array, at: Sample) -> tuple[Array, float, str]:
        """Return a plan or the best one on the line to the solver's, its cost, and why there is no other."""
        u = w[self._problem.inputs]
        try:
            found = self._optimizer.optimum(w, np.r_[at.x, at.before], at.p)
        except UnsolvedError as error:
            singular = self._singular(w)
            if singular and not at.number:
                raise UnsolvedError(singular) from None
            return w, float(self._predicted(u[None], at)[1][0]), singular or str(error)
        step = found[self._problem.inputs] - u
        plans = self._limited(np.array([u + step, u]), at.before)
        _, (reached, before) = self._predicted(plans, at)
        if reached <= before:
            return found, float(reached), ""
        plans = self._limited(u + LINE[:, None, None] * step, at.before)
        states, costs = self._predicted(plans, at)
        k = int(np.argmin(costs))
        if costs[k] < before:
            return self._problem.join(states[k], plans[k], at.before), float(costs[k]), ""
        return w, float(before), ""

    def _singular(self, w: Array) -> str:
        """Return where along a plan the plant has no finite derivatives; empty if it has them."""
        plant, problem = self._stage.plant, self._problem
        params = dict(zip(plant.default_parameters, self._stage.parameters, strict=True))
        x, u = w[problem.states[:-1]].T, w[problem.inputs].T
        try:
            for columns in ("states", "inputs"):
                finite_jacobian(plant, np.zeros(x.shape[1]), x, u, params, columns=columns)
        except InputError as error:
            return str(error)
        return ""

    def _constants(self, last: Array, cost: float, sample: int) -> Array:
        """Return the last plan with some inputs constant, shape (n_lengths, n_plans, horizon, n_inputs)."""
        # an input u held over N periods costs N R u^2 alone: not above the cost that is already predicted
        with np.errstate(divide="ignore", invalid="ignore"):
            dear = np.nan_to_num(np.sqrt(cost / (len(last) * self._weights)), nan=np.inf, posinf=np.inf)
        bounds = self._stage.lower, self._stage.upper, self._nominal
        levels = constant_inputs(*bounds, largest=dear)
        N = len(last)
        first = np.arange(N) < np.maximum(1, np.ceil(LENGTHS * N))[:, None]
        # shape (n_lengths, n_sizes, n_directions, N, n_inputs)
        moved = first[:, None, None, :, None] & (self._directions != 0.0)[:, None]
        plans = np.where(moved, levels[..., None, :], last).reshape(len(LENGTHS), -1, *last.shape)
        if not sample:
            return plans
        every = plans.reshape(1, -1, *last.shape)
        return every[:, (sample * LATER + np.arange(LATER)) % every.shape[1]]

    def _limited(self, plans: Array, before: Array) -> Array:
        """Return plans within the bounds of the inputs and of their rates."""
        stage = self._stage
        plans = np.clip(plans, stage.lower, stage.upper)
        fast = stage.rate * stage.period
        if np.isfinite(fast).any():
            for k in range(plans.shape[1]):
                now = plans[:, k - 1] if k else before
                plans[:, k] = np.clip(plans[:, k], now - fast, now + fast)
        return plans
