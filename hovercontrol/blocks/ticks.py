"""Exact tick times as whole numbers of a fraction of a second, so that simultaneous ticks are equal."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.expressions import Expressions

#: Maximum number of fractions per second: counts stay exact in double precision for 2.5 hours.
FINEST = 10**12

#: Relative tolerance between a tick and a time: ticks are exact, but time grids have rounding errors.
ROOM = 8 * sys.float_info.epsilon


@dataclass(frozen=True)
class Tick:
    """The updates of a hybrid Block at every multiple of a period.

    Parameters
    ----------
    name : str
        Name of the original sampled Block.
    period : float
        Time between two ticks [s].
    updates : mapping of str to sympy.Expr
        New values of the states that the tick sets. The expressions use the values before the tick, except
        those that an earlier tick of the same instant has set.
    """

    name: str
    period: float
    updates: Expressions


class Clock:
    """Counts time in the largest fraction of a second that divides all given times.

    Parameters
    ----------
    times : iterable of float
        Periods and instants [s], each interpreted exactly as its decimal representation.

    Attributes
    ----------
    parts : int
        Number of fractions per second.

    Examples
    --------
    >>> clock = Clock([0.0225, 0.01])
    >>> clock.count(0.0225), clock.count(0.01)
    (9, 4)
    >>> clock.instants([0.0225, 0.01], 0.05)
    [0, 4, 8, 9, 12, 16, 18, 20]
    >>> clock.seconds(18)
    0.045
    """

    def __init__(self, times: Iterable[float]) -> None:
        self.parts = math.lcm(*(Fraction(str(t)).denominator for t in times))

    def count(self, time: float) -> int:
        """Return a time [s] as a count, rounded down."""
        return math.floor(Fraction(str(time)) * self.parts)

    def seconds(self, count: int) -> float:
        """Return a count as a time [s]."""
        return count / self.parts

    def instants(self, periods: Iterable[float], end: float, also: Iterable[float] = ()) -> list[int]:
        """Return the counts of all multiples of the periods up to `end`, and of `also`, sorted, each once."""
        last = self.count(end)
        found = {n for period in periods for n in range(0, last + 1, self.count(period))}
        return sorted(found | {self.count(t) for t in also})


class Schedule:
    """Due ticks and the time of the next tick; the C runtime computes the same.

    Parameters
    ----------
    periods : sequence of float
        Times between two ticks [s].
    start : float
        Each first tick is at the first multiple of its period at or after this time [s].

    Raises
    ------
    InputError
        If the periods have no common fraction of a second of at least 1 ps.

    Examples
    --------
    >>> schedule = Schedule([0.1, 0.25], 0.0)
    >>> [(schedule.time, schedule.take(schedule.time)) for _ in range(4)]
    [(0.0, [0, 1]), (0.1, [0]), (0.2, [0]), (0.25, [1])]
    """

    def __init__(self, periods: Sequence[float], start: float) -> None:
        self._parts = clock_of(periods).parts
        self._periods = [math.floor(Fraction(str(p)) * self._parts) for p in periods]
        # first tick of period p at or after the start: p ceil(start/p), counted in fractions of a second
        early = start - ROOM * abs(start)
        self._next = [math.ceil(Fraction(early) * self._parts / p) * p for p in self._periods]
        self.time = self._first()

    def _first(self) -> float:
        return min(self._next, default=math.inf) / self._parts

    def save(self) -> tuple[int, ...]:
        """Return the count of each next tick, for :meth:`load`."""
        return tuple(self._next)

    def load(self, saved: Sequence[int]) -> None:
        """Restore what :meth:`save` returned."""
        self._next = list(saved)
        self.time = self._first()

    def is_due(self, time: float) -> bool:
        """Return whether a tick is due at or before a time [s]."""
        return self.time <= time + ROOM * abs(time)

    def take(self, time: float) -> list[int]:
        """Return the indices of the ticks due next, and advance their next times by one period."""
        count = min(self._next)
        due = [k for k, n in enumerate(self._next) if n == count]
        for k in due:
            self._next[k] += self._periods[k]
        self.time = self._first()
        return due


def clock_of(periods: Sequence[float]) -> Clock:
    """Return the clock for some periods; raise if it cannot count them exactly.

    Raises
    ------
    InputError
        If a period is not a multiple of 1 ps; the message gives the period and the nearest valid one.
    """
    clock = Clock(periods)
    if clock.parts > FINEST:
        worst = max(periods, key=lambda p: Fraction(str(p)).denominator)
        raise InputError(
            f"a period of {worst!r} s is not a whole number of picoseconds, so its tick times are not exact; "
            f"the nearest valid period is {round(worst, 9)!r} s"
        )
    return clock
