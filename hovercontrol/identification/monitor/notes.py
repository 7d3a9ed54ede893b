"""What a monitor says of the rows that it is fed, beside its alarms."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass


@dataclass(frozen=True)
class Note:
    """A fault of the rows, or of their source.

    Attributes
    ----------
    event : str
        ``"bad"`` (a row or a cell that is left out), ``"clock"`` (a stamp that is left out, another unit of
        the stamps), ``"restart"``, ``"header"``, ``"file"``; ``"dead"`` and ``"back"`` for a command.
    text : str
        What is wrong, in one sentence.
    time : float
        Of the last row before it [s]; not a number before the first.
    rows : int
        Number of such rows until now.
    name : str
        Of a command.
    since : float
        Time of its last value, or of the first row [s].
    """

    event: str
    text: str
    time: float = math.nan
    rows: int = 0
    name: str = ""
    since: float = math.nan


class Tally:
    """Counts rows by the kind of their fault, and says when to tell: the 1st, 10th, 100th and so on.

    Attributes
    ----------
    total : int

    Examples
    --------
    >>> tally = Tally()
    >>> [count for count in range(1, 101) if tally.add("late")]
    [1, 10, 100]
    """

    def __init__(self) -> None:
        self.total = 0
        self._of: Counter[str] = Counter()

    def add(self, kind: str) -> int:
        """Count a row; return the number of its kind if it is to be told, else 0."""
        self.total += 1
        self._of[kind] += 1
        count = self._of[kind]
        return count if str(count).rstrip("0") == "1" else 0
