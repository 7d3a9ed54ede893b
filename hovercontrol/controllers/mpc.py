"""Model predictive control of any Block, in real time: one step of SQP at each sample, or IPOPT.

At each sample the problem of :mod:`hovercontrol.controllers.shooting` is linearised at the previous solution,
shifted by one period, and one quadratic program is solved (real-time iteration: Diehl, Bock and Schloeder, SIAM
Journal on Control and Optimization 43 (2005)). All derivatives are exact, by CasADi.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.controllers.detour import Way, way_around
from hovercontrol.controllers.shooting import Problem, Stage, transcribe
from hovercontrol.core.arguments import as_row, at_least
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimators.propagation import steps_between
from hovercontrol.io.tables import finite, positive
from hovercontrol.models.interface import AnyModel
from hovercontrol.simulation.trajectory import time_response
from hovercontrol.targets.casadi import import_casadi

Array = NDArray[np.float64]
Solver = Literal["rti", "ipopt"]
Limits = Mapping[str, tuple[float, float]]

#: Options of the quadratic solver, OSQP. Of CasADi's solvers it was the quickest on this problem, and the only
#: one to solve each of 300 samples: 0.5 to 0.9 ms; qrqp took 15 ms; HPIPM did not converge.
_OSQP = {
    "osqp": {"verbose": False, "eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 2000},
    "error_on_fail": False,
}
_IPOPT = {"ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200}, "print_time": False, "error_on_fail": False}


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
    clearance, speed : float
        Distance kept from obstacles [m], and speed along the waypoints [m/s].
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
        clearance: float,
        speed: float,
        heading: str,
        solver: Solver,
        name: str,
    ) -> None:
        ca = import_casadi()
        self.stage, self.name, self.solver, self.clearance, self.speed = stage, name, solver, clearance, speed
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
            self._linear = linear.expand() if self._step.is_a("SXFunction") else linear  # nearly twice as fast
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
                raise InputError(
                    f"{self.name}: reference: {key}: expected a finite number or {N + 1}, found shape {row.shape}"
                )
            found[key] = np.broadcast_to(row, N + 1)
        return found

    # ---- one sample ----------------------------------------------------------------------------------

    def _solve(self, memory: Memory, x0: Array, given: Mapping[str, Array]) -> tuple[Array, Memory]:
        progress, r = self._references(memory.progress, x0, given)
        w = self._shifted(memory, x0)
        found = self._optimum(w, np.r_[x0, memory.u], r.ravel(order="F"))
        if not np.isfinite(found).all():
            raise InputError(f"{self.name}: the solver found no finite solution from the state {x0.tolist()}")
        # the solver meets the limits to its tolerance; the command meets them exactly
        fast = self.stage.rate * self.stage.period
        low, high = np.maximum(self.stage.lower, memory.u - fast), np.minimum(self.stage.upper, memory.u + fast)
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
                larger = stage.obstacles + [0.0, 0.0, self.clearance]
                self._way = way_around(np.vstack([here, self._waypoints]), larger)
            reach = self.speed * stage.period
            progress = self._way.nearest(here, progress, progress + max(5 * reach, 0.25))
            ahead = self._way.at(progress + reach * np.arange(1, N + 2))
            rows = dict(zip(stage.position, ahead, strict=True))
            # the heading points to the end of the horizon's way, as the line of sight does
            rows[self._heading] = np.full(N + 1, math.atan2(*(ahead[:, -1] - here)[::-1]))
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
    def to_control(self, name: str | None = None) -> control.NonlinearIOSystem:
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

        return control.nlsys(
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
    ) -> control.TimeResponseData:
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
            Another plant with the same signals, such as one with other coefficients (default: the predicted one).
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
        periods = at_least(f"{self.name}: duration / period", round(positive(f"{self.name}: duration", duration) / period), 1)
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
        times = np.arange(len(y)) * (period / rows)
        return time_response(truth, times, np.array(y).T, np.array(x).T, np.array(u).T)


@checked
def mpc(
    plant: AnyModel,
    *,
    period: float = 0.05,
    horizon: int = 20,
    weights: Mapping[str, float],
    rate_weights: Mapping[str, float] | None = None,
    final: float = 1.0,
    limits: Limits | None = None,
    rate_limits: Mapping[str, float] | None = None,
    obstacles: Sequence[tuple[float, float, float]] = (),
    waypoints: ArrayLike | None = None,
    speed: float = 0.5,
    clearance: float = 0.05,
    position: tuple[str, str] = ("x", "y"),
    heading: str = "psi",
    params: Mapping[str, float] | None = None,
    substeps: int | None = None,
    solver: Solver = "rti",
    name: str = "mpc",
) -> MPC:
    """Return a model predictive controller of a plant, with limits, obstacles and waypoints.

    It solves an optimisation problem at every sample and is therefore not a Block. ``control(x)`` returns the
    inputs of the next period, ``to_control()`` a discrete-time system for use in a loop, and ``simulate(t)``
    the closed loop.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous; its equations predict the motion.
    period : float, optional
        Time between samples [s].
    horizon : int, optional
        Number of periods predicted.
    weights : mapping of str to float
        Of states and inputs [1/unit^2], by name: cost of the squared difference of a state from its reference,
        and of the squared input.
    rate_weights : mapping of str to float, optional
        Cost of the squared change of an input from sample to sample [1/unit^2].
    final : float, optional
        Factor on the weights of the states at the end of the horizon, dimensionless.
    limits : mapping of str to (float, float), optional
        Lower and upper limit of inputs and states [unit], over the bounds of the inputs' signals. Limits of
        inputs hold exactly. Those of states hold where possible (they are soft, with a slack).
    rate_limits : mapping of str to float, optional
        Maximum change of inputs in a second [unit/s].
    obstacles : sequence of (x, y, radius), optional
        Circles that the position stays out of [m]; a radius includes the craft's own. Soft, with a slack.
    waypoints : array_like, shape (n, 2), optional
        Positions to reach in order [m]. The reference moves along the shortest way through them and around the
        obstacles.
    speed : float, optional
        Of the reference along the waypoints [m/s].
    clearance : float, optional
        Distance kept from the obstacles [m].
    position : tuple of str, optional
        The states that are the position [m].
    heading : str, optional
        The state whose reference, with waypoints, is the direction of the way ahead [rad].
    params : mapping, optional
        Parameter values by key for the prediction.
    substeps : int, optional
        Runge-Kutta steps per period (default: chosen from the plant's fastest mode).
    solver : {"rti", "ipopt"}, optional
        One step of SQP at each sample (real-time iteration), or full convergence by IPOPT.
    name : str, optional

    Returns
    -------
    MPC

    Raises
    ------
    InputError
        If CasADi is not installed (``pip install "hovercontrol[mpc]"``), the plant is sampled or its inputs act
        late, a name is unknown, a number is out of range, or a waypoint lies within an obstacle.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> controller = mpc(
    ...     craft, weights={"u": 1.0, "r": 1.0, "thrust": 0.01}, limits={"thrust": (0.0, 4.0), "rudder": (-0.5, 0.5)}
    ... )
    >>> controller
    MPC of block 'plant': 20 periods of 0.05 s, 0 obstacles, solver rti
    >>> controller.control([0.0] * 6, {"u": 1.0}).round(1).tolist()
    [4.0, 0.0]
    """
    block = _plant(plant, name)
    period = positive(f"{name}: period", period)
    at_least(f"{name}: horizon", horizon, 2)
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    both = _by_name(f"{name}: weights", weights, [*states, *inputs])
    if not any(both[key] for key in states):
        raise InputError(f"{name}: weights: expected a positive weight of at least one state")
    S = _by_name(f"{name}: rate_weights", rate_weights or {}, inputs)
    rates = _by_name(f"{name}: rate_limits", rate_limits or {}, inputs, math.inf)
    lower = {s.name: s.lower for s in block.inputs} | dict.fromkeys(states, -math.inf)
    upper = {s.name: s.upper for s in block.inputs} | dict.fromkeys(states, math.inf)
    for key, (low, high) in (limits or {}).items():
        if key not in lower:
            raise InputError(f"{name}: limits: no state or input {key!r}{did_you_mean(key, lower)}")
        if not low < high:
            raise InputError(f"{name}: limits: {key}: expected (lower, upper), found ({low!r}, {high!r})")
        lower[key], upper[key] = float(low), float(high)
    where, circles = _circles(name, states, position, obstacles, waypoints is not None)
    points = None if waypoints is None else _points(name, waypoints)
    stage = Stage(
        block, period, steps_between(block, period, name, substeps), block.parameter_values(params),
        *(np.array([of[key] for key in inputs]) for of in (lower, upper, rates)),
        *(np.array([of[key] for key in states]) for of in (lower, upper)),
        where, circles + [0.0, 0.0, finite(f"{name}: clearance", clearance)],
    )  # fmt: skip
    if points is not None:
        way_around(np.vstack([points[:1], points]), stage.obstacles)  # refuses waypoints within obstacles
    return MPC(
        stage,
        horizon,
        (*(np.array([both[key] for key in names]) for names in (states, inputs)), np.array(list(S.values()))),
        positive(f"{name}: final", final),
        points,
        clearance,
        positive(f"{name}: speed", speed),
        heading,
        solver,
        name,
    )


def _plant(plant: AnyModel, name: str) -> Block:
    block = plant if isinstance(plant, Block) else plant.plant()
    block.need_continuous("prediction", hybrid=False)
    block.need_prompt_inputs("the prediction")
    if not block.states or not block.inputs:
        raise InputError(f"{name}: block {block.name!r} needs states and inputs")
    return block


def _by_name(
    where: str, given: Mapping[str, float], names: Sequence[str], default: float = 0.0
) -> dict[str, float]:
    """Return a number of at least 0 for each name."""
    found = dict.fromkeys(names, default)
    for key, value in given.items():
        if key not in found:
            raise InputError(f"{where}: no signal {key!r}{did_you_mean(key, names)}")
        if finite(f"{where}: {key}", value) < 0.0:
            raise InputError(f"{where}: {key}: expected a number of at least 0, found {value!r}")
        found[key] = float(value)
    return found


def _circles(
    name: str, states: Sequence[str], position: Sequence[str], obstacles: Sequence[Sequence[float]], needed: bool
) -> tuple[tuple[int, ...], Array]:
    circles = np.array(obstacles, dtype=float).reshape(-1, 3)
    for cx, cy, radius in circles:
        if not (np.isfinite([cx, cy, radius]).all() and radius > 0.0):
            raise InputError(
                f"{name}: obstacles: expected (x, y, radius) with a positive radius, "
                f"found ({cx:g}, {cy:g}, {radius:g})"
            )
    if not (len(circles) or needed):
        return (), circles
    for key in position:
        if key not in states:
            raise InputError(f"{name}: position: no state {key!r}{did_you_mean(key, states)}")
    return tuple(states.index(key) for key in position), circles


def _points(name: str, waypoints: ArrayLike) -> Array:
    points = np.asarray(waypoints, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
        raise InputError(f"{name}: waypoints: expected finite positions, shape (n, 2), found shape {points.shape}")
    return points
