"""The minimum-time problem of a plant by multiple shooting, solved by IPOPT.

The unknowns are the duration T_j of each phase (from one waypoint to the next), the states x_k at the ends of
its N equal intervals h_j = T_j / N, and the inputs u_k held over each interval::

    minimise    sum_j T_j + w sum_k |(u_k - u_k-1) / (upper - lower)|^2
    subject to  x_k+1 = F(x_k, u_k, h_j),  lower <= u_k <= upper,  |u_k - u_k-1| <= rate h_j,
                g(x) >= 0 after each Runge-Kutta step,
                x_0 given,  the position at the end of each phase given,  some states at the end given

(Bock and Plitt, IFAC World Congress 1984). The small weight w selects one of the inputs that need the same
time. F and g are those of :class:`.shooting.Stage`. A first solution comes from the implicit Euler method,
``x_k+1 = x_k + h_j f(x_k+1, u_k)``: it is quick, and stable with steep friction and from poor guesses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.casadi import import_casadi
from hovercontrol.control.controllers.shooting import Stage

#: Cost of a change of an input over all its range [s].
CHANGE = 1e-4
#: Shortest phase [s].
SHORTEST = 1e-6
#: Options of IPOPT: all problems, those from poor guesses, those from a plan.
_IPOPT = {"print_level": 0, "sb": "yes", "max_iter": 500}
_FIRST = {"max_cpu_time": 20.0}
_WARM = {"max_cpu_time": 60.0, "mu_init": 1e-3}
#: What IPOPT says of a solution.
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


@dataclass(frozen=True, eq=False)
class Ends:
    """What is given of a motion.

    Parameters
    ----------
    start : ndarray, shape (n_states,)
        Initial state.
    before : ndarray, shape (n_inputs,)
        Inputs before the start; NaN where the first input is free.
    end : ndarray, shape (n_states,)
        Final state; NaN where it is free.
    waypoints : ndarray, shape (n, 2)
        Positions to pass [m].
    """

    start: Array
    before: Array
    end: Array
    waypoints: Array


@dataclass(frozen=True, eq=False)
class Plan:
    """A solution or a guess of the problem.

    Parameters
    ----------
    durations : ndarray, shape (n_phases,)
        [s]
    states : ndarray, shape (n_states, n_phases * N + 1)
    inputs : ndarray, shape (n_inputs, n_phases * N)
    said : str
        What IPOPT said, empty for a guess.
    """

    durations: Array
    states: Array
    inputs: Array
    said: str = ""

    @property
    def steps(self) -> Array:
        """Length of each interval [s], shape (n_phases * N,)."""
        count = self.inputs.shape[1] // len(self.durations)
        return np.repeat(self.durations / count, count)


def solve(stage: Stage, ends: Ends, guess: Plan, *, euler: bool = False) -> Plan:
    """Return the plan that IPOPT finds from a guess; check what it `said`.

    Parameters
    ----------
    stage : Stage
        Its period is not used.
    euler : bool, optional
        Whether F is the implicit Euler method, instead of Runge-Kutta steps.
    """
    ca = import_casadi()
    n, total = guess.inputs.shape[0], guess.inputs.shape[1]
    phases, n_x = len(guess.durations), len(ends.start)
    N = total // phases
    T, x, u = ca.MX.sym("T", phases), ca.MX.sym("x", n_x, total + 1), ca.MX.sym("u", n, total)
    h = ca.horzcat(*(ca.repmat(T[j] / N, 1, N) for j in range(phases)))
    after, free = (_euler if euler else _runge_kutta)(stage).map(total)(x[:, :-1], x[:, 1:], u, h)
    change = ca.horzcat(u[:, 0] - ca.DM(ends.before), ca.diff(u, 1, 1))
    known = np.flatnonzero(np.isfinite(ends.before)).tolist()
    unknown = np.setdiff1d(np.arange(n), known).tolist()
    change[unknown, 0] = 0.0
    width = ca.repmat(ca.DM(stage.upper - stage.lower), 1, total)
    cost = ca.sum1(T) + CHANGE * ca.sumsqr(change / width)
    limited = np.flatnonzero(np.isfinite(stage.rate)).tolist()
    fast = ca.DM(stage.rate[limited]) @ h
    slow = [ca.vec(fast - change[limited, :]), ca.vec(fast + change[limited, :])]
    rows = [ca.vec(after - x[:, 1:]), ca.vec(free), *slow]
    equal = rows[0].size1()
    low, high = _given(stage, ends, N, total + 1)
    shortest, longest = np.full(phases, SHORTEST), np.full(phases, np.inf)
    if stage.plant.period:  # a step takes its period
        shortest = longest = guess.durations
    w = ca.vertcat(T, ca.vec(x), ca.vec(u))
    g = ca.vertcat(*rows)
    solver = ca.nlpsol(
        "minimum_time", "ipopt", {"x": w, "f": cost, "g": g},
        {"ipopt": _IPOPT | (_FIRST if euler else _WARM), "print_time": False, "error_on_fail": False},
    )  # fmt: skip
    found = solver(
        x0=np.concatenate([guess.durations, guess.states.ravel("F"), guess.inputs.ravel("F")]),
        lbx=np.concatenate([shortest, low.ravel("F"), np.tile(stage.lower, total)]),
        ubx=np.concatenate([longest, high.ravel("F"), np.tile(stage.upper, total)]),
        lbg=np.zeros(g.size1()),
        ubg=np.concatenate([np.zeros(equal), np.full(g.size1() - equal, np.inf)]),
    )
    values = np.asarray(found["x"]).ravel()
    states, inputs = np.split(values[phases:], [n_x * (total + 1)])
    # the solver meets the limits to its tolerance; the inputs meet them exactly
    held = np.clip(inputs.reshape(total, n).T, stage.lower[:, None], stage.upper[:, None])
    said = str(solver.stats()["return_status"])
    return Plan(values[:phases], states.reshape(total + 1, n_x).T, held, said)


def refined(stage: Stage) -> Stage:
    """Return the stage with twice as many Runge-Kutta steps."""
    return replace(stage, substeps=2 * stage.substeps)


def _runge_kutta(stage: Stage) -> Any:
    """Return ``(x, x_next, u, h) -> (state at the end, room after each Runge-Kutta step)``."""
    ca = import_casadi()
    path, room = stage.path(), stage.room()
    kind = ca.SX if path.is_a("SXFunction") else ca.MX
    x, after, u, h = _symbols(kind, stage)
    states = path(x, u, h)
    free = [room(states[:, k]) for k in range(stage.substeps)]
    return ca.Function("interval", [x, after, u, h], [states[:, -1], ca.vertcat(*free)])


def _euler(stage: Stage) -> Any:
    """Return the same of the implicit Euler method, room at the end."""
    ca = import_casadi()
    f, room = stage.plant.to_casadi().derivatives, stage.room()
    kind = ca.SX if f.is_a("SXFunction") else ca.MX
    x, after, u, h = _symbols(kind, stage)
    rates = f(0.0, after, u, ca.DM(list(stage.parameters)))
    return ca.Function("interval", [x, after, u, h], [x + h * rates, room(after)])


def _symbols(kind: Any, stage: Stage) -> list[Any]:
    n, m = len(stage.plant.states), len(stage.plant.inputs)
    return [kind.sym(name, size) for name, size in (("x", n), ("after", n), ("u", m), ("h", 1))]


def _given(stage: Stage, ends: Ends, N: int, rows: int) -> tuple[Array, Array]:
    """Return bounds of the states at the ends of intervals, shape (n_states, rows), equal where given."""
    low = np.full((len(ends.start), rows), -np.inf)  # the limits of states are in g
    high = -low
    low[:, 0] = high[:, 0] = ends.start
    given = np.isfinite(ends.end)
    low[given, -1] = high[given, -1] = ends.end[given]
    for k, point in enumerate(ends.waypoints, 1):
        places = list(stage.position)
        low[places, k * N] = high[places, k * N] = point
    return low, high
