"""Blocks before and after an FMU, over the rows of a log.

States of such a Block follow from its inputs alone (:func:`hovercontrol.blocks.backends.follow.follow`). They
begin where the first row's inputs, held for long, would have brought them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.follow import follow
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed

#: The settling before the first row: number of steps, and ratio of each to the one before. The first is a
#: mean time between rows; 48 steps are 29 000 of these.
SETTLING, GROWTH = 48, 1.2
#: Parts of an interval over which the mean of a signal that is linear in it is held.
PARTS = 4


def through(block: Block, parameters: Sequence[float], time: Array, u: Array, *, held: bool) -> Array:
    """Return the outputs of a Block at the rows, shape (K, n_outputs).

    Parameters
    ----------
    block : Block
        Continuous; its delays are computed here.
    parameters : sequence of float
        Values of all its parameters, in order.
    time : ndarray, shape (K,)
        [s]
    u : ndarray, shape (K, n_inputs)
    held : bool
        Whether the inputs are held from row to row; otherwise they are interpolated.
    """
    late = delay_of(block, parameters)
    block = _prompt(block)
    if late:
        u = held_late(time, u, late) if held else interpolated_late(time, u, late)
    x = _states(block, time, u, parameters) if held else _between(block, time, u, parameters)
    with np.errstate(all="ignore"):
        found = block.to_numpy().array_outputs(time, x, u.T, parameters)
    return np.stack([np.broadcast_to(y, time.shape) for y in found], axis=1).astype(float)


def driven(
    block: Block, parameters: Sequence[float], time: Array, u: Array, fine: int
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return what a continuous system gets through a Block before it, held over short intervals.

    Inputs that act late change at the times at which they arrive; those are added to the grid. The outputs of
    a Block with states change between the rows: each interval is divided, and the output in the middle of
    each part is held over it, which errs with the square of its length.

    Parameters
    ----------
    block : Block
    parameters : sequence of float
        Values of all its parameters, in order.
    time : ndarray, shape (K,)
        [s]
    u : ndarray, shape (K, n_inputs)
        Held from row to row.
    fine : int
        Parts of an interval, for a Block with states.

    Returns
    -------
    grid : ndarray, shape (M,)
        [s]
    given : ndarray, shape (M, n_outputs)
    places : ndarray of int, shape (K,)
        Of the rows in the grid.
    """
    late, block = delay_of(block, parameters), _prompt(block)
    grid = time
    if late:
        changed = np.flatnonzero((u[1:] != u[:-1]).any(axis=1)) + 1
        arrivals = time[changed] + late
        grid = np.union1d(time, arrivals[arrivals < time[-1]])
        u = u[np.append(0, changed)[np.searchsorted(arrivals, grid, side="right")]]
    if not block.states:
        return grid, through(block, parameters, grid, u, held=True), np.searchsorted(grid, time)
    at = np.arange(2 * fine * (len(grid) - 1) + 1) / (2 * fine)
    halves = np.interp(at, np.arange(len(grid)), grid)
    held = np.repeat(u, 2 * fine, axis=0)[: len(halves)]
    found = through(block, parameters, halves, held, held=True)
    given = np.vstack([found[1::2], found[-1:]])
    return halves[::2], given, fine * np.searchsorted(grid, time)


def delay_of(block: Block, parameters: Sequence[float]) -> float:
    """Return how late a Block's inputs act [s]; all by the same time."""
    if not block.delays:
        return 0.0
    values = dict(zip((s.symbol for s in block.parameters), parameters, strict=True))
    return float(next(iter(block.delays.values())).xreplace(values))


def held_late(time: Array, u: Array, late: float) -> Array:
    """Return inputs that act late: means over each interval of the held input, shifted.

    ``v_k = (U(t_{k+1} - d) - U(t_k - d)) / (t_{k+1} - t_k)``, U the integral of the held input. Unlike values
    shifted by whole rows, these depend smoothly on the delay d.
    """
    step = np.diff(time)
    step = np.append(step, step[-1] if len(step) else 1.0)
    ends = np.append(time, time[-1] + step[-1])
    integral = np.vstack([np.zeros(u.shape[1]), np.cumsum(u * step[:, None], axis=0)])
    at = ends - late
    found = np.empty_like(u, dtype=float)
    for i in range(u.shape[1]):
        values = np.interp(at, ends, integral[:, i])
        values += np.minimum(at - ends[0], 0.0) * u[0, i] + np.maximum(at - ends[-1], 0.0) * u[-1, i]
        found[:, i] = np.diff(values) / step
    return found


def interpolated_late(time: Array, y: Array, late: float) -> Array:
    """Return signals that are late, interpolated between the rows."""
    return np.stack([np.interp(time - late, time, column) for column in y.T], axis=1)


def _between(block: Block, time: Array, u: Array, parameters: Sequence[float]) -> Array:
    """Return the states at the rows for inputs that are linear in between: held over short parts."""
    if not block.states or len(time) < 2:
        return _states(block, time, u, parameters)
    rows = np.arange(len(time))
    at = np.arange(PARTS * rows[-1] + 1) / PARTS
    inputs = np.stack([np.interp(at, rows, column) for column in u.T], axis=1)
    found = _states(block, np.interp(at, rows, time), _means(inputs), parameters, u[0])
    return found[:, ::PARTS]


def _means(u: Array) -> Array:
    """Return the mean of interpolated inputs over the interval after each row."""
    return np.asarray(0.5 * (u + np.vstack([u[1:], u[-1:]])))


@lru_cache(maxsize=64)
def _prompt(block: Block) -> Block:
    return undelayed(block) if block.delays else block


def _states(
    block: Block, time: Array, u: Array, parameters: Sequence[float], first: Array | None = None
) -> Array:
    """Return the states at the rows, shape (n_states, K); before the first row the inputs were `first`."""
    n, K = len(block.states), len(time)
    if not n or K < 2:
        return np.zeros((n, K))
    mean = float(time[-1] - time[0]) / (K - 1)
    settle = mean * GROWTH ** np.arange(SETTLING)
    step = np.concatenate([settle, np.diff(time)])[:, None]
    begin = np.concatenate([np.full(SETTLING, time[0]), time[:-1]])[:, None]
    inputs = np.concatenate([np.repeat(u[:1] if first is None else first[None], SETTLING, axis=0), u[:-1]]).T[
        :, :, None
    ]
    empty = np.zeros((n, len(step), 1))
    values = follow(block, list(range(n)), begin, step, empty, inputs, parameters)
    return np.asarray(values[:, SETTLING:, 0])
