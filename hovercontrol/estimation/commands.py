"""Commands as they arrive at the forces: late, lagged. Computed over the whole log, outside any window.

States that depend on nothing but the commands (a motor's lag) are no unknowns of a window: the log tells
them, from rest at its beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.block import Block

Array = NDArray[np.float64]


def input_states(block: Block) -> tuple[int, ...]:
    """Return the indices of the states of lags: named so, of inputs alone, each linear in itself.

    Examples
    --------
    >>> from hovercontrol.effects import effect
    >>> from hovercontrol.vehicles import c17_simulation
    >>> input_states(c17_simulation().with_effects([effect("thrust_lag", seconds=0.1)]).plant())
    (6,)
    """
    return tuple(i for i, _, _ in _laws(block))


@lru_cache(maxsize=256)
def _laws(block: Block) -> tuple[tuple[int, sp.Expr, sp.Expr], ...]:
    """Return index, a and b of each state with ``x' = a x + b``, a of parameters, b of inputs as well."""
    states = {s.symbol for s in block.states}
    parameters = {p.symbol for p in block.parameters}
    found = []
    for i, state in enumerate(block.states):
        if not state.name.endswith("_lagged"):
            continue
        e = block.expand(block.derivatives[state.name])
        if e.free_symbols & states != {state.symbol}:
            continue
        a = sp.diff(e, state.symbol)
        b = e.subs(state.symbol, 0)
        known = parameters | {s.symbol for s in block.inputs}
        if a.free_symbols <= parameters and b.free_symbols <= known and b.free_symbols - parameters:
            found.append((i, a, b))
    return tuple(found)


@lru_cache(maxsize=256)
def _functions(block: Block) -> tuple[tuple[int, Callable[..., float], Callable[..., Array]], ...]:
    """Return index, a and b of :func:`_laws` as functions of parameters, and of parameters and inputs."""
    keys = [p.symbol for p in block.parameters]
    arguments = [keys, [s.symbol for s in block.inputs]]
    return tuple(
        (i, sp.lambdify([keys], a), sp.lambdify(arguments, b, modules="numpy")) for i, a, b in _laws(block)
    )


class Arrival:
    """The commands of one log, each value held from its row to the next; zero before the first.

    Parameters
    ----------
    block : Block
    time : ndarray, shape (n,)
        Seconds from the log's first row.
    inputs : ndarray, shape (n_inputs, n)
    """

    def __init__(self, block: Block, time: Array, inputs: Array) -> None:
        self.time, self.inputs = time, inputs
        steps = np.diff(time, append=time[-1] + 1.0)
        self._integral = np.concatenate(
            [np.zeros((len(inputs), 1)), np.cumsum(inputs * steps, axis=1)], axis=1
        )
        self._knots = np.append(time, time[-1] + 1.0)
        self._laws = _functions(block)

    def mean(self, begin: Array, end: Array, delay: float = 0.0) -> Array:
        """Return the inputs' means from `begin` to `end` [s], shape (n_inputs, ...), late by `delay`."""
        at = [
            np.stack([np.interp(t - delay, self._knots, row, left=0.0) for row in self._integral])
            for t in (begin, end)
        ]
        held = np.maximum(0.0, end - delay - self._knots[-1]) - np.maximum(
            0.0, begin - delay - self._knots[-1]
        )
        extra = self.inputs[:, -1].reshape(-1, *[1] * begin.ndim) * held
        return (at[1] - at[0] + extra) / (end - begin)

    def lagged(self, when: Array, parameters: Sequence[float], delay: float = 0.0) -> dict[int, Array]:
        """Return the input states at times `when` [s], by index; from rest at the beginning."""
        found = {}
        row = np.searchsorted(self.time, when - delay + 1e-9, side="right") - 1
        at = np.maximum(row, 0)
        for i, a_of, b_of in self._laws:
            a = float(a_of(parameters))
            goal = -np.broadcast_to(b_of(parameters, self.inputs), self.time.shape) / a
            fade = np.exp(a * np.diff(self.time)).tolist()
            value, values = 0.0, [0.0]
            for g, f in zip(goal.tolist(), fade, strict=False):
                value = g + (value - g) * f
                values.append(value)
            start = np.array(values)
            later = np.maximum(when - delay - self.time[at], 0.0)  # before the log commands rest
            found[i] = np.where(row < 0, 0.0, goal[at] + (start[at] - goal[at]) * np.exp(a * later))
        return found
