"""Simulate a sampled Block alone: tick by tick, or over given inputs with many runs at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.functions import FunctionPair, call_scalar, numpy_functions
from hovercontrol.blocks.signals import Signal


class RunningFilter(Protocol):
    """Several runs of a sampled filter not written as equations, such as a particle filter."""

    def tick(self, inputs: Array, span: float, outputs: Sequence[str]) -> Array:
        """Return the chosen outputs, shape (n_outputs, runs), for a tick's inputs, shape (n_inputs, runs)."""


class SampledFilter(Protocol):
    """A sampled filter not written as equations; it has signals like a Block and starts its own runs."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def period(self) -> float:
        """Time between two ticks [s]."""

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Signals read at a tick."""

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Signals computed at a tick."""

    @property
    def states(self) -> tuple[Signal, ...]:
        """States whose initial values can be set."""

    def start(self, runs: int = 1, start: Mapping[str, ArrayLike] | None = None) -> RunningFilter:
        """Start `runs` runs; states not given in `start` have their start values."""


class Ticking:
    """A sampled Block simulated tick by tick.

    Parameters
    ----------
    block : Block
        Sampled, or without states.
    params : mapping, optional
        Parameter values by key; others have their defaults.

    Attributes
    ----------
    state : tuple of float
        The present states, in the Block's order.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> n = Signal("n")
    >>> counter = Ticking(Block("counter", [n], [], [n], derivatives={"n": n.symbol + 1}, period=0.1))
    >>> [counter.tick(0.1 * k, {})["n"] for k in range(3)]
    [0.0, 1.0, 2.0]
    """

    def __init__(self, block: Block, params: Mapping[str, float] | None = None) -> None:
        self.block = block
        self.state = tuple(s.start for s in block.states)
        self._values = block.parameter_values(params)
        self._inputs = [s.name for s in block.inputs]
        self._names = [s.name for s in block.outputs]
        self._tick = one_tick(block, self._names)

    def set_parameters(self, params: Mapping[str, float]) -> None:
        """Use other parameter values, by key, from now on; parameters not given have their defaults."""
        self._values = self.block.parameter_values(params)

    def tick(self, time: float, signals: Mapping[str, float]) -> dict[str, float]:
        """Return the outputs at a tick and update the state.

        Parameters
        ----------
        time : float
            Time of the tick [s].
        signals : mapping
            At least the Block's inputs, by name.
        """
        seen = [signals[name] for name in self._inputs]
        found = call_scalar(self._tick, time, self.state, seen, self._values)
        n = len(self._names)
        self.state = found[n:]
        return dict(zip(self._names, found[:n], strict=True))


@checked
def simulate_runs(
    block: Block | SampledFilter,
    inputs: Mapping[str, ArrayLike],
    outputs: Sequence[str] | None = None,
    *,
    start: Mapping[str, ArrayLike] | None = None,
    params: Mapping[str, float] | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Run a sampled Block, or a particle filter, many times at once, each run with its own inputs.

    Parameters
    ----------
    block : Block or SampledFilter
    inputs : mapping of str to array_like, shape (ticks,) or (ticks, runs)
        Values of every input of the Block.
    outputs : sequence of str, optional
        Outputs to return (default: all).
    start : mapping of str to array_like, shape () or (runs,), optional
        Initial states; states not given have their start values.
    params : mapping, optional
        Parameter values by key; not for a particle filter, whose values are set at its construction.

    Returns
    -------
    dict of str to ndarray, shape (ticks, runs)

    Raises
    ------
    InputError
        If the Block is not sampled, an input is missing or its shape does not match, or a name is unknown.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> n, by = Signal("n"), Signal("by")
    >>> counter = Block("counter", [n], [by], [n], derivatives={"n": n.symbol + by.symbol}, period=0.1)
    >>> simulate_runs(counter, {"by": [[1, 2], [1, 2], [1, 2]]})["n"][-1]
    array([2., 4.])
    """
    if not block.period:
        raise InputError(f"simulate_runs: block {block.name!r} is not sampled")
    wanted = [s.name for s in block.outputs] if outputs is None else list(outputs)
    _check_names(block, "output", wanted, [s.name for s in block.outputs])
    names = [s.name for s in block.inputs]
    _check_names(block, "input", inputs, names)
    given = _rows_of_runs(block.name, names, inputs)
    ticks, _, count = given.shape
    _check_names(block, "state", start or {}, [s.name for s in block.states])
    found = np.empty((ticks, len(wanted), count))
    if not isinstance(block, Block):
        if params:
            raise InputError(f"block {block.name!r}: a particle filter's values are given where it is made")
        particles = block.start(count, start)
        for k in range(ticks):
            found[k] = particles.tick(given[k], block.period, wanted)
        return {name: found[:, j] for j, name in enumerate(wanted)}
    begin = {s.name: s.start for s in block.states} | dict(start or {})
    state = np.array([np.broadcast_to(value, count) for value in begin.values()], dtype=float)
    state = state.reshape(len(block.states), count)
    values = block.parameter_values(params)
    step = one_tick(block, wanted)[1]
    for k in range(ticks):
        told = step(k * block.period, state, given[k], values)
        state = np.empty_like(state)  # the results may be views of rows of the old state
        for j, value in enumerate(told):
            if j < len(wanted):
                found[k, j] = value
            else:
                state[j - len(wanted)] = value
    return {name: found[:, j] for j, name in enumerate(wanted)}


def _rows_of_runs(block: str, names: Sequence[str], inputs: Mapping[str, ArrayLike]) -> Array:
    """Return the inputs as one array, shape (ticks, inputs, runs)."""
    for name in names:
        if name not in inputs:
            raise InputError(f"block {block!r}: no values for input {name!r}")
    columns = {name: np.asarray(inputs[name], dtype=float) for name in names}
    columns = {name: c[:, None] if c.ndim == 1 else c for name, c in columns.items()}
    try:
        ticks, count = np.broadcast_shapes(*(c.shape for c in columns.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {c.shape}" for name, c in columns.items())
        raise InputError(f"block {block!r}: inputs differ in shape (ticks, runs): {shapes}") from None
    return np.stack([np.broadcast_to(c, (ticks, count)) for c in columns.values()], axis=1)


def one_tick(block: Block, outputs: Sequence[str]) -> FunctionPair:
    """Return the function of one tick: the chosen outputs, then the states' next values, in one tuple.

    One function computes both because in a filter they share most subexpressions.
    """
    told = [(name, block.output_expressions[name]) for name in outputs]
    taken = [(f"next {name}", e) for name, e in block.derivatives.items()]
    return numpy_functions(block.unchecked(output_expressions=Expressions(told + taken))).scalar_pair(
        "outputs"
    )


def _check_names(block: Block | SampledFilter, kind: str, found: Iterable[str], known: Sequence[str]) -> None:
    for name in found:
        check_known(name, known, f"block {block.name!r}: no {kind} {name!r}")
