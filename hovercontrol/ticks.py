"""Exact times of ticks, as whole numbers of one fraction of a second: those that fall together are one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction


class Clock:
    """Counts time in the largest fraction of a second that divides all given times.

    Parameters
    ----------
    times : iterable of float
        Periods and instants [s], each taken as the decimal number that it is written as.

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
        self._parts = math.lcm(*(Fraction(str(t)).denominator for t in times))

    def count(self, time: float) -> int:
        """Return a time as a count, rounded down."""
        return math.floor(Fraction(str(time)) * self._parts)

    def seconds(self, count: int) -> float:
        """Return a count as a time [s]."""
        return count / self._parts

    def instants(self, periods: Iterable[float], end: float, also: Iterable[float] = ()) -> list[int]:
        """Return every multiple of every period up to the end, and other times, sorted, each once."""
        last = self.count(end)
        found = {n for period in periods for n in range(0, last + 1, self.count(period))}
        return sorted(found | {self.count(t) for t in also})
