"""Exact times of ticks, as whole numbers of one fraction of a second: those that fall together are one."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hovercontrol.core.expressions import Expressions
from hovercontrol.errors import InputError

#: Finest fraction of a second: counts of it stay exact in double precision for two and a half hours.
FINEST = 10**12

#: Relative; a tick this near to a time is at that time: grids are computed with rounding, ticks are exact.
ROOM = 8 * sys.float_info.epsilon


@dataclass(frozen=True)
class Tick:
    """What happens at every multiple of a period in a hybrid Block.

    Parameters
    ----------
    name : str
        Of the sampled Block that it was.
    period : float
        [s]
    updates : mapping of str to sympy.Expr
        The states that it sets, each to its expression; all see the values before the tick, where an earlier
        tick of the same instant has not set them.
    """

    name: str
    period: float
    updates: Expressions


class Clock:
    """Counts time in the largest fraction of a second that divides all given times.

    Parameters
    ----------
    times : iterable of float
        Periods and instants [s], each taken as the decimal number that it is written as.

    Attributes
    ----------
    parts : int
        How many of them are a second.

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
        """Return a time as a count, rounded down."""
        return math.floor(Fraction(str(time)) * self.parts)

    def seconds(self, count: int) -> float:
        """Return a count as a time [s]."""
        return count / self.parts

    def instants(self, periods: Iterable[float], end: float, also: Iterable[float] = ()) -> list[int]:
        """Return every multiple of every period up to the end, and other times, sorted, each once."""
        last = self.count(end)
        found = {n for period in periods for n in range(0, last + 1, self.count(period))}
        return sorted(found | {self.count(t) for t in also})


class Schedule:
    """Which ticks are due, and when the next one is; the same in the C runtime.

    Parameters
    ----------
    periods : sequence of float
        [s]
    start : float
        The first ticks are at the first multiples from here on [s].

    Raises
    ------
    InputError
        If the periods have no common fraction of a second that is a picosecond or more.

    Examples
    --------
    >>> schedule = Schedule([0.1, 0.25], 0.0)
    >>> [(schedule.time, schedule.take(schedule.time)) for _ in range(4)]
    [(0.0, [0, 1]), (0.1, [0]), (0.2, [0]), (0.25, [1])]
    """

    def __init__(self, periods: Sequence[float], start: float) -> None:
        self._parts = clock_of(periods).parts
        self._periods = [math.floor(Fraction(str(p)) * self._parts) for p in periods]
        early = start - ROOM * abs(start)
        self._next = [math.ceil(Fraction(early) * self._parts / p) * p for p in self._periods]
        self.time = self._first()

    def _first(self) -> float:
        return min(self._next, default=math.inf) / self._parts

    def save(self) -> tuple[int, ...]:
        """Return when each is due next, for :meth:`load`."""
        return tuple(self._next)

    def load(self, saved: Sequence[int]) -> None:
        """Go on from what :meth:`save` returned."""
        self._next = list(saved)
        self.time = self._first()

    def is_due(self, time: float) -> bool:
        """Return whether a tick is due at a time, or was before."""
        return self.time <= time + ROOM * abs(time)

    def take(self, time: float) -> list[int]:
        """Return which ticks are due at the time of the next, and wait for those after it."""
        count = min(self._next)
        due = [k for k, n in enumerate(self._next) if n == count]
        for k in due:
            self._next[k] += self._periods[k]
        self.time = self._first()
        return due


def clock_of(periods: Sequence[float]) -> Clock:
    """Return the clock that counts some periods; refuse what it cannot count exactly.

    Raises
    ------
    InputError
        Naming the period and the nearest that will do.
    """
    clock = Clock(periods)
    if clock.parts > FINEST:
        worst = max(periods, key=lambda p: Fraction(str(p)).denominator)
        raise InputError(
            f"a period of {worst!r} s is no whole number of picoseconds, so its ticks have no exact times; "
            f"the nearest that will do is {round(worst, 9)!r} s"
        )
    return clock
