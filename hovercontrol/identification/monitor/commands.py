"""Commands that are lost: without them the motion cannot be predicted, and every motion would be a change.

A command without a value in a row holds, as where commands are logged when they change. But one that came
with every row for the time after which a sensor is dead is expected in every row: rows without it are left
out, and after that time it is lost. So is one that never came, or one whose rows are missing as long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from hovercontrol.identification.monitor.clock import Row
from hovercontrol.identification.monitor.notes import Note


class Commands:
    """Lets rows pass while their commands are known.

    Parameters
    ----------
    names : sequence of str
    patience : float
        Time without a value after which an expected command is lost [s].
    """

    def __init__(self, names: Sequence[str], patience: float) -> None:
        self._names, self._patience = names, patience
        self._lost: set[str] = set()
        self._forget()

    def _forget(self) -> None:
        self._run: dict[str, tuple[float, float]] = {}  # first and last time of the latest rows with a value
        self._missing: set[str] = set(self._names)
        self._began: float | None = None
        self._last = math.inf

    def take(self, row: Row) -> Iterator[Row | Note]:
        """Take a row; give it if it may be used, and a note for a command that is lost or back."""
        if row.begins:
            self._forget()
        self._began = row.time if self._began is None else self._began
        yield from self._gap(row)
        for name in self._names:
            if math.isfinite(row.values.get(name, math.nan)):
                self._run[name] = (row.time if name in self._missing else self._run[name][0], row.time)
                self._missing.discard(name)
            else:
                self._missing.add(name)
        expected = [name for name in self._missing if self._is_expected(name)]
        if not expected:
            for name in sorted(self._lost):
                yield Note("back", f"values of the command {name}", row.time, name=name)
                row.begins = True
            self._lost = set()
            yield row
        for name in expected if not self._lost else ():
            since = self._run[name][1] if name in self._run else self._began
            if row.time - since >= self._patience:
                self._lost.add(name)
                yield Note("dead", f"no values of the command {name}", row.time, name=name, since=since)

    def _gap(self, row: Row) -> Iterator[Note]:
        """Let the monitor start anew after rows that are missing with their commands."""
        before, self._last = self._last, row.time
        if row.time - before >= self._patience and any(map(self._is_expected, self._run)) and not self._lost:
            row.begins = True
            text = f"no rows, so no commands, from {before:.10g} s to {row.time:.10g} s"
            yield Note("restart", f"{text}: the monitor starts anew", before)

    def _is_expected(self, name: str) -> bool:
        first, last = self._run.get(name, (-math.inf, math.inf))
        return last - first >= self._patience
