"""Model predictive control of any Block, in real time: one step of SQP at each sample, or IPOPT.

At each sample the problem of :mod:`hovercontrol.controllers.shooting` is linearised at the previous solution,
shifted by one period, and one quadratic program is solved (real-time iteration: Diehl, Bock and Schloeder,
SIAM Journal on Control and Optimization 43 (2005)). All derivatives are exact, by CasADi.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from control import NonlinearIOSystem, TimeResponseData, nlsys
from numpy.typing import ArrayLike, NDArray

from hovercontrol.controllers.detour import Way, way_around
from hovercontrol.controllers.shooting import Stage, transcribe
from hovercontrol.core.arguments import as_row, at_least
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.tables import positive
from hovercontrol.simulation.trajectory import time_response
from hovercontrol.targets.casadi import import_casadi

Array = NDArray[np.float64]
Solver = Literal["rti", "ipopt"]

#: Options of OSQP, the quickest of CasADi's quadratic solvers on C17's craft (`python -m benchmarks mpc`).
_OSQP = {
    "osqp": {"verbose": False, "eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 2000},
    "error_on_fail": False,
}
_IPOPT = {
    "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200},
    "print_time": False,
    "error_on_fail": False,
}


class Memory(NamedTuple):
    """What the controller keeps from sample to sample.

    Parameters
    ----------
    w : ndarray
        The last solution, shape (n_unknowns,).
    u : ndarray, shape (n_inputs,)
        The last input [unit].
    progress : float
        Length along the waypoints' path [m].
    started : bool
        False before the first sample.
    """

    w: Array
    u: Array
    progress: float
    started: bool


class MPC:
    """A model predictive controller, from :func:`mpc`.

    Parameters
    ----------
    stage : Stage
        The plant over one period, and its limits.
    horizon : int
        Number of periods.
    weights : tuple of ndarray
        Of states, inputs and changes of inputs.
    final : float
        Factor on the states' weights at the end of the horizon.
    waypoints : ndarray, shape (n, 2), optional
        Positions [m].
    speed : float
        Speed along the waypoints [m/s].
    heading : str
        The state that is the heading.
    solver : {"rti", "ipopt"}
    name : str

    Attributes
    ----------
    tracked : tuple of str
        Names of the states with a weight.
    """

    def __init__(
        self,
        stage: Stage,
        horizon: int,
        weights: tuple[Array, Array, Array],
        final: float,
        waypoints: Array | None,
        speed: float,
        heading: str,
        solver: Solver,
        name: str,
    ) -> None:
        ca = import_casadi()
        self.stage, self.name, self.solver, self.speed = stage, name, solver, speed
        self._every = np.flatnonzero(weights[0]).tolist()
        self.tracked = tuple(stage.plant.states[i].name for i in self._every)
        self._waypoints, self._way = waypoints, None if waypoints is None else Way(waypoints)
        self.problem = transcribe(stage, horizon, weights, final, self._every)
        self._step = stage.step(stage.period)
        names = [s.name for s in stage.plant.states]
        self._heading = names.index(heading) if heading in names else -1
        self._angles = np.array([stage.plant.states[i].unit == "rad" for i in self._every])
        nlp = self.problem.nlp
        if solver == "ipopt":
            self._ipopt = ca.nlpsol("mpc", "ipopt", nlp, _IPOPT)
        else:
            hessian, gradient = ca.hessian(nlp["f"], nlp["x"])
            jacobian = ca.jacobian(nlp["g"], nlp["x"])
            # f is quadratic and its Hessian constant; f = f(0) + c'w + w'Hw/2 with c = f'(w) - H w
            self._hessian = ca.Function("h", [], [hessian])()["o0"]
            linear = ca.Function(
                "linear", [nlp["x"], nlp["p"]],
                [gradient - hessian @ nlp["x"], nlp["g"] - jacobian @ nlp["x"], jacobian],
            )  # fmt: skip
            self._linear = (
                linear.expand() if self._step.is_a("SXFunction") else linear
            )  # nearly twice as fast
            shapes = {"h": self._hessian.sparsity(), "a": jacobian.sparsity()}
            self._qp = ca.conic("qp", "osqp", shapes, _OSQP)
        self.reset()

    def __repr__(self) -> str:
        plant, n = self.stage.plant, self.problem.horizon
        return (
            f"MPC of block {plant.name!r}: {n} periods of {self.stage.period:g} s, "
            f"{len(self.stage.obstacles)} obstacles, solver {self.solver}"
        )

    @property
    def plant(self) -> Block:
        """The plant."""
        return self.stage.plant

    def reset(self) -> None:
        """Forget the previous samples."""
        self._memory = self._fresh
        if self._waypoints is not None:
            self._way = None

    @cached_property
    def _fresh(self) -> Memory:
        rest = np.clip(0.0, self.stage.lower, self.stage.upper)
        return Memory(np.zeros(self.problem.lbx.size), rest, 0.0, False)

    @checked
    def control(self, x: ArrayLike, reference: Mapping[str, ArrayLike] | None = None) -> Array:
        """Return the inputs for the next period, and keep the solution for the next sample.

        Parameters
        ----------
        x : array_like, shape (n_states,)
            The plant's present state.
        reference : mapping of str to array_like, optional
            For states with a weight: a value, or its values now and after each period, shape (horizon + 1,).
            States that are not named have the reference 0, or with waypoints their point on the path.

        Returns
        -------
        ndarray, shape (n_inputs,)
            The plant's inputs, within their limits.

        Raises
        ------
        InputError
            If a name or a shape is wrong, or the solver finds no finite solution.
        """
        x0 = as_row(f"{self.name}: x", x, len(self.plant.states))
        u, self._memory = self._solve(self._memory, x0, self._reference(reference))
        return u

    @property
    def predicted(self) -> dict[str, Array]:
        """The last solution: the states by name, shape (horizon + 1,)."""
        x = self._memory.w[self.problem.states]
        return {s.name: x[:, i] for i, s in enumerate(self.plant.states)}

    def _reference(self, given: Mapping[str, ArrayLike] | None) -> dict[str, Array]:
        known, N = self.tracked, self.problem.horizon
        found = {}
        for key, values in (given or {}).items():
            if key not in known:
                raise InputError(
                    f"{self.name}: reference: no weight on a state {key!r}{did_you_mean(key, known)}"
                )
            row = np.atleast_1d(np.asarray(values, dtype=float))
            if row.shape not in ((1,), (N + 1,)) or not np.isfinite(row).all():
                raise InputError(f"{self.name}: reference: {key}: expected 1 or {N + 1} finite numbers")
            found[key] = np.broadcast_to(row, N + 1)
        return found

    # ---- one sample ----------------------------------------------------------------------------------

    def _solve(self, memory: Memory, x0: Array, given: Mapping[str, Array]) -> tuple[Array, Memory]:
        progress, r = self._references(memory.progress, x0, given)
        w = self._shifted(memory, x0)
        found = self._optimum(w, np.r_[x0, memory.u], r.ravel(order="F"))
        if not np.isfinite(found).all():
            raise InputError(f"{self.name}: no finite solution from the state {x0.tolist()}")
        # the solver meets the limits to its tolerance; the command meets them exactly
        fast = self.stage.rate * self.stage.period
        low, high = (
            np.maximum(self.stage.lower, memory.u - fast),
            np.minimum(self.stage.upper, memory.u + fast),
        )
        first = np.clip(found[self.problem.inputs[0]], low, high)
        return first, Memory(found, first, progress, True)

    def _optimum(self, w: Array, start: Array, p: Array) -> Array:
        """Return the solution from a guess w, with the present state and input."""
        q, n = self.problem, start.size
        lower, upper = q.lbx.copy(), q.ubx.copy()
        lower[:n] = upper[:n] = start
        if self.solver == "ipopt":
            result = self._ipopt(x0=w, p=p, lbx=lower, ubx=upper, lbg=q.lbg, ubg=q.ubg)
        else:
            gradient, rest, jacobian = self._linear(w, p)
            rest = np.asarray(rest).ravel()
            result = self._qp(
                h=self._hessian, g=gradient, a=jacobian, lba=q.lbg - rest, uba=q.ubg - rest,
                lbx=lower, ubx=upper, x0=w,
            )  # fmt: skip
        return np.asarray(result["x"]).ravel()

    def _shifted(self, memory: Memory, x0: Array) -> Array:
        """Return the previous solution one period later; at first, the motion with constant inputs."""
        problem = self.problem
        if memory.started:
            x, u = memory.w[problem.states], memory.w[problem.inputs]
            u = np.vstack([u[1:], u[-1:]])
            last = np.asarray(self._step(x[-1], u[-1])).ravel()
            return problem.join(np.vstack([x0, x[2:], last]), u, memory.u)
        u = np.tile(memory.u, (problem.horizon, 1))
        motion = [x0]
        for row in u:
            motion.append(np.asarray(self._step(motion[-1], row)).ravel())
        return problem.join(np.array(motion), u, memory.u)

    def _references(self, progress: float, x0: Array, given: Mapping[str, Array]) -> tuple[float, Array]:
        N, stage = self.problem.horizon, self.stage
        r = np.zeros((len(self._every), N + 1))
        if self._waypoints is not None:
            here = x0[list(stage.position)]
            if self._way is None:
                larger = stage.obstacles
                self._way = way_around(np.vstack([here, self._waypoints]), larger)
            reach = self.speed * stage.period
            progress = self._way.nearest(here, progress, progress + max(5 * reach, 0.25))
            ahead = self._way.at(progress + np.arange(1.0, N + 2.0) * reach)
            rows = dict(zip(stage.position, ahead, strict=True))
            # the heading points to the way's point a horizon ahead, as the line of sight does
            goal = self._way.ahead(progress + reach * (N + 1)) - here
            rows[self._heading] = np.full(N + 1, math.atan2(goal[1], goal[0]))
            for i, row in rows.items():
                if i in self._every:
                    r[self._every.index(i)] = row
        for key, values in given.items():
            r[self.tracked.index(key)] = values
        # an angle and its reference differ by less than half a turn now
        off = r[:, 0] - x0[self._every]
        r[self._angles] -= (2 * math.pi * np.round(off / (2 * math.pi)))[self._angles, None]
        return progress, r

    # ---- in a loop -------------------------------------------------------------------------------------

    @checked
    def to_control(self, name: str | None = None) -> NonlinearIOSystem:
        """Return the controller as a discrete-time system of python-control.

        Its inputs are the plant's states, by name, then ``NAME_ref`` for each state with a weight (without
        waypoints); its outputs are the plant's inputs. Its state is the previous solution (warm start).

        Parameters
        ----------
        name : str, optional
            Name of the system (default: the controller's).
        """
        states = [s.name for s in self.plant.states]
        wanted = [] if self._waypoints is not None else [f"{key}_ref" for key in self.tracked]
        fresh = self._fresh
        n_w, m = fresh.w.size, fresh.u.size
        last: dict[bytes, tuple[Array, Array]] = {}

        def solved(z: Array, y: Array) -> tuple[Array, Array]:
            key = np.r_[z, y].tobytes()
            if key not in last:
                memory = Memory(z[:n_w], z[n_w : n_w + m], float(z[-2]), bool(z[-1]))
                values = zip(wanted, y[len(states) :], strict=True)
                given = {k.removesuffix("_ref"): np.full(self.problem.horizon + 1, v) for k, v in values}
                command, after = self._solve(memory if memory.started else fresh, y[: len(states)], given)
                last.clear()
                last[key] = command, np.r_[after.w, after.u, after.progress, 1.0]
            return last[key]

        return nlsys(
            lambda t, z, y, params: solved(z, y)[1],
            lambda t, z, y, params: solved(z, y)[0],
            inputs=[*states, *wanted],
            outputs=[s.name for s in self.plant.inputs],
            states=n_w + m + 2,
            dt=self.stage.period,
            name=name or self.name,
        )

    @checked
    def simulate(
        self,
        duration: float,
        x0: Mapping[str, float] | ArrayLike | None = None,
        *,
        reference: Mapping[str, ArrayLike] | None = None,
        plant: Block | None = None,
        rows: int = 5,
    ) -> TimeResponseData:
        """Return the motion of the plant in closed loop, from a new start of the controller.

        Parameters
        ----------
        duration : float
            [s]
        x0 : mapping by name, or array_like, shape (n_states,), optional
            Initial state over the plant's start values.
        reference : mapping, optional
            As for :meth:`control`.
        plant : Block, optional
            Another plant with the same signals (default: the one that predicts).
        rows : int, optional
            Rows of the result in each period.

        Returns
        -------
        control.TimeResponseData
            Outputs, states and inputs of the plant.

        Raises
        ------
        InputError
            If a name, a number or a shape is wrong, or the simulation fails.
        """
        period = self.stage.period
        periods = at_least(
            f"{self.name}: duration / period", round(positive(f"{self.name}: duration", duration) / period), 1
        )
        at_least(f"{self.name}: rows", rows, 1)
        truth = plant if plant is not None else self.plant
        run = truth.compile().start(x0)
        self.reset()
        x, y, u = [run.state], [run.outputs], []
        for _ in range(periods):
            command = self.control(run.state, reference)
            for _ in range(rows):
                y.append(run.step(command, period / rows))
                x.append(run.state)
                u.append(command)
        u.append(u[-1])
        times = np.arange(float(len(y))) * (period / rows)
        return time_response(truth, times, np.array(y).T, np.array(x).T, np.array(u).T)
