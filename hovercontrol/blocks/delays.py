"""Delayed inputs: how the backends treat a Block's ``delays``.

The state of a pure delay is the whole input over the delay time, so that a finite number of derivatives
cannot describe it. For held inputs a delay is still exact: a delayed step is a step at a later time
(:func:`arrivals`). Simulations use this, and so do exported FMUs, which store the values in transit. For
other backends the Block is changed into one without delays: by a Pade approximation (:func:`pade`), or with
shift registers at its inputs (:func:`registers`).

A delayed input has its start value until the first value arrives; commands of a craft start at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import constant_delay
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.ticks import ROOM

#: Maximum number of different delays in one sweep: each one needs its own input arrays.
MAX_DIFFERENT = 1000

#: Maximum order: beyond it the coefficients of the Pade approximation lose all digits.
MAX_ORDER = 10


class Arrivals(NamedTuple):
    """Held inputs with their delays applied.

    Attributes
    ----------
    times : ndarray, shape (m,)
        The given times and the times at which a delayed input jumps [s].
    inputs : ndarray, shape (n_inputs, m)
        Inputs, held from each time to the next.
    given : ndarray of int, shape (n,)
        Indices of the given times in `times`.
    """

    times: Array
    inputs: Array
    given: NDArray[np.intp]


@lru_cache(maxsize=256)
def undelayed(block: Block) -> Block:
    """Return the Block without its delays: the same equations, with the delayed inputs as its inputs."""
    return block.unchecked(delays=Expressions()) if block.delays else block


@lru_cache(maxsize=64)
def _delays_of(block: Block) -> Callable[..., list[ArrayLike]]:
    found: Callable[..., list[ArrayLike]] = sp.lambdify(
        [[p.symbol for p in block.parameters]], list(block.delays.values())
    )
    return found


def delay_values(block: Block, values: Sequence[float] | Array) -> dict[str, float]:
    """Return the delay of each delayed input [s].

    Parameters
    ----------
    values : sequence of float
        Values of all parameters, in the Block's order.

    Raises
    ------
    InputError
        If a delay is negative or not finite.
    """
    seconds = np.array(_delays_of(block)(list(values)), dtype=float).tolist()
    found: dict[str, float] = dict(zip(block.delays, seconds, strict=True))
    for name, delay in found.items():
        if not 0.0 <= delay < np.inf:
            raise InputError(
                block.where(
                    f"the input {name!r} acts {delay:g} s late ({block.delays[name]}); a delay cannot be "
                    "negative: nothing acts before it is sent"
                )
            )
    return found


def arrivals(block: Block, times: Array, u: Array, values: Sequence[float] | Array) -> Arrivals:
    """Return the inputs of a Block with their delays applied: u_i(t - tau_i).

    Parameters
    ----------
    times : ndarray, shape (n,)
        Increasing times [s].
    u : ndarray, shape (n_inputs, n)
        Inputs before the delay, held from each time to the next.
    values : sequence of float
        Values of all parameters, in order.

    Raises
    ------
    InputError
        If a delay is negative.

    Examples
    --------
    >>> v, a, late = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("late", "s", start=0.25)
    >>> cart = Block("cart", [v], [a], [v], [late], {"v": a.symbol}, delays={"a": late.symbol})
    >>> found = arrivals(cart, np.array([0.0, 1.0, 2.0]), np.array([[3.0, 3.0, 5.0]]), [0.25])
    >>> found.times.tolist(), found.inputs.tolist(), found.given.tolist()
    ([0.0, 0.25, 1.0, 2.0], [[0.0, 3.0, 3.0, 3.0]], [0, 2, 3])
    """
    if not block.delays:
        return Arrivals(times, u, np.arange(len(times)))
    late = delay_values(block, values)
    grid = times
    jumps: dict[str, tuple[Array, Array]] = {}
    for signal, row in zip(block.inputs, u, strict=True):
        if signal.name in late:
            changed = np.flatnonzero(np.diff(row, prepend=signal.start))
            at = times[changed] + late[signal.name]
            at = _beside(grid, at[at <= grid[-1] + ROOM * abs(grid[-1])])
            jumps[signal.name] = at, np.concatenate([[signal.start], row[changed]])
            grid = np.union1d(grid, at)
    held = np.searchsorted(times, grid, side="right") - 1
    rows = [
        jumps[s.name][1][np.searchsorted(jumps[s.name][0], grid, side="right")]
        if s.name in late
        else row[held]
        for s, row in zip(block.inputs, u, strict=True)
    ]
    return Arrivals(grid, np.array(rows).reshape(len(u), -1), np.searchsorted(grid, times))


def arrivals_of_runs(
    block: Block, times: Array, u: Array, values: Array
) -> list[tuple[NDArray[np.intp], Arrivals]]:
    """Return the delayed inputs of many runs, grouped by runs of the same delays.

    Parameters
    ----------
    block, times, u
        As for :func:`arrivals`.
    values : ndarray, shape (n_runs, n_parameters)

    Returns
    -------
    list of (ndarray of int, Arrivals)
        Indices of the runs of a group, and their inputs.

    Raises
    ------
    InputError
        If a delay is negative, or there are more than 1000 different delays.
    """
    if not block.delays or not len(values):
        return [(np.arange(len(values)), arrivals(block, times, u, ()))]
    used = set().union(*(e.free_symbols for e in block.delays.values()))
    columns = [k for k, p in enumerate(block.parameters) if p.symbol in used]
    _, first, group = np.unique(values[:, columns], axis=0, return_index=True, return_inverse=True)
    if len(first) > MAX_DIFFERENT:
        raise InputError(
            block.where(f"{len(first)} different delays in one sweep; at most {MAX_DIFFERENT} are possible")
        )
    return [
        (np.flatnonzero(group.ravel() == k), arrivals(block, times, u, values[run]))
        for k, run in enumerate(first)
    ]


class UnderWay:
    """Input values in transit: sent to delayed inputs but not yet arrived, for stepwise simulation.

    Parameters
    ----------
    late : mapping of str to float
        Delay of each delayed input [s], from :func:`delay_values`.

    Attributes
    ----------
    inputs : list of float
        All inputs with the values that have arrived.

    Examples
    --------
    >>> v, a, late = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("late", "s", start=0.25)
    >>> cart = Block("cart", [v], [a], [v], [late], {"v": a.symbol}, delays={"a": late.symbol})
    >>> sent = UnderWay(cart, {"a": 0.25})
    >>> sent.send(0.0, [3.0])
    >>> sent.next(1.0), sent.arrived(0.2), sent.arrived(0.25)
    (0.25, [0.0], [3.0])
    """

    def __init__(self, block: Block, late: Mapping[str, float]) -> None:
        self.inputs = [s.start for s in block.inputs]
        self._sent = list(self.inputs)
        self._late = {k: late[s.name] for k, s in enumerate(block.inputs) if s.name in late}
        self._ahead: list[tuple[float, int, float]] = []

    def send(self, time: float, inputs: Sequence[float]) -> None:
        """Send all inputs at a time [s]; inputs without a delay arrive at once."""
        for k, value in enumerate(inputs):
            if k not in self._late:
                self.inputs[k] = value
            elif value != self._sent[k]:
                self._ahead = [a for a in self._ahead if a[:2] != (time + self._late[k], k)]
                self._ahead.append((time + self._late[k], k, value))
        self._sent = list(inputs)

    def next(self, until: float) -> float:
        """Return the time of the next arrival [s], at most `until`."""
        room = ROOM * abs(until)
        return min((at for at, _, _ in self._ahead if at < until - room), default=until)

    def arrived(self, time: float) -> list[float]:
        """Return all inputs with the values that have arrived by a time [s]."""
        room = ROOM * abs(time)
        for at, k, value in sorted(self._ahead):
            if at <= time + room:
                self.inputs[k] = value
        self._ahead = [a for a in self._ahead if a[0] > time + room]
        return list(self.inputs)

    def save(self) -> tuple[tuple[Any, ...], ...]:
        """Return the complete state, for :meth:`load`."""
        return tuple(self.inputs), tuple(self._sent), tuple(self._ahead)

    def load(self, saved: tuple[tuple[Any, ...], ...]) -> None:
        """Restore what :meth:`save` returned."""
        self.inputs, self._sent, self._ahead = map(list, saved)


def _beside(grid: Array, at: Array) -> Array:
    """Return times; a time that differs from a grid time only by rounding is replaced by the grid time."""
    after = np.clip(np.searchsorted(grid, at), 1, len(grid) - 1)
    nearest = np.where(at - grid[after - 1] < grid[after] - at, grid[after - 1], grid[after])
    return np.where(np.abs(at - nearest) <= ROOM * np.abs(at), nearest, at)


@lru_cache
def _unit_delay(order: int) -> tuple[Any, Array]:
    """Return ``tau x' = A x + B u(t), u(t - tau) ~ C x`` for a delay of 1 s, and ``x/u`` at rest, -A^-1 B."""
    import control

    unit = control.tf2ss(control.tf(*control.pade(1.0, order, order - 1)))
    return unit, np.linalg.solve(unit.A, -unit.B)[:, 0]


def late_states(block: Block, order: int) -> dict[str, tuple[str, float]]:
    """Return for each state of :func:`pade` its delayed input and its value at rest, per value of the input.

    Examples
    --------
    >>> v, a, late = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("late", "s", start=0.25)
    >>> late_states(Block("cart", [v], [a], [v], [late], {"v": a.symbol}, delays={"a": late.symbol}), 1)
    {'a_late[0]': ('a', 1.0)}
    """
    rest = enumerate(_unit_delay(order)[1].tolist())
    return {f"{name}_late[{k}]": (name, at) for k, at in rest for name in block.delays}


def pade(block: Block, order: int = 4) -> Block:
    """Return the Block with each delay replaced by a Pade approximation.

    exp(-s tau) is approximated by a fraction with n poles and n - 1 zeros (n: `order`). It has no direct
    feedthrough, so that a step of the input does not act at once.

    Parameters
    ----------
    block : Block
        Each delay must be positive.
    order : int, optional
        Number n of states per delayed input, at most 10.

    Returns
    -------
    Block
        Its continuous states are followed by those of the approximation, ``thrust_late[0]``...

    Raises
    ------
    InputError
        If the order is not a whole number from 1 to 10.

    Examples
    --------
    >>> v, a, late = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("late", "s", start=0.25)
    >>> cart = Block("cart", [v], [a], [v], [late], {"v": a.symbol}, delays={"a": late.symbol})
    >>> print(pade(cart, 1).equations())  # a lag of first order
    v' = 1.0*a_late[0]
    a_late[0]' = (1.0*a - 1.0*a_late[0])/late
    """
    if not isinstance(order, int) or not 1 <= order <= MAX_ORDER:
        raise InputError(f"pade: order must be a whole number from 1 to {MAX_ORDER}, found {order!r}")
    unit, rest = _unit_delay(order)
    A, B, C = (sp.Matrix(m.tolist()) for m in (unit.A, unit.B, unit.C))
    states: list[Signal] = []
    rates: dict[str, sp.Expr] = {}
    arriving: dict[sp.Expr, sp.Expr] = {}
    for name, delay in block.delays.items():
        sent = next(s for s in block.inputs if s.name == name)
        text = f"state of the delay of {name}"
        lags = [
            Signal(f"{name}_late[{k}]", sent.unit, text, start=at * sent.start, nominal=sent.nominal)
            for k, at in enumerate(rest.tolist())
        ]
        x = sp.Matrix([s.symbol for s in lags])
        slope = (A * x + B * sent.symbol) / delay
        rates |= {s.name: e for s, e in zip(lags, slope, strict=True)}
        arriving[sent.symbol] = (C * x)[0]
        states += lags
    n = block.n_continuous
    changed = block.swapped(arriving)
    return Block(
        block.name,
        (*block.states[:n], *states, *block.states[n:]),
        block.inputs,
        block.outputs,
        block.parameters,
        {**changed["derivatives"], **rates},
        changed["output_expressions"],
        changed["definitions"],
        block.definition_signals,
        ticks=changed["ticks"],
    )


def registers(block: Block, step: float) -> Block:
    """Return the Block with a shift register at each delayed input.

    The result is exact if inputs change only at multiples of the step. The delays have the default values of
    the Block's parameters; parameters that only occur in delays are not parameters of the result.

    Parameters
    ----------
    step : float
        Step of the registers [s]; each delay must be a multiple of it.

    Returns
    -------
    Block
        Hybrid. Its states are named ``plant.u``, those of the registers ``delay_thrust.thrust_stage1``.

    Raises
    ------
    InputError
        If a delay is not a multiple of the step (the message gives the nearest ones), or a delayed input is
        also an output.
    """
    groups: dict[float, list[Signal]] = {}
    late = delay_values(block, block.parameter_values())
    for name, delay in late.items():
        groups.setdefault(delay, []).append(next(s for s in block.inputs if s.name == name))
        if name in {s.name for s in block.outputs}:
            raise InputError(block.where(f"{name!r} is a late input and an output: rename the output"))
    links = [
        constant_delay(signals, delay, step, suffix="_late", name=f"delay_{signals[0].name}")
        for delay, signals in groups.items()
    ]
    kept = {symbol for _, e in block.all_expressions() for symbol in e.free_symbols}
    gone = {symbol for e in block.delays.values() for symbol in e.free_symbols} - kept
    plain = undelayed(block).unchecked(parameters=tuple(p for p in block.parameters if p.symbol not in gone))
    return interconnect(
        [rename(plain, {name: f"{name}_late" for name in late}), *links],
        block.name,
        inputs=[s.name for s in block.inputs],
        outputs=[s.name for s in block.outputs],
    )
