"""Nested loops with constant strides that visit given places of arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.int64]

#: Loop counters, the outermost first.
COUNTERS = ("l0", "l1", "l2", "l3", "l4", "l5")


@dataclass(frozen=True, eq=False)
class Nest:
    """Nested loops: lengths, and strides of all slots, the outermost first; places at the first pass."""

    first: Places
    lengths: tuple[int, ...]
    strides: tuple[Places, ...]
    at: int

    @property
    def passes(self) -> int:
        """Return the number of passes of the innermost loop in all."""
        return int(np.prod(self.lengths))

    def may_precede(self, other: Nest) -> bool:
        """Return whether an outer loop can execute both."""
        alike = self.lengths == other.lengths and len(self.lengths) < len(COUNTERS)
        return alike and np.array_equal(self.strides, other.strides)


def nests(places: Places) -> list[Nest]:
    """Return the loops that visit the rows of a table of places in their order.

    Examples
    --------
    >>> [nest.lengths for nest in nests(np.array([[0, 5], [1, 5], [2, 6], [3, 6], [4, 9]]))]
    [(2, 2), ()]
    """
    found = [Nest(row, (), (), k) for k, row in enumerate(places)]
    before = 0
    while len(found) != before:
        before, rest, found = len(found), found[::-1], []
        while rest:
            run = [rest.pop()]
            while rest and run[0].may_precede(rest[-1]):
                stride = rest[-1].first - run[-1].first
                if len(run) > 1 and not np.array_equal(stride, run[1].first - run[0].first):
                    break
                run.append(rest.pop())
            one = run[0]
            if len(run) > 1:
                stride = run[1].first - one.first
                one = Nest(one.first, (len(run), *one.lengths), (stride, *one.strides), one.at)
            found.append(one)
    return found
