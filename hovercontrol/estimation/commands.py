"""Commands as they arrive at the forces: late, lagged, with play. Computed over the whole log from rest.

States that depend on nothing but the commands (a motor's lag, a gear's play) are no unknowns of a filter: the
log tells them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from hovercontrol.core.block import Block
from hovercontrol.core.sgn import regularise
from hovercontrol.estimation.measure import Measured
from hovercontrol.targets.follow import follow

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArrivalCriteria:
    """When rows of a log are missing.

    No published source: set by hand, exercised by tests/estimation/test_commands.py.

    Attributes
    ----------
    missing : float
        Time step, relative to the usual one, from which on a row is missing.
    """

    missing: float = 1.5


#: The values in use.
ARRIVALS = ArrivalCriteria()


#: Ends of the steps that laws which are not linear take from row to row, in parts of it: play takes up a
#: new command at once, a limited rate takes its time.
STEPS = (0.05, 0.2, 0.4, 0.6, 0.8, 1.0)


@dataclass(frozen=True, eq=False)
class _Laws:
    """How states follow from commands: a and b of ``x' = a x + b`` where that is so for all."""

    indices: tuple[int, ...]
    linear: tuple[tuple[Callable[..., float], Callable[..., Array]], ...]


@lru_cache(maxsize=500)
def input_states(block: Block, motion: tuple[str, ...]) -> tuple[int, ...]:
    """Return the indices of the states that follow from inputs, parameters and time alone, in order of need.

    Parameters
    ----------
    block : Block
    motion : tuple of str
        States that are no part of the commands' way, whatever they follow from.

    Examples
    --------
    >>> from hovercontrol.effects import effect
    >>> from hovercontrol.models.vehicles import c17_simulation
    >>> plant = c17_simulation().with_effects([effect("thrust_lag", seconds=0.1)]).plant()
    >>> input_states(plant, ("x", "y", "psi", "u", "v", "r"))
    (6,)
    """
    states = {s.symbol: i for i, s in enumerate(block.states)}
    inputs = {s.symbol for s in block.inputs}
    needs = {i: block.expand(block.derivatives[s.name]).free_symbols for i, s in enumerate(block.states)}
    found: list[int] = []
    while True:
        ready = [
            i
            for i, symbols in needs.items()
            if i not in found
            and block.states[i].name not in motion
            and {states[s] for s in symbols if s in states} - {i} <= set(found)
            and (symbols & inputs or any(block.states[k].symbol in symbols for k in found))
        ]
        if not ready:
            return tuple(found)
        found += ready


@lru_cache(maxsize=500)
def _laws(block: Block, motion: tuple[str, ...]) -> _Laws | None:
    keys = [p.symbol for p in block.parameters]
    driven = input_states(block, motion)
    if not driven:
        return None
    states = [block.states[i].symbol for i in driven]
    inputs = [s.symbol for s in block.inputs]
    rates = [regularise(block.expand(block.derivatives[block.states[i].name])) for i in driven]
    slopes = [sp.diff(e, x) for e, x in zip(rates, states, strict=True)]
    linear = []
    for e, a, x in zip(rates, slopes, states, strict=True):
        b = e.subs(x, 0)
        if not (a.free_symbols <= set(keys) and a != 0 and b.free_symbols <= {*keys, *inputs}):
            break
        linear.append((sp.lambdify([keys], a), sp.lambdify([keys, inputs], b, modules="numpy")))
    return _Laws(driven, tuple(linear) if len(linear) == len(driven) else ())


def command_times(log: Measured) -> tuple[Array, Array]:
    """Return when the commands of each row began to hold, and how sure that is [s].

    That is the time of the row. Where rows are missing before a row with a new command, it changed at any
    time since the row before: at the middle on average, with a uniform distribution's standard deviation.
    """
    time, std = log.time.copy(), np.zeros(log.time.size)
    sampled = log.sampled
    usual = float(np.median(np.diff(log.time[sampled]))) if sampled.sum() > 1 else 0.0
    step = np.diff(log.time)
    changed = (np.diff(log.inputs, axis=1) != 0).any(axis=0)
    late = step > ARRIVALS.missing * usual
    unsure = np.flatnonzero(changed & sampled[1:] & late)
    time[unsure + 1] -= 0.5 * step[unsure]
    std[unsure + 1] = step[unsure] / math.sqrt(12.0)
    return time, std


def divided(pieces: int, part: Array) -> tuple[Array, Array]:
    """Return begins and lengths of pieces of steps, in parts of a step, both of shape (pieces, N).

    Parameters
    ----------
    pieces : int
    part : ndarray, shape (N,)
        Where two pieces meet, in parts of the step; NaN: anywhere.

    Examples
    --------
    >>> divided(3, np.array([0.25]))[0][:, 0].tolist()
    [0.0, 0.25, 0.625]
    """
    s = np.arange(pieces)[:, None]
    before = np.clip(np.rint(np.nan_to_num(part) * pieces), 1, max(pieces - 1, 1))
    part = np.where(np.isfinite(part) & (pieces > 1), part, before / pieces)
    first, second = part / before, (1.0 - part) / np.maximum(pieces - before, 1)
    return np.where(s < before, s * first, part + (s - before) * second), np.where(s < before, first, second)


class Arrival:
    """The commands of one log, each value held from its row to the next; zero before the first.

    Parameters
    ----------
    block : Block
    time : ndarray, shape (n,)
        Seconds from the log's first row.
    inputs : ndarray, shape (n_inputs, n)
    motion : tuple of str
        As for :func:`input_states`.
    """

    def __init__(self, block: Block, time: Array, inputs: Array, motion: tuple[str, ...]) -> None:
        self.block, self.time, self.inputs = block, time, inputs
        steps = np.diff(time, append=time[-1] + 1.0)
        self._integral = np.concatenate(
            [np.zeros((len(inputs), 1)), np.cumsum(inputs * steps, axis=1)], axis=1
        )
        self._knots = np.append(time, time[-1] + 1.0)
        changes = np.abs(np.diff(inputs, axis=1, prepend=0.0))
        widest = np.maximum(np.ptp(inputs, axis=1, keepdims=True), 1e-300)
        change = (changes / widest).sum(axis=0)
        self._changes, self._sizes = time[change > 0], change[change > 0]
        self._laws = _laws(block, motion)

    def at(self, when: Array, delay: float = 0.0) -> Array:
        """Return the inputs that hold at times `when` [s], late by `delay`, shape (n_inputs, ...)."""
        row = np.searchsorted(self.time, when - delay + 1e-9, side="right") - 1
        return np.where(row >= 0, self.inputs[:, np.maximum(row, 0)], 0.0)

    def mean(self, begin: Array, end: Array, delay: float = 0.0) -> Array:
        """Return the inputs' means from `begin` to `end` [s], shape (n_inputs, ...), late by `delay`."""
        at = [
            np.stack([np.interp(t - delay, self._knots, row, left=0.0) for row in self._integral])
            if len(self._integral)
            else np.empty((0, *begin.shape))
            for t in (begin, end)
        ]
        held = np.maximum(0.0, end - delay - self._knots[-1]) - np.maximum(
            0.0, begin - delay - self._knots[-1]
        )
        extra = self.inputs[:, -1].reshape(-1, *[1] * begin.ndim) * held
        return (at[1] - at[0] + extra) / (end - begin)

    def largest_change(self, begin: Array, length: Array, delay: float, most: int) -> Array:
        """Return when commands change most within steps, in parts of each; NaN where they do not.

        Parameters
        ----------
        begin, length : ndarray, shape (N,)
            Of the steps [s].
        delay : float
            By which commands are late [s].
        most : int
            Where there are more changes within a step, none of them counts.
        """
        margin = 1e-6 * length
        first = np.searchsorted(self._changes, begin + margin - delay, side="right")
        count = np.searchsorted(self._changes, begin + length - margin - delay, side="left") - first
        largest, found = np.zeros(begin.shape), np.full(begin.shape, np.nan)
        for k in range(min(int(count.max(initial=0)), most)):
            own = np.flatnonzero((k < count) & (count <= most))
            at = first[own] + k
            larger = self._sizes[at] > largest[own]
            own, at = own[larger], at[larger]
            largest[own] = self._sizes[at]
            found[own] = (self._changes[at] + delay - begin[own]) / length[own]
        return found

    def lagged(self, when: Array, parameters: Sequence[float], delay: float = 0.0) -> dict[int, Array]:
        """Return the input states at times `when` [s], by index; from rest at the beginning."""
        laws = self._laws
        if laws is None:
            return {}
        row = np.searchsorted(self.time, when - delay + 1e-9, side="right") - 1
        at = np.maximum(row, 0)
        if not laws.linear:
            times, states = self._stepped(laws, parameters)
            found = [np.interp(when - delay, times, own) for own in states]
        else:
            later = np.maximum(when - delay - self.time[at], 0.0)  # before the log commands rest
            found = [self._followed(a_of, b_of, parameters, at, later) for a_of, b_of in laws.linear]
        return {i: np.where(row < 0, 0.0, own) for i, own in zip(laws.indices, found, strict=True)}

    def _followed(
        self,
        a_of: Callable[..., float],
        b_of: Callable[..., Array],
        parameters: Sequence[float],
        at: NDArray[np.intp],
        later: Array,
    ) -> Array:
        """Return a state of ``x' = a x + b`` so much later than rows `at`, exactly."""
        a = float(a_of(parameters))
        goal = -np.broadcast_to(b_of(parameters, self.inputs), self.time.shape) / a
        fade = np.exp(a * np.diff(self.time))
        bands = np.stack([np.ones(goal.size), np.append(-fade, 0.0)])  # next value - fade * value = arriving
        start = solve_banded((1, 0), bands, np.append(0.0, (1.0 - fade) * goal[:-1]), check_finite=False)
        return np.asarray(goal[at] + (start[at] - goal[at]) * np.exp(a * later))

    def _stepped(self, laws: _Laws, parameters: Sequence[float]) -> tuple[Array, Array]:
        """Return times, shape (m,), and the states at them, shape (n, m)."""
        parts, steps = np.diff(STEPS, prepend=0.0), np.diff(self.time)[:, None]
        h = (steps * parts).reshape(-1, 1)
        ends = (self.time[:-1, None] + steps * np.array(STEPS)).reshape(-1, 1)
        held = np.repeat(self.inputs[:, :-1], len(STEPS), axis=1)[..., None]
        rest = np.zeros((len(self.block.states), *h.shape))
        values = follow(self.block, laws.indices, ends - 0.5 * h, h, rest, held, parameters)
        return np.append(self.time[0], ends), values[..., 0]
