"""A plant over one period as a CasADi function, and its optimal control problem by multiple shooting.

The unknowns are the states x_0 ... x_N, the inputs u_0 ... u_N-1 and slacks s_1 ... s_N-1 >= 0::

    minimise    sum_k |x_k - r_k|_Q^2 + |u_k|_R^2 + |u_k - u_k-1|_S^2 + w_1 s_k + w_2 |s_k|^2
    subject to  x_k+1 = F(x_k, u_k),  x_0 given,
                lower <= u_k <= upper,  |u_k - u_k-1| <= rate h,
                g(x_k) + s_k >= 0

(Bock and Plitt, IFAC World Congress 1984). F integrates the plant over one period h by the
Runge-Kutta method, or applies the map of a sampled plant as often as it steps in h. g has the distance
from each obstacle and from each limit of a state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.casadi import import_casadi
from hovercontrol.blocks.block import Block

Places = NDArray[np.intp]

#: Linear and quadratic weight of a slack [1/unit, 1/unit^2]. The linear one is larger than the multipliers of
#: the constraints in a problem with weights of about 1 to 100, so that a slack is used only if it must be.
SLACK = (1e3, 1e3)


@dataclass(frozen=True, eq=False)
class Stage:
    """One period of a plant and what limits it.

    Parameters
    ----------
    plant : Block
        Continuous or sampled.
    period : float
        h [s].
    substeps : int
        Runge-Kutta steps in a period, or steps of a sampled plant.
    parameters : tuple of float
        Values of the plant's parameters.
    lower, upper, rate : ndarray, shape (n_inputs,)
        Bounds of the inputs [unit], and of their change in a second [unit/s].
    state_lower, state_upper : ndarray, shape (n_states,)
        Bounds of the states [unit].
    position : tuple of int
        Indices of the two states that are the position; empty without obstacles.
    obstacles : ndarray, shape (n_obstacles, 3)
        Centre and radius of each circle to stay out of [m].
    """

    plant: Block
    period: float
    substeps: int
    parameters: tuple[float, ...]
    lower: Array
    upper: Array
    rate: Array
    state_lower: Array
    state_upper: Array
    position: tuple[int, ...]
    obstacles: Array

    def step(self, duration: float | None = None) -> Any:
        """Return ``F(x, u, h)``, the plant's state after a time h [s] of held inputs, as a CasADi function.

        Parameters
        ----------
        duration : float, optional
            h as a constant (default: an argument).
        """
        return self._integrated(duration, last=True)

    def path(self) -> Any:
        """Return ``X(x, u, h)``, the states after each Runge-Kutta step, shape (n_states, substeps)."""
        return self._integrated(None, last=False)

    def _integrated(self, duration: float | None, *, last: bool) -> Any:
        ca = import_casadi()
        f = self.plant.to_casadi().derivatives
        kind = ca.SX if f.is_a("SXFunction") else ca.MX
        x0, u, h = kind.sym("x", f.size1_in("x")), kind.sym("u", f.size1_in("u")), kind.sym("h")
        p, dt = ca.DM(list(self.parameters)), (h if duration is None else duration) / self.substeps
        x, states = x0, []
        for _ in range(self.substeps):
            if self.plant.period:
                x = f(0.0, x, u, p)  # the next value itself
                states.append(x)
                continue
            # Runge-Kutta: x + h/6 (k1 + 2 k2 + 2 k3 + k4)
            k1 = f(0.0, x, u, p)
            k2 = f(0.0, x + dt / 2 * k1, u, p)
            k3 = f(0.0, x + dt / 2 * k2, u, p)
            k4 = f(0.0, x + dt * k3, u, p)
            x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            states.append(x)
        given = [x0, u, h] if duration is None else [x0, u]
        return ca.Function("step", given, [x if last else ca.horzcat(*states)])

    def room(self) -> Any:
        """Return ``g(x)``, negative where the state violates an obstacle or a limit, as a CasADi function."""
        ca = import_casadi()
        x = ca.SX.sym("x", len(self.plant.states))
        rows = []
        for cx, cy, radius in self.obstacles:
            dx, dy = x[self.position[0]] - cx, x[self.position[1]] - cy
            rows.append(ca.sqrt(dx**2 + dy**2 + 1e-12) - radius)
        rows += [x[i] - low for i, low in enumerate(self.state_lower) if np.isfinite(low)]
        rows += [high - x[i] for i, high in enumerate(self.state_upper) if np.isfinite(high)]
        return ca.Function("room", [x], [ca.vertcat(*rows) if rows else ca.SX(0, 1)])


@dataclass(frozen=True, eq=False)
class Problem:
    """The optimal control problem of a stage, made by :func:`transcribe`; unknowns w, parameters p.

    The unknowns are in the order of stages, ``x_0, u_-1, u_0, x_1, u_0, u_1, s_1, ... x_N, u_N-1``: with
    the previous input as a state, each stage is coupled to the next one alone.

    Parameters
    ----------
    nlp : dict
        ``x`` (w), ``p``, ``f`` (cost) and ``g`` (constraints), as ``casadi.nlpsol`` takes them.
    lbx, ubx, lbg, ubg : ndarray, shapes (n_w,) and (n_g,)
        Bounds of w and g; those of the first n_states + n_inputs unknowns are the present state and input.
    states : ndarray of int, shape (horizon + 1, n_states)
        Places of the states in w.
    inputs : ndarray of int, shape (horizon, n_inputs)
        Places of the inputs in w.
    held : ndarray of int, shape (horizon + 1, n_inputs)
        Places of the previous inputs in w.
    prediction : casadi.Function
        ``(x_0, u_-1, [u_0 ... u_N-1], p)`` to the states ``[x_0 ... x_N]`` of the plant and the cost.
    """

    nlp: dict[str, Any]
    lbx: Array
    ubx: Array
    lbg: Array
    ubg: Array
    states: Places
    inputs: Places
    held: Places
    prediction: Any

    @property
    def horizon(self) -> int:
        """Number of periods."""
        return len(self.inputs)

    def join(self, x: Array, u: Array, before: Array) -> Array:
        """Return w of states, inputs and the input before them, with slacks of 0."""
        w = np.zeros(self.lbx.size)
        w[self.states], w[self.inputs], w[self.held] = x, u, np.vstack([before, u])
        return w

    @lru_cache(maxsize=8)  # noqa: B019  (the object lives as long as its controller)
    def _predictions(self, count: int) -> Any:
        return self.prediction.map(count)

    def predict(self, x0: Array, before: Array, plans: Array, p: Array) -> tuple[Array, Array]:
        """Return the motion under several plans and the cost of each, infinite if it is not finite.

        Parameters
        ----------
        x0 : ndarray, shape (n_states,)
        before : ndarray, shape (n_inputs,)
            The input before.
        plans : ndarray, shape (n_plans, horizon, n_inputs)
        p : ndarray, shape (n_p,)

        Returns
        -------
        ndarray, shape (n_plans, horizon + 1, n_states)
        ndarray, shape (n_plans,)
        """
        count, N, m = plans.shape
        first, last, given = (np.tile(column[:, None], count) for column in (x0, before, p))
        columns = plans.transpose(2, 0, 1).reshape(m, count * N)
        motion, cost = self._predictions(count)(first, last, columns, given)
        states = np.array(motion).reshape(-1, count, N + 1).transpose(1, 2, 0)
        found = np.array(cost).ravel()
        return states, np.where(np.isfinite(found), found, np.inf)


def transcribe(
    stage: Stage, horizon: int, weights: tuple[Array, Array, Array], final: float, every: Sequence[int]
) -> Problem:
    """Return the tracking problem of a stage over a horizon.

    Parameters
    ----------
    horizon : int
        N.
    weights : tuple of ndarray
        Diagonals of Q, R and S.
    final : float
        Factor on Q at the end of the horizon, dimensionless.
    every : sequence of int
        Indices of the states with a weight; p has r_0 ... r_N of these states.
    """
    ca = import_casadi()
    n, m, N = len(stage.plant.states), len(stage.plant.inputs), horizon
    F, room = stage.step(stage.period), stage.room()
    n_s = room.size1_out(0)
    size = 2 * m + n + n_s  # of a stage; the first has no slacks, the last neither slacks nor inputs
    begin = np.r_[0, n + 2 * m + size * np.arange(N)]
    states = begin[:, None] + np.arange(n)
    held = begin[:, None] + n + np.arange(m)
    inputs = held[:-1] + m
    slacks = begin[1:-1, None] + size - n_s + np.arange(n_s)
    w = ca.MX.sym("w", int(begin[-1]) + n + m)
    x, u, v, s = (
        ca.reshape(w[places.ravel().tolist()], places.shape[1], len(places))
        for places in (states, inputs, held, slacks)
    )
    r = ca.MX.sym("r", len(every), N + 1)
    Q, R, S = (ca.DM(w) for w in (weights[0][list(every)], *weights[1:]))
    change = u - v[:, :-1]
    scale = np.ones((1, N + 1))
    scale[0, -1] = final

    def cost(x: Any, u: Any, change: Any, s: Any) -> Any:
        total = ca.sum2(ca.mtimes(Q.T, (x[list(every), :] - r) ** 2) * ca.DM(scale))
        total += ca.sum2(ca.mtimes(R.T, u**2)) + ca.sum2(ca.mtimes(S.T, change**2))
        return total + SLACK[0] * ca.sum1(ca.vec(s)) + SLACK[1] * ca.sumsqr(s)

    limited = np.flatnonzero(np.isfinite(stage.rate)).tolist()
    fast = stage.rate[limited] * stage.period
    # F(x_k, u_k) - x_k+1 = 0,  u_k - v_k+1 = 0,  |u_k - v_k| <= rate h,  g(x_k) + s_k >= 0
    after, free = F.map(N)(x[:, :-1], u), room.map(N - 1)(x[:, 1:-1]) + s
    rows, low_g, high_g = [], [], []
    for k in range(N + 1):
        if k < N:
            rows += [after[:, k] - x[:, k + 1], u[:, k] - v[:, k + 1], change[limited, k]]
            low_g += [np.zeros(n + m), -fast]
            high_g += [np.zeros(n + m), fast]
        if 0 < k < N:
            rows.append(free[:, k - 1])
            low_g.append(np.zeros(n_s))
            high_g.append(np.full(n_s, np.inf))
    lower, upper = np.full(w.size1(), -np.inf), np.full(w.size1(), np.inf)
    lower[inputs], upper[inputs] = stage.lower, stage.upper
    lower[slacks] = 0.0
    nlp = {"x": w, "p": ca.vec(r), "f": cost(x, u, change, s), "g": ca.vertcat(*rows)}
    # the same cost of x_k+1 = F(x_k, u_k) and the least slacks, s_k = max(0, -g(x_k))
    x0, v0, plan = ca.MX.sym("x0", n), ca.MX.sym("v0", m), ca.MX.sym("plan", m, N)
    motion = ca.horzcat(x0, F.mapaccum(N)(x0, plan))
    least = ca.fmax(0, -room.map(N - 1)(motion[:, 1:-1]))
    found = cost(motion, plan, plan - ca.horzcat(v0, plan[:, :-1]), least)
    prediction = ca.Function("prediction", [x0, v0, plan, ca.vec(r)], [motion, found])
    bounds = lower, upper, np.concatenate(low_g), np.concatenate(high_g)
    return Problem(nlp, *bounds, states, inputs, held, prediction)
