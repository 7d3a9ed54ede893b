"""What a Gymnasium environment asks of a Block, checked; see :mod:`.gym`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import LARGEST_SEED
from hovercontrol.blocks.signals import Signal

Bounds = Mapping[str, tuple[float, float]]
Judge = Callable[[Array, Array], Any]

#: Names of the outputs that an expression for the reward or the end of an episode becomes.
REWARD, ENDED = "gym_reward", "gym_ended"


@dataclass(frozen=True, eq=False)
class Task:
    """What an environment asks of a Block, checked; arguments as for :func:`to_gym`.

    Attributes
    ----------
    block : Block
        Its outputs are the observations, then the reward and the end where they are expressions.
    actions, observations : tuple of Signal
    limit : int
        Maximum number of steps of an episode; 0 for no limit.
    places : tuple of int
        Index of each action among the inputs.
    draws : tuple of (str, bool, float, float)
        What a reset draws: a name, whether it is a state, and its limits.
    reward, terminated : callable or None
        None where an output computes them.
    seeds : tuple of str
        Keys of the parameters that seed random numbers, drawn at each reset.
    """

    block: Block
    actions: tuple[Signal, ...]
    observations: tuple[Signal, ...]
    step: float
    limit: int
    reward: Judge | None
    terminated: Judge | None
    places: tuple[int, ...]
    draws: tuple[tuple[str, bool, float, float], ...]
    seeds: tuple[str, ...]
    params: dict[str, float]
    bounds: dict[str, tuple[float, float]]
    rtol: float
    atol: float

    def box(self, signals: Sequence[Signal], count: int = 0) -> Any:
        """Return the space of some signals within their bounds, for `count` environments if positive."""
        from gymnasium.spaces import Box

        ends = [self.bounds.get(s.name, (s.lower, s.upper)) for s in signals]
        low, high = np.array(ends, dtype=float).reshape(-1, 2).T
        shape = (count, 1) if count else (1,)
        return Box(np.tile(low, shape), np.tile(high, shape), dtype=np.float64)

    def drawn(
        self, random: np.random.Generator, options: Mapping[str, Any] | None
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Return initial states and parameters of an episode, by name and by key."""
        x: dict[str, float] = {}
        p = dict(self.params)
        for name, is_state, low, high in self.draws:
            (x if is_state else p)[name] = float(random.uniform(low, high))
        for key in self.seeds:
            p[key] = float(random.integers(0, LARGEST_SEED))
        given = options or {}
        return {**x, **given.get("x0", {})}, {**p, **given.get("params", {})}


def joined(steps: type, base: type) -> type:
    """Return the class of an environment: Gymnasium's class is known only where Gymnasium is imported."""
    return type("BlockEnv", (steps, base), {"metadata": {**base.metadata}})  # type: ignore[attr-defined]
