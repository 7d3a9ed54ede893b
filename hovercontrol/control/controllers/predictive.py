"""Model predictive control of any Block, in real time: one step of SQP at each sample, or IPOPT.

:mod:`.shooting` writes the problem of a sample, :mod:`.optimizer` solves it; :class:`MPC` keeps the last
solution and runs in loops.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from control import NonlinearIOSystem, nlsys
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import as_row, at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.control.controllers.approach import (
    ControlledResponse,
    passed,
    reference_status,
    way_status,
)
from hovercontrol.control.controllers.closed_loop import Motion
from hovercontrol.control.controllers.optimizer import TOLERANCE, Memory, Optimizer, Solver, UnsolvedError
from hovercontrol.control.controllers.plans import Planner, Sample
from hovercontrol.control.controllers.shooting import Stage, transcribe
from hovercontrol.control.controllers.way_reference import WayReference


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
    way : WayReference, optional
        The reference along waypoints.
    acceptance : float
        Distance within which a waypoint counts as reached [m].
    solver : {"rti", "ipopt"}
    name : str

    Attributes
    ----------
    tracked : tuple of str
        Names of the states with a weight.
    weights, rate_weights : dict of str to float
        Of the states and inputs, and of the changes of inputs, by name [1/unit^2].
    """

    def __init__(
        self,
        stage: Stage,
        horizon: int,
        weights: tuple[Array, Array, Array],
        final: float,
        way: WayReference | None,
        acceptance: float,
        solver: Solver,
        name: str,
    ) -> None:
        self.stage, self.name, self.solver = stage, name, solver
        states, inputs = stage.plant.states, [s.name for s in stage.plant.inputs]
        values = np.concatenate(weights[:2]).tolist()
        self.weights = dict(zip([*(s.name for s in states), *inputs], values, strict=True))
        self.rate_weights = dict(zip(inputs, weights[2].tolist(), strict=True))
        self._every = np.flatnonzero(weights[0]).tolist()
        self._own_weights = weights[0][self._every]
        self.tracked = tuple(states[i].name for i in self._every)
        self._way, self._acceptance = way, acceptance
        self.problem = transcribe(stage, horizon, weights, final, self._every)
        self._step = stage.step(stage.period)
        optimizer = Optimizer(self.problem, solver, self._step.is_a("SXFunction"))
        self._planner = Planner(stage, self.problem, optimizer, weights[1])
        self._units = [states[i].unit for i in self._every]
        self._angles = np.array([unit == "rad" for unit in self._units])
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
        return Memory(np.zeros(self.problem.lbx.size), rest, 0.0, 0, 0)

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
        u, self._memory, note = self._solve(self._memory, x0, self._reference(reference))
        if note:
            self._warn(note)
        return u

    @property
    def failures(self) -> int:
        """Number of samples so far at which the solver failed and the last plan went on."""
        return self._memory.failures

    @property
    def predicted(self) -> dict[str, Array]:
        """The last solution: the states by name, shape (horizon + 1,)."""
        x = self._memory.w[self.problem.states]
        return {s.name: x[:, i] for i, s in enumerate(self.plant.states)}

    def _reference(self, given: Mapping[str, ArrayLike] | None) -> dict[str, Array]:
        known, N = self.tracked, self.problem.horizon
        found = {}
        for key, values in (given or {}).items():
            check_known(key, known, f"{self.name}: reference: no weight on a state {key!r}")
            row = np.atleast_1d(np.asarray(values, dtype=float))
            if row.shape not in ((1,), (N + 1,)) or not np.isfinite(row).all():
                raise InputError(f"{self.name}: reference: {key}: expected 1 or {N + 1} finite numbers")
            found[key] = np.broadcast_to(row, N + 1)
        return found

    # ---- one sample ----------------------------------------------------------------------------------

    def _solve(self, memory: Memory, x0: Array, given: Mapping[str, Array]) -> tuple[Array, Memory, str]:
        """Return the inputs, what is kept, and a note where no new plan was found or the first one rests."""
        progress, r = self._references(memory.progress, x0, given)
        at = Sample(memory.samples, x0, memory.u, r.ravel(order="F"))
        try:
            plan = self._planner.plan(self._shifted(memory, x0), at)
        except UnsolvedError as error:
            raise InputError(f"{self.name}: no plan from the state {x0.tolist()}: {error}") from None
        note = ""
        if plan.fault:
            note = f"no solution at sample {memory.samples}, the best known plan goes on: {plan.fault}"
        elif not (memory.samples or plan.moves):
            note = self._resting(plan.w[self.problem.states][:, self._every].T, r)
        # the solver meets the limits to its tolerance; the command meets them exactly
        fast = self.stage.rate * self.stage.period
        low, high = (
            np.maximum(self.stage.lower, memory.u - fast),
            np.minimum(self.stage.upper, memory.u + fast),
        )
        first = np.clip(plan.w[self.problem.inputs[0]], low, high)
        failures = memory.failures + bool(plan.fault)
        return first, Memory(plan.w, first, progress, memory.samples + 1, failures), note

    def _resting(self, x: Array, r: Array) -> str:
        """Return a note if a plan that holds the inputs brings the plant no nearer to its reference.

        Nearer is ``sum_k |r_k - x_k|_Q^2 < sum_k |r_k - x_0|_Q^2`` for the predicted states x_k.

        Parameters
        ----------
        x, r : ndarray, shape (n_tracked, horizon + 1)
        """
        moving, still = (float(np.sum(self._own_weights @ (r - at) ** 2)) for at in (x, x[:, :1]))
        if moving < still * (1.0 - TOLERANCE) or not still:
            return ""
        return (
            "the first plan holds the inputs: no other within their limits is predicted to cost less, "
            f"though {self._status(np.tile(r[:, -1] - x[:, -1], (4, 1)))}"
        )

    def _shifted(self, memory: Memory, x0: Array) -> Array:
        """Return the previous solution one period later; at first constant inputs."""
        problem = self.problem
        if not memory.samples:
            u = np.tile(memory.u, (problem.horizon, 1))
            return problem.join(np.tile(x0, (problem.horizon + 1, 1)), u, memory.u)
        x, u = memory.w[problem.states], memory.w[problem.inputs]
        u = np.vstack([u[1:], u[-1:]])
        last = np.asarray(self._step(x[-1], u[-1])).ravel()
        return problem.join(np.vstack([x0, x[2:], last]), u, memory.u)

    def _warn(self, text: str) -> None:
        warnings.warn(f"{self.name}: {text}", stacklevel=caller_level())

    def _status(self, errors: Array) -> str:
        return reference_status(errors, self.tracked, self._units, self._own_weights)

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
                memory = Memory(z[:n_w], z[n_w : n_w + m], float(z[-3]), int(z[-2]), int(z[-1]))
                values = zip(wanted, y[len(states) :], strict=True)
                given = {k.removesuffix("_ref"): np.full(self.problem.horizon + 1, v) for k, v in values}
                memory = memory if memory.samples else fresh
                command, after, note = self._solve(memory, y[: len(states)], given)
                if note:
                    self._warn(note)
                last.clear()
                last[key] = command, np.r_[after.w, after.u, after.progress, after.samples, after.failures]
            return last[key]

        return nlsys(
            lambda t, z, y, params: solved(z, y)[1],
            lambda t, z, y, params: solved(z, y)[0],
            inputs=[*states, *wanted],
            outputs=[s.name for s in self.plant.inputs],
            states=n_w + m + 3,
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
    ) -> ControlledResponse:
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
        ControlledResponse
            Outputs, states and inputs of the plant; ``status`` says what was reached, ``waypoints`` how near
            each waypoint was passed, ``failures`` when the solver failed.

        Raises
        ------
        InputError
            If a name, a number or a shape is wrong, or the simulation fails.

        Warns
        -----
        UserWarning
            If a waypoint or the reference is not reached and comes no closer, or the solver failed.
        """
        period = self.stage.period
        periods = at_least(
            f"{self.name}: duration / period", round(positive(f"{self.name}: duration", duration) / period), 1
        )
        at_least(f"{self.name}: rows", rows, 1)
        truth = plant if plant is not None else self.plant
        motion = Motion(f"{self.name}: period", truth, x0, period, rows)
        self.reset()
        given, errors, notes, plans = self._reference(reference), [], {}, []
        for k in range(periods):
            now = motion.state
            command, self._memory, note = self._solve(self._memory, now, given)
            plans.append(self._memory.w[self.problem.states][:, list(self.stage.position)])
            if note:
                notes[k * period] = note
            if not self._way:
                errors.append(self._references(0.0, now, given)[1][:, 0] - now[self._every])
            motion.hold(command)
        found = motion.response()
        found.obstacles, found.plans = np.reshape(self.stage.obstacles, (-1, 3)), np.array(plans)
        self._judge(found, np.array(errors), notes)
        return found

    def _judge(self, run: ControlledResponse, errors: Array, notes: Mapping[float, str]) -> None:
        """Set what a run reached, and warn of what it did not and of failures."""
        first = 0.0 if notes.get(0.0) and not self.failures else None  # the first plan rests
        run.failures = tuple(t for t in notes if t != first)
        run.waypoints = ()
        if self._way:
            time, path = np.asarray(run.time), np.asarray(run.states)[list(self.stage.position)]
            points, speed = self._way.waypoints, self._way.speed
            run.waypoints = passed(time, path, points, self._acceptance)
            run.status = way_status(time, path, run.waypoints, self._acceptance, speed)
        else:
            run.status = self._status(errors)
        if first is not None:
            self._warn(notes[first])
        if run.failures:
            self._warn(
                f"the solver failed at {len(run.failures)} of {self._memory.samples} samples; at "
                f"{run.failures[0]:g} s: {notes[run.failures[0]]}"
            )
        if run.status not in ("reached", "on the way"):
            self._warn(f"{run.status}; other weights, a longer horizon or wider limits may reach it")
