"""The clock of rows as they come: which stamps go on, which are wrong, where the clock begins again.

A row goes on if its stamp is at most :data:`NEAR` periods after the last one. Any other row waits for the
rows after it:

- a stamp within :data:`LONGEST_GAP` ends a gap if the next one is later still;
- :data:`CHAIN` stamps in a row that go on from each other, but not from the last one, are a clock that
  begins, or begins again;
- else it is left out, as soon as a row goes on from the last one.

Rows of one stamp are one row; one that contradicts the first of them is left out.

Stamps that begin may be in s, ms, us or ns: that unit is taken in which their steps are nearest to the usual
one, by the logarithm of the ratio.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

from hovercontrol.identification.monitor.notes import Note, Tally

#: Longest gap that is passed tick by tick [s]; after a longer one the monitor starts anew.
LONGEST_GAP = 30.0

#: A row that comes no later than this after the last one, in periods, is believed at once: none is missing.
NEAR = 1.5

#: Rows that must agree on another clock: two steps that are alike are no coincidence.
CHAIN = 3

#: Units of stamps, each a thousandth of the one before.
UNITS = ("s", "ms", "us", "ns")


@dataclass
class Row:
    """A row with its stamp; ``begins`` if its clock is another than that of the row before."""

    stamp: float
    values: dict[str, float]
    time: float = math.nan
    begins: bool = False


class Clock:
    """Puts rows in time.

    Parameters
    ----------
    period : float
        Of the monitor [s].
    step : float
        Usual time between two rows [s].

    Attributes
    ----------
    in_seconds : bool
        Whether the unit of the stamps is certain.
    last : Row or None
        The last row that went on.
    late : Tally
        Rows left out because of their stamps.
    restarts : int
    """

    def __init__(self, period: float, step: float) -> None:
        self._period, self._step = period, step
        self.in_seconds = False
        self.last: Row | None = None
        self.late, self.restarts = Tally(), 0
        self._unit = 0
        self._held: list[Row] = []

    def take(self, stamp: float, values: Mapping[str, float]) -> Iterator[Row | Note]:
        """Take a row; give the rows that go on, in order, and notes on the others."""
        new = Row(stamp, dict(values))
        before = self._held[-1] if self._held else self.last
        if before is None or stamp != before.stamp:
            yield from self._place(new)
        elif not _adds(before, new):
            yield from self._left([new])
        elif not self._held:
            yield Row(stamp, new.values, before.time)

    def end(self) -> Iterator[Row | Note]:
        """Give a row at the end of a gap that no other followed."""
        held, self._held = self._held, []
        if len(held) == 1 and self.last is not None and 0 < self._after(held[0]) <= LONGEST_GAP:
            yield from self._on(held)
        else:
            yield from self._left(held)

    def _place(self, new: Row) -> Iterator[Row | Note]:
        if self.last is not None and 0 < self._after(new) <= NEAR * self._period:
            held, self._held = self._held, []
            yield from self._left(held)
            yield from self._on([new])
            return
        self._held.append(new)
        while not self._agree():
            yield from self._left([self._held.pop(0)])
        if self._ends_gap():
            *others, gap, _ = self._held
            self._held = []
            yield from self._left(others)
            yield from self._on([gap])
            yield from self._place(new)
            return
        if len(self._held) == CHAIN:
            yield from self._begin()

    def _ends_gap(self) -> bool:
        """Return whether the last two rows that wait go on from the last one after a gap."""
        if self.last is None or len(self._held) < 2:
            return False
        first, second = map(self._after, self._held[-2:])
        return 0 < first <= LONGEST_GAP and 0 < second - first <= LONGEST_GAP

    def _agree(self) -> bool:
        """Return whether the rows that wait go on from each other, in one unit."""
        stamps = [row.stamp for row in self._held]
        steps = [b - a for a, b in pairwise(stamps)]
        units = {self._unit_of(step) for step in steps}
        return len(units) < 2 and all(0 < d / 1000.0**u <= LONGEST_GAP for d in steps for u in units)

    def _unit_of(self, step: float) -> int:
        """Return the unit in which a step is nearest to the usual one: round(log10(step/usual)/3)."""
        if self.in_seconds or not self._step < step < math.inf:
            return 0
        return min(round((math.log10(step) - math.log10(self._step)) / 3.0), len(UNITS) - 1)

    def _begin(self) -> Iterator[Row | Note]:
        """Take the rows that wait as the beginning of a clock."""
        held, self._held = self._held, []
        before, self.last, step = self.last, None, held[1].stamp - held[0].stamp
        now, held[0].begins = self._unit_of(step), True
        if now != self._unit:
            text = (
                f"the times of rows are {step:.6g} apart, where {self._step:.6g} s is usual: read in "
                f"{UNITS[now]}; another unit: --columns time=NAME:UNIT"
            )
            yield Note("clock", text, math.nan if before is None else before.time)
        self._unit = now
        if before is not None:
            self.restarts += 1
            to = held[0].stamp / 1000.0**now
            text = f"the time of rows goes from {before.time:.10g} s to {to:.10g} s: the monitor starts anew"
            yield Note("restart", text, before.time)
        yield from self._on(held)

    def _after(self, row: Row) -> float:
        """Return the time of a row after the last one [s], on its clock."""
        assert self.last is not None
        return row.stamp / 1000.0**self._unit - self.last.time

    def _on(self, rows: list[Row]) -> Iterator[Row]:
        for row in rows:
            row.time = row.stamp / 1000.0**self._unit
            self.last = row
            yield row

    def _left(self, rows: list[Row]) -> Iterator[Note]:
        for row in rows:
            count = self.late.add("")
            if count:
                last = math.nan if self.last is None else self.last.time
                after = "" if self.last is None else f" after {last:.10g} s"
                text = f"time {row.stamp / 1000.0**self._unit:.10g} s{after}: no other row goes on from it"
                yield Note("clock", f"{text}, so it is left out", last, count)


def _adds(before: Row, new: Row) -> bool:
    """Add the values of a row of the same time that say more; return whether none contradicts the others."""
    known = {k: v for k, v in before.values.items() if math.isfinite(v)}
    more = {k: v for k, v in new.values.items() if math.isfinite(v)}
    if any(known.get(k, v) != v for k, v in more.items()) or not more.keys() - known.keys():
        return False
    before.values.update(more)
    return True
