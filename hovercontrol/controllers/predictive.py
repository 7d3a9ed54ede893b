"""Model predictive control of any Block, in real time: one step of SQP at each sample, or IPOPT.

:mod:`.shooting` writes the problem of a sample, :mod:`.optimizer` solves it; :class:`MPC` keeps the last
solution and runs in loops.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from control import NonlinearIOSystem, TimeResponseData, nlsys
from numpy.typing import ArrayLike, NDArray

from hovercontrol.controllers.optimizer import Memory, Optimizer, Solver
from hovercontrol.controllers.shooting import Stage, transcribe
from hovercontrol.controllers.way_reference import WayReference
from hovercontrol.core.arguments import as_row, at_least, whole_periods
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.functions import numpy_functions
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.tables import positive
from hovercontrol.simulation.given import initial_state
from hovercontrol.simulation.trajectory import time_response

Array = NDArray[np.float64]


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
        self.stage, self.name, self.solver = stage, name, solver
        self._every = np.flatnonzero(weights[0]).tolist()
        self.tracked = tuple(stage.plant.states[i].name for i in self._every)
        names = [s.name for s in stage.plant.states]
        at = names.index(heading) if heading in names else -1
        self._way = None if waypoints is None else WayReference(stage, waypoints, speed, at)
        self.problem = transcribe(stage, horizon, weights, final, self._every)
        self._step = stage.step(stage.period)
        self._optimizer = Optimizer(self.problem, solver, self._step.is_a("SXFunction"))
        self._angles = np.array([stage.plant.states[i].unit == "rad" for i in self._every])
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
        if self._way:
            self._way.reset()

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
        found = self._optimizer.optimum(w, np.r_[x0, memory.u], r.ravel(order="F"))
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
        N = self.problem.horizon
        rows: dict[int, Array] = {}
        r = np.zeros((len(self._every), N + 1))
        if self._way:
            progress, rows = self._way.rows(progress, x0, N)
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
        wanted = [] if self._way else [f"{key}_ref" for key in self.tracked]
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
            Rows of the result in each period; of a sampled plant one for each of its steps.

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
        if truth.period:
            return self._stepped(truth, periods, x0, reference)
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

    def _stepped(
        self,
        truth: Block,
        periods: int,
        x0: Mapping[str, float] | ArrayLike | None,
        reference: Mapping[str, ArrayLike] | None,
    ) -> TimeResponseData:
        """Return the motion of a sampled plant in closed loop: x(k + 1) = f(x(k), u(k)), u from the plan."""
        f = numpy_functions(truth)
        steps = whole_periods(f"{self.name}: period", self.stage.period, truth.period)
        self.reset()
        x: list[Array] = [initial_state(truth, x0)]
        u: list[Array] = []
        for _ in range(periods):
            command = self.control(x[-1], reference)
            for _ in range(steps):
                x.append(f.derivatives(len(u) * truth.period, x[-1], command))
                u.append(command)
        states, inputs = np.array(x).T, np.array([*u, u[-1]]).T
        times = np.arange(float(len(x))) * truth.period
        return time_response(truth, times, f.outputs(times, states, inputs), states, inputs)
