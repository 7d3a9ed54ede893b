"""The steps of many Gymnasium environments over one compiled Block; see :mod:`.gym`.

An environment whose episode has ended is reset by the next step, as in Gymnasium's ``SyncVectorEnv``: that
step ignores its action and gives a reward of 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.engines import checked_solver, engine_of
from hovercontrol.blocks.backends.gym_task import ENDED, REWARD, Task
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.reasons import REASONS, StoppedError

#: Parameter of a Block for many environments: when the episode of each began [s].
BEGIN = "gym.episode.begin"


class ManySteps:
    """What vector environments share, to be joined with ``gymnasium.vector.VectorEnv``.

    Parameters
    ----------
    task : Task
    num_envs : int
    substep : float, optional
        Longest step of the Runge-Kutta method [s].
    """

    def __init__(self, task: Task, num_envs: int, substep: float | None) -> None:
        from gymnasium.vector import AutoresetMode

        self.task, self.num_envs = task, num_envs
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.single_observation_space = task.box(task.observations)
        self.single_action_space = task.box(task.actions)
        self.observation_space = task.box(task.observations, num_envs)
        self.action_space = task.box(task.actions, num_envs)
        self._random = [np.random.default_rng() for _ in range(num_envs)]
        self._steps = np.zeros(num_envs, dtype=int)
        self._done = np.zeros(num_envs, dtype=bool)
        self._names = [s.name for s in task.block.outputs]
        self._y = np.zeros((num_envs, len(self._names)))
        self._started = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode of each environment.

        Parameters
        ----------
        seed : int or sequence of int, optional
            One for each environment; from a single seed s they are s, s + 1, ...
        options : mapping, optional
            ``x0`` and ``params``: initial states by name and parameters by key, the same in all.

        Returns
        -------
        observations : ndarray, shape (num_envs, n_observations)
        info : dict
        """
        from gymnasium.utils.seeding import np_random

        seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, int) else seed
        if seeds is not None and len(seeds) != self.num_envs:
            raise InputError(f"expected {self.num_envs} seeds, found {len(seeds)}")
        for k, each in enumerate(seeds or ()):
            if each is not None:
                self._random[k], _ = np_random(each)
        self._begin(np.arange(self.num_envs), options)
        self._done[:], self._started = False, True
        return self._seen(), {}

    def step(self, actions: Any) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Hold the actions of each environment for one step.

        Parameters
        ----------
        actions : array_like, shape (num_envs, n_actions)

        Returns
        -------
        observations : ndarray, shape (num_envs, n_observations)
        rewards : ndarray, shape (num_envs,)
        terminations, truncations : ndarray of bool, shape (num_envs,)
        info : dict
        """
        task, given = self.task, np.asarray(actions, dtype=float)
        if given.shape != (self.num_envs, len(task.actions)) or not np.isfinite(given).all():
            wanted = (self.num_envs, len(task.actions))
            raise InputError(f"expected finite actions of shape {wanted}, found shape {given.shape}")
        if not self._started:
            raise InputError(task.block.where("the environment needs reset() before its first step"))
        again = self._done.copy()
        stopped = self._advance(given, ~again)
        self._steps += 1
        seen = self._y[:, : len(task.observations)]
        if REWARD in self._names:
            rewards = self._y[:, self._names.index(REWARD)].copy()
        else:
            assert task.reward
            rewards = np.array(task.reward(seen, given), dtype=float)
        if ENDED in self._names:
            ended = self._y[:, self._names.index(ENDED)] > 0.0
        elif task.terminated is not None:
            ended = np.array(task.terminated(seen, given), dtype=bool)
        else:
            ended = np.zeros(self.num_envs, dtype=bool)
        info: dict[str, Any] = {}
        for k, reason in stopped.items():
            ended[k], rewards[k] = True, 0.0
            info.setdefault("stopped", np.full(self.num_envs, None, dtype=object))[k] = reason
        cut = self._steps >= (task.limit or math.inf)
        if again.any():
            self._begin(np.flatnonzero(again), None)
            rewards[again], ended[again], cut[again] = 0.0, False, False
        self._done = ended | cut
        return self._seen(), rewards, ended, cut, info

    def _seen(self) -> Array:
        return self._y[:, : len(self.task.observations)].copy()

    def _begin(self, which: Any, options: Mapping[str, Any] | None) -> None:
        """Start the episodes of some environments."""
        raise NotImplementedError

    def _advance(self, actions: Array, moving: Any) -> dict[int, str]:
        """Step the environments that are `moving`; return why some stop."""
        raise NotImplementedError


class RunnerSteps(ManySteps):
    """Environments of a Block with ticks or delays: each has its own runner."""

    def __init__(self, task: Task, num_envs: int, substep: float | None) -> None:
        super().__init__(task, num_envs, substep)
        self._compiled = task.block.compile()
        self._runs: list[Any] = [None] * num_envs

    def _begin(self, which: Any, options: Mapping[str, Any] | None) -> None:
        task = self.task
        for k in which.tolist():
            x0, params = task.drawn(self._random[k], options)
            self._runs[k] = run = self._compiled.start(x0, params, rtol=task.rtol, atol=task.atol)
            self._y[k], self._steps[k] = run.outputs, 0

    def _advance(self, actions: Array, moving: Any) -> dict[int, str]:
        task, stopped = self.task, {}
        inputs = np.array([s.start for s in task.block.inputs])
        for k in np.flatnonzero(moving).tolist():
            inputs[list(task.places)] = actions[k]
            try:
                self._y[k] = self._runs[k].step(inputs, task.step)
            except StoppedError as error:
                stopped[k] = str(error)
        return stopped


class LaneSteps(ManySteps):
    """Environments of a continuous Block: a step is a sweep over them, in vector instructions."""

    def __init__(self, task: Task, num_envs: int, substep: float | None) -> None:
        super().__init__(task, num_envs, substep)
        self._block = block = _with_parameters(task)
        self._solver = checked_solver("rk4", substep or task.step / 10, task.rtol, task.atol)
        self._engine = engine_of(block, "smooth", True, True)
        own = len(task.block.parameters)
        self._x = np.tile([s.start for s in block.states], (num_envs, 1))
        self._p = np.tile(block.parameter_values(), (num_envs, 1))
        self._acting, self._begun = slice(own, own + len(task.actions)), own + len(task.actions)
        held = np.array([s.start for s in block.inputs])
        self._held = np.repeat(held[:, None], 2, axis=1)
        self._bands = np.zeros(len(block.outputs))
        self._figures = np.zeros((num_envs, len(block.outputs), 5))
        self._status = np.zeros(num_envs, dtype=np.intc)
        self._times = np.array([0.0, task.step])

    def _begin(self, which: Any, options: Mapping[str, Any] | None) -> None:
        task, states = self.task, [s.name for s in self._block.states]
        for k in which.tolist():
            x0, params = task.drawn(self._random[k], options)
            self._x[k] = [x0.get(s.name, s.start) for s in self._block.states]
            if not x0.keys() <= set(states):
                raise InputError(task.block.where(f"x0: unknown states in {sorted(x0)}"))
            self._p[k, : self._acting.start] = task.block.parameter_values(params)
            self._p[k, self._acting] = [s.start for s in task.actions]
            self._p[k, self._begun], self._steps[k] = 0.0, 0
        x, p = self._x[which], self._p[which]
        found = numpy_functions(self._block).array_outputs(0.0, x.T, self._held[:, 0], p.T)
        for column, values in enumerate(found):
            self._y[which, column] = values

    def _advance(self, actions: Array, moving: Any) -> dict[int, str]:
        self._p[:, self._acting] = actions
        self._p[:, self._begun] = self._steps * self.task.step
        last, self._status[:] = np.empty_like(self._x), 0
        results = (self._figures, last, self._status)
        self._engine.sweep(self._solver, self._times, self._held, self._x, self._p, 0.0, self._bands, results)
        fine = self._status == 0
        self._x[fine] = last[fine]
        self._y[fine] = self._figures[fine, :, 0]
        bad = np.flatnonzero(~fine & moving)
        return {k: REASONS[self._status[k]] for k in bad.tolist()}


def _with_parameters(task: Task) -> Block:
    """Return the Block with the actions and the begin of the episode as parameters: they differ by run."""
    block, begin = task.block, Signal(BEGIN, "s")
    names = {s.name for s in task.actions}
    acting = [
        s.replace(name=f"gym.{s.name}") for s in task.actions
    ]  # no parameter of the Block has this name
    swap = {s.symbol: a.symbol for s, a in zip(task.actions, acting, strict=True)}
    moved = block.swapped({**swap, time: time + begin.symbol})
    return block.unchecked(
        inputs=tuple(s for s in block.inputs if s.name not in names),
        parameters=(*block.parameters, *acting, begin),
        **moved,
    )
