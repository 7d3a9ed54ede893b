"""Check the times, inputs and initial state of a simulation and put them in the Block's order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import HELD


def checked_times(time: ArrayLike) -> Array:
    """Return a time grid, shape (n,); raise if it does not increase strictly."""
    times = np.ascontiguousarray(time, dtype=float)  # C code reads this array
    if times.ndim != 1 or len(times) < 2 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise InputError("time must be two or more finite, increasing numbers")
    return times


def input_rows(block: Block, inputs: Any, times: Array) -> Array:
    """Return all inputs at n times, shape (n_inputs, n); inputs not given have their start values."""
    n = len(times)
    u = np.array([np.full(n, s.start) for s in block.inputs]).reshape(-1, n)
    if inputs is None:
        return u
    names = [s.name for s in block.inputs]
    if isinstance(inputs, Mapping):
        for name, values in inputs.items():
            block.signal(name)
            if name not in names:
                raise InputError(f"block {block.name!r}: {name!r} is not an input")
            u[names.index(name)] = _row(name, values, times)
        return u
    given = np.asarray(inputs, dtype=float)
    if given.ndim == 1 and len(names) == 1 and given.shape == (n,):
        given = given.reshape(1, n)
    if given.ndim == 0 or given.shape[0] != len(names):
        raise InputError(
            f"block {block.name!r}: expected {len(names)} rows of inputs, found shape {given.shape}"
        )
    for k, values in enumerate(given):
        u[k] = _row(names[k], values, times)
    return u


def _row(name: str, values: ArrayLike, times: Array) -> Array:
    row = np.asarray(values, dtype=float)
    if row.shape not in ((), times.shape):
        raise InputError(f"input {name!r}: expected one or {len(times)} values, found shape {row.shape}")
    bad = np.flatnonzero(~np.isfinite(row))
    if bad.size:
        where = f" at t = {times[bad[0]]:.6g} s (row {bad[0]})" if row.ndim else ""
        raise InputError(f"input {name!r}: expected finite values, found {row.flat[bad[0]]}{where}")
    return row


def initial_state(block: Block, x0: Any) -> Array:
    """Return the finite initial state, shape (n_states,); states not given have their start values."""
    start = _given_state(block, x0)
    for signal, value in zip(block.states, start.tolist(), strict=True):
        if not math.isfinite(value):
            raise InputError(f"block {block.name!r}: initial state {signal.name!r} is {value}")
    return start


def own_states(block: Block) -> dict[str, str]:
    """Return the states of a sampled Block by their own names, in its form in continuous time.

    There their names have the Block's in front, and its held outputs are further states
    (:attr:`~hovercontrol.Block.in_continuous_time`). Of other Blocks the states are returned as they are.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> y = Signal("y")
    >>> filter = Block("filter", [y], [], [y], derivatives={"y": y.symbol / 2}, period=0.1)
    >>> own_states(filter.in_continuous_time)
    {'y': 'filter.y'}
    """
    before = f"{block.name}."
    names = (s.name for s in block.states)
    return {name.removeprefix(before): name for name in names if not name.startswith(f"{before}{HELD}")}


def by_state(block: Block, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by the names of the states, given by those, by a sampled Block's own or by last parts."""
    known, own = {s.name for s in block.states}, own_states(block)
    full = {name: name if name in known else own.get(name, block.full_state(name)) for name in values}
    return {full[name]: value for name, value in values.items()}


def _given_state(block: Block, x0: Any) -> Array:
    start = np.array([s.start for s in block.states])
    if x0 is None:
        return start
    names = [s.name for s in block.states]
    if isinstance(x0, Mapping):
        for name, value in by_state(block, x0).items():
            block.signal(name)
            if name not in names:
                raise InputError(f"block {block.name!r}: {name!r} is not a state")
            start[names.index(name)] = value
        return start
    given, own = np.asarray(x0, dtype=float).ravel(), own_states(block)
    if given.size == len(own) < len(names):
        start[[names.index(name) for name in own.values()]] = given
        return start
    if given.shape != start.shape:
        raise InputError(f"block {block.name!r}: expected {start.size} initial states, found {given.size}")
    return given
