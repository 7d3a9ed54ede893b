"""Commands as they act on the forces, with delay, lag and play, computed over the whole log from rest.

States that depend on the commands alone (a motor's lag, a gear's play) follow from the log. The filter does
not estimate them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from scipy.linalg import solve_banded

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.follow import follow
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import regularise
from hovercontrol.identification.engine.measure import Measured

#: Number of sets of parameters for which the input states of a log are cached.
HELD = 2

#: Fraction of a command's range below which a change counts as rounding error.
ROUNDING = 1e-8


@dataclass(frozen=True)
class ArrivalCriteria:
    """When rows of a log are missing.

    No published source: set by hand, exercised by tests/identification/engine/test_commands.py.

    Attributes
    ----------
    missing : float
        Time step, relative to the median one, above which a row counts as missing.
    """

    missing: float = 1.5


#: The values in use.
ARRIVALS = ArrivalCriteria()


#: Sub-steps from row to row for nonlinear laws. FIRST sub-steps cover the first SECONDS[0] (at most half of
#: the step) [s], because play takes up a new command at once. Later ones are SECONDS[1] long [s], at most
#: MOST_STEPS of them.
FIRST, SECONDS, MOST_STEPS = 16, (4e-3, 1e-3), 256


@dataclass(frozen=True, eq=False)
class _Laws:
    """Laws by which states follow from commands: a and b of ``x' = a x + b`` if all are linear, else none.

    `uses` are the indices of the parameters that they contain.
    """

    indices: tuple[int, ...]
    linear: tuple[tuple[Callable[..., float], Callable[..., Array]], ...]
    uses: tuple[int, ...]


@lru_cache(maxsize=500)
def input_states(block: Block, motion: tuple[str, ...]) -> tuple[int, ...]:
    """Return the indices of the states that follow from inputs, parameters and time alone.

    Each state comes after those on which it depends.

    Parameters
    ----------
    motion : tuple of str
        States of the motion. They are excluded even if they depend on the inputs alone.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
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
    symbols = set().union(*(e.free_symbols for e in rates))
    uses = tuple(i for i, key in enumerate(keys) if key in symbols)
    return _Laws(driven, tuple(linear) if len(linear) == len(driven) else (), uses)


def command_times(log: Measured) -> tuple[Array, Array]:
    """Return the time at which the commands of each row begin to hold, and its standard deviation [s].

    Usually this is the time of the row, with standard deviation zero. If rows are missing before a row with a
    new command, the command changed at an unknown time since the previous row. That time is assumed to be
    uniformly distributed. The commands of the first row of a trial hold from that row on.
    """
    # Uniform distribution over the step h before the row: mean h/2 before it, standard deviation h/sqrt(12)
    time, std = log.time.copy(), np.zeros(log.time.size)
    sampled = log.sampled
    usual = float(np.median(np.diff(log.time[sampled]))) if sampled.sum() > 1 else 0.0
    step = np.diff(log.time)
    changed = changes(log.inputs)[1:] > 0.0
    late = step > ARRIVALS.missing * usual
    late[[start - 1 for start in log.starts]] = False
    unsure = np.flatnonzero(changed & sampled[1:] & late)
    time[unsure + 1] -= 0.5 * step[unsure]
    std[unsure + 1] = step[unsure] / math.sqrt(12.0)
    return time, std


def by_trial(log: Measured, time: Array) -> tuple[Array, Array]:
    """Return times and commands of a log, shapes (m,) and (n_inputs, m); zero in pauses between trials.

    A trial that begins in motion has its first commands in the pause before it, the first one for as long as
    the log lasts.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time at which the commands of each row begin to hold [s].
    """
    usual = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    pauses = [start for start in log.starts if time[start] - time[start - 1] > 2.0 * usual]
    times, inputs = time, log.inputs
    if pauses:
        ends = time[[start - 1 for start in pauses]] + usual
        held = inputs[:, pauses] * np.isin(pauses, log.moving)
        times, inputs = np.insert(time, pauses, ends), np.insert(inputs, pauses, held, axis=1)
    if 0 in log.moving:
        begin = 2.0 * time[0] - time[-1]
        times, inputs = np.insert(times, 0, begin), np.insert(inputs, 0, inputs[:, 0], axis=1)
    return times, inputs


def divided(pieces: int, part: Array) -> tuple[Array, Array]:
    """Return begins and lengths of the sub-steps of steps, as fractions of a step; both (pieces, N).

    Parameters
    ----------
    pieces : int
        Number of sub-steps.
    part : ndarray, shape (N,)
        Fraction of the step at which two sub-steps must meet; NaN: no such point.

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


def changes(inputs: Array) -> Array:
    """Return the change of the commands at each row, relative to their ranges and summed, shape (n,).

    A change below ``ROUNDING`` counts as zero. Before the first row, commands are zero.

    Parameters
    ----------
    inputs : ndarray, shape (n_inputs, n)

    Examples
    --------
    >>> changes(np.array([[0.0, 2.0, 2.0 - 1e-12, 0.0]])).round(6).tolist()
    [0.0, 1.0, 0.0, 1.0]
    """
    widest = np.maximum(np.ptp(inputs, axis=1, keepdims=True), 1e-300)
    sizes = np.abs(np.diff(inputs, axis=1, prepend=0.0)) / widest
    return np.asarray(np.where(sizes > ROUNDING, sizes, 0.0).sum(axis=0))


class Arrival:
    """The commands of one log, each value held from its row to the next; zero before the first row.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time since the first row of the log [s].
    inputs : ndarray, shape (n_inputs, n)
    motion : tuple of str
        As for :func:`input_states`.
    tempo : float, optional
        By which lengths of time are multiplied.
    """

    def __init__(
        self, block: Block, time: Array, inputs: Array, motion: tuple[str, ...], tempo: float = 1.0
    ) -> None:
        self.time, self.inputs, self._tempo = time, inputs, tempo
        steps = np.diff(time, append=time[-1] + 1.0)
        self._integral = np.concatenate(
            [np.zeros((len(inputs), 1)), np.cumsum(inputs * steps, axis=1)], axis=1
        )
        self._knots = np.append(time, time[-1] + 1.0)
        change = changes(inputs)
        self._changes, self._sizes = time[change > 0], change[change > 0]
        self._take(block, motion)

    def _take(self, block: Block, motion: tuple[str, ...]) -> None:
        self.block, self._laws = block, _laws(block, motion)
        self._courses: dict[tuple[float, ...], list[Callable[[Array], tuple[Array, Array]]]] = {}

    def of(self, block: Block, motion: tuple[str, ...]) -> Arrival:
        """Return the same commands as inputs of another Block."""
        other = copy(self)
        other._take(block, motion)
        return other

    def numbers(self, parameters: Sequence[float]) -> tuple[float, ...]:
        """Return the parameters on which the input states depend."""
        return tuple(parameters[i] for i in self._laws.uses) if self._laws else ()

    def at(self, when: Array, delay: float = 0.0) -> Array:
        """Return the inputs at times `when` [s], delayed by `delay` [s], shape (n_inputs, ...)."""
        row = np.searchsorted(self.time, when - delay + 1e-9 * self._tempo, side="right") - 1
        return np.where(row >= 0, self.inputs[:, np.maximum(row, 0)], 0.0)

    def integral(self, when: Array, delay: float = 0.0) -> Array:
        """Return the integrals of the inputs up to `when` [s], delayed by `delay` [s], (n_inputs, ...)."""
        t = when - delay
        held = self.inputs[:, -1].reshape(-1, *[1] * t.ndim) * np.maximum(0.0, t - self._knots[-1])
        if not len(self._integral):
            return held
        return np.stack([np.interp(t, self._knots, row, left=0.0) for row in self._integral]) + held

    def largest_change(self, begin: Array, length: Array, delay: float, most: int) -> Array:
        """Return the fraction of each step at which commands change most; NaN if they do not change.

        Parameters
        ----------
        begin, length : ndarray, shape (N,)
            Begin and length of the steps [s].
        delay : float
            Delay of the commands [s].
        most : int
            Maximum number of changes within a step; with more changes the result is NaN.
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

    def lagged_integral(
        self, when: Array, parameters: Sequence[float], delay: float = 0.0
    ) -> dict[int, Array]:
        """Return the integrals of the input states up to times `when` [s], by index of the state.

        The states start from rest at the first row.
        """
        return {i: integral for i, (_, integral) in self._lagged(when, parameters, delay).items()}

    def lagged_at(self, when: Array, parameters: Sequence[float], delay: float = 0.0) -> dict[int, Array]:
        """Return the input states at times `when` [s], by index of the state."""
        return {i: value for i, (value, _) in self._lagged(when, parameters, delay).items()}

    def _lagged(
        self, when: Array, parameters: Sequence[float], delay: float
    ) -> dict[int, tuple[Array, Array]]:
        """Return the input states and their integrals."""
        laws = self._laws
        if laws is None:
            return {}
        key = self.numbers(parameters)
        if key not in self._courses:
            while len(self._courses) >= HELD:
                del self._courses[next(iter(self._courses))]
            self._courses[key] = (
                [self._course(a_of, b_of, parameters) for a_of, b_of in laws.linear]
                if laws.linear
                else self._stepped(laws, parameters)
            )
        return {i: course(when - delay) for i, course in zip(laws.indices, self._courses[key], strict=True)}

    def _course(
        self, a_of: Callable[..., float], b_of: Callable[..., Array], parameters: Sequence[float]
    ) -> Callable[[Array], tuple[Array, Array]]:
        """Return a function of time that returns the state of ``x' = a x + b`` and its integral; exact."""
        # With g = -b/a held from row to row and x_0 = x(t_0) = 0:
        #   x(t_k + s) = g + (x_k - g) exp(a s),  integral over s: g s + (x_k - g)/a (exp(a s) - 1)
        a, steps = float(a_of(parameters)), np.diff(self.time)
        goal = -np.broadcast_to(b_of(parameters, self.inputs), self.time.shape) / a
        fade = np.exp(a * steps)
        bands = np.stack([np.ones(goal.size), np.append(-fade, 0.0)])  # next value - fade * value = arriving
        start = solve_banded((1, 0), bands, np.append(0.0, (1.0 - fade) * goal[:-1]), check_finite=False)
        off = (start - goal) / a
        before = np.append(0.0, np.cumsum(goal[:-1] * steps + off[:-1] * np.expm1(a * steps)))

        def course(t: Array) -> tuple[Array, Array]:
            at = np.maximum(np.searchsorted(self.time, t + 1e-9 * self._tempo, side="right") - 1, 0)
            later = np.maximum(t - self.time[at], 0.0)  # before the log, commands are zero
            grown = off[at] * np.expm1(a * later)
            return start[at] + a * grown, np.asarray(before[at] + goal[at] * later + grown)

        return course

    def _stepped(
        self, laws: _Laws, parameters: Sequence[float]
    ) -> list[Callable[[Array], tuple[Array, Array]]]:
        """Integrate nonlinear laws; return a function of time for each state, as :meth:`_course`."""
        steps = np.diff(self.time)
        early = np.minimum(SECONDS[0] * self._tempo, 0.5 * steps)
        rest = np.clip(np.ceil((steps - early) / (SECONDS[1] * self._tempo)), 1, MOST_STEPS).astype(np.intp)
        row = np.repeat(np.arange(steps.size), FIRST + rest)
        k = np.arange(row.size) - np.repeat(np.cumsum(FIRST + rest) - FIRST - rest, FIRST + rest) + 1
        later = early[row] + (k - FIRST) / rest[row] * (steps - early)[row]
        ends = self.time[row] + np.where(k <= FIRST, k / FIRST * early[row], later)
        times = np.append(self.time[0], ends)
        h = np.diff(times)[:, None]
        unused = np.zeros((len(self.block.states), *h.shape))
        held = self.inputs[:, row][..., None]
        middle = ends[:, None] - 0.5 * h
        values = follow(self.block, laws.indices, middle, h, unused, held, parameters)[..., 0]
        return [_between(times, row) for row in values]


def _between(times: Array, values: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Return a function of time that returns a piecewise linear function and its integral.

    The function is zero before the first of the times and constant after the last one.
    """
    # integral to t = sum of h (v_i + v_(i+1))/2 over whole intervals + (v + v' s/2) s, s = t - t_k
    steps = np.diff(times)
    before = np.append(0.0, np.cumsum(0.5 * steps * (values[:-1] + values[1:])))
    slope = np.append(np.diff(values) / steps, 0.0)

    def course(t: Array) -> tuple[Array, Array]:
        at = np.clip(np.searchsorted(times, t, side="right") - 1, 0, times.size - 1)
        later = np.maximum(t - times[at], 0.0)
        rise = slope[at] * later
        return np.where(t < times[0], 0.0, values[at] + rise), before[at] + (values[at] + 0.5 * rise) * later

    return course
