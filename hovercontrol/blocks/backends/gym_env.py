"""The steps of one Gymnasium environment over a compiled Block; see :mod:`.gym`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.gym_task import ENDED, Task
from hovercontrol.blocks.simulation.reasons import StoppedError


class SingleSteps:
    """One environment, to be joined with ``gymnasium.Env``.

    Parameters
    ----------
    task : Task
    """

    np_random: np.random.Generator
    render_mode = None

    def __init__(self, task: Task) -> None:
        self.task, self._compiled = task, task.block.compile()
        self.observation_space, self.action_space = task.box(task.observations), task.box(task.actions)
        names = [s.name for s in task.block.outputs]
        self._n, self._given, self._ending = len(task.observations), task.reward, task.terminated
        self._ended = names.index(ENDED) if ENDED in names else 0  # the first outputs are observations
        self._limit = task.limit or math.inf
        self._all = task.places == tuple(range(len(task.block.inputs)))
        self._steps = -1
        self._dt = task.step

    def __reduce__(self) -> tuple[Any, ...]:
        return copied_environment, (self.task,)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode from drawn initial states and parameters.

        Parameters
        ----------
        seed : int, optional
            Of the draws of this episode and later ones.
        options : mapping, optional
            ``x0`` and ``params``: initial states by name and parameters by key.

        Returns
        -------
        observation : ndarray, shape (n_observations,)
        info : dict
        """
        super().reset(seed=seed)  # type: ignore[misc]
        task = self.task
        x0, params = task.drawn(self.np_random, options)
        self._run = self._compiled.start(x0, params, rtol=task.rtol, atol=task.atol)
        self._inputs, self._steps = self._run.inputs, 0
        self._last = self._run.outputs[: self._n]
        return self._last.copy(), {}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold the actions for one step.

        Parameters
        ----------
        action : array_like, shape (n_actions,)

        Returns
        -------
        observation : ndarray, shape (n_observations,)
        reward : float
        terminated, truncated : bool
        info : dict
        """
        if self._steps < 0:
            raise InputError(self.task.block.where("the environment needs reset() before its first step"))
        inputs = action
        if not self._all:
            inputs = self._inputs
            inputs[list(self.task.places)] = action
        self._steps += 1
        try:
            y = self._run.step(inputs, self._dt)
        except StoppedError as stopped:
            return self._last.copy(), 0.0, True, False, {"stopped": str(stopped)}
        seen = self._last = y[: self._n]
        given, ending, ended = self._given, self._ending, False
        reward = float(given(seen, action)) if given else y.item(self._n)
        if ending:
            ended = bool(ending(seen, action))
        elif self._ended:
            ended = y.item(self._ended) > 0.0
        return seen.copy(), reward, ended, self._steps >= self._limit, {}


def copied_environment(task: Task) -> Any:
    """Return an environment again, for copies in other processes."""
    import gymnasium

    from hovercontrol.blocks.backends.gym_task import joined

    return joined(SingleSteps, gymnasium.Env)(task)
