"""A plant over one period as a CasADi function, and its optimal control problem by multiple shooting.

The unknowns are the states x_0 ... x_N, the inputs u_0 ... u_N-1 and slacks s_1 ... s_N >= 0::

    minimise    sum_k |x_k - r_k|_Q^2 + |u_k|_R^2 + |u_k - u_k-1|_S^2 + w_1 s_k + w_2 |s_k|^2
    subject to  x_k+1 = F(x_k, u_k),  x_0 given,
                lower <= u_k <= upper,  |u_k - u_k-1| <= rate h,
                g(x_k) + s_k >= 0

(Bock and Plitt, IFAC World Congress 1984). F integrates the plant over one period h by the Runge-Kutta method.
g has the distance from each obstacle and from each limit of a state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.targets.casadi import import_casadi

Array = NDArray[np.float64]

#: Linear and quadratic weight of a slack [1/unit, 1/unit^2]. The linear one is larger than the multipliers of
#: the constraints in a problem with weights of about 1 to 100, so that a slack is used only if it must be.
SLACK = (1e4, 1e4)


@dataclass(frozen=True, eq=False)
class Stage:
    """One period of a plant and what limits it.

    Parameters
    ----------
    plant : Block
        Continuous.
    period : float
        h [s].
    substeps : int
        Runge-Kutta steps in a period.
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
        ca = import_casadi()
        f = self.plant.to_casadi().derivatives
        kind = ca.SX if f.is_a("SXFunction") else ca.MX
        x0, u, h = kind.sym("x", f.size1_in("x")), kind.sym("u", f.size1_in("u")), kind.sym("h")
        p, dt = ca.DM(list(self.parameters)), (h if duration is None else duration) / self.substeps
        x = x0
        for _ in range(self.substeps):
            # Runge-Kutta: x + h/6 (k1 + 2 k2 + 2 k3 + k4)
            k1 = f(0.0, x, u, p)
            k2 = f(0.0, x + dt / 2 * k1, u, p)
            k3 = f(0.0, x + dt / 2 * k2, u, p)
            k4 = f(0.0, x + dt * k3, u, p)
            x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return ca.Function("step", [x0, u, h] if duration is None else [x0, u], [x])

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

    Parameters
    ----------
    nlp : dict
        ``x`` (w), ``p``, ``f`` (cost) and ``g`` (constraints), as ``casadi.nlpsol`` takes them.
    lbx, ubx, lbg, ubg : ndarray, shapes (n_w,) and (n_g,)
        Bounds of w and g.
    n_states, n_inputs, horizon : int
    """

    nlp: dict[str, Any]
    lbx: Array
    ubx: Array
    lbg: Array
    ubg: Array
    n_states: int
    n_inputs: int
    horizon: int

    def split(self, w: Array) -> tuple[Array, Array]:
        """Return the states, shape (horizon + 1, n_states), and inputs, shape (horizon, n_inputs), of w."""
        n, m, N = self.n_states, self.n_inputs, self.horizon
        return w[: n * (N + 1)].reshape(N + 1, n), w[n * (N + 1) : n * (N + 1) + m * N].reshape(N, m)

    def join(self, x: Array, u: Array) -> Array:
        """Return w of states and inputs, with slacks of 0."""
        w = np.zeros(self.lbx.size)
        w[: x.size], w[x.size : x.size + u.size] = x.ravel(), u.ravel()
        return w


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
        Indices of the states with a weight; p has x_0, u_-1 and then r_0 ... r_N of these states.
    """
    ca = import_casadi()
    n, m, N = len(stage.plant.states), len(stage.plant.inputs), horizon
    F, room = stage.step(stage.period), stage.room()
    n_s = room.size1_out(0)
    x, u, s = ca.MX.sym("x", n, N + 1), ca.MX.sym("u", m, N), ca.MX.sym("s", n_s, N)
    x0, u0, r = ca.MX.sym("x0", n), ca.MX.sym("u0", m), ca.MX.sym("r", len(every), N + 1)
    Q, R, S = (ca.DM(w) for w in (weights[0][list(every)], *weights[1:]))
    change = u - ca.horzcat(u0, u[:, :-1])
    error = x[list(every), :] - r
    scale = np.ones((1, N + 1))
    scale[0, -1] = final
    cost = ca.sum2(ca.mtimes(Q.T, error**2) * ca.DM(scale))
    cost += ca.sum2(ca.mtimes(R.T, u**2)) + ca.sum2(ca.mtimes(S.T, change**2))
    cost += SLACK[0] * ca.sum1(ca.vec(s)) + SLACK[1] * ca.sumsqr(s)
    limited = np.flatnonzero(np.isfinite(stage.rate)).tolist()
    rows = [x[:, 0] - x0, ca.vec(x[:, 1:] - F.map(N)(x[:, :-1], u)), ca.vec(change[limited, :])]
    if n_s:
        rows.append(ca.vec(room.map(N)(x[:, 1:]) + s))
    fast = np.tile(stage.rate[limited] * stage.period, N)
    exact, free = np.zeros(n * (N + 1)), np.full(n * (N + 1), np.inf)
    soft = np.zeros(n_s * N)
    return Problem(
        {
            "x": ca.vertcat(ca.vec(x), ca.vec(u), ca.vec(s)),
            "p": ca.vertcat(x0, u0, ca.vec(r)),
            "f": cost,
            "g": ca.vertcat(*rows),
        },
        np.r_[-free, np.tile(stage.lower, N), soft],
        np.r_[free, np.tile(stage.upper, N), np.full(soft.size, np.inf)],
        np.r_[exact, -fast, soft],
        np.r_[exact, fast, np.full(soft.size, np.inf)],
        n,
        m,
        N,
    )
