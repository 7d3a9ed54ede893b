"""The pilot's recording: rows of the standard log, kept until they are saved."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import refusals, write_new
from hovercontrol.logs import POSE, VELOCITY, Log

#: Longest recording [s].
LONGEST = 3600.0

#: Said of a recording with fewer than two rows.
NOTHING = "nothing was recorded: expected a recording while time goes on"

_NAME = re.compile(r"pilot-(\d+)\.csv")


class Recorder:
    """Rows of time, pose, body velocities as measured, and commands.

    Parameters
    ----------
    inputs : sequence of str
        Names of the commands.
    more : mapping of str to str, optional
        Further columns and their signals, without measurement errors (``true_x`` is ``x``).

    Examples
    --------
    >>> recorder = Recorder(["thrust"])
    >>> motion = dict.fromkeys(["x", "y", "psi", "u", "v", "r"], 0.0)
    >>> for k in range(2):
    ...     recorder.add({"time": 0.01 * k, "thrust": 1.0, **motion})
    >>> list(recorder.log().columns)
    ['x', 'y', 'psi', 'u', 'v', 'r', 'thrust']
    """

    def __init__(self, inputs: Sequence[str], more: Mapping[str, str] = MappingProxyType({})) -> None:
        self.names = ("time", *POSE, *VELOCITY, *inputs, *more)
        self._own, self._more = self.names[: -len(more) or None], tuple(more.values())
        self._rows: list[list[float]] = []

    def add(self, signals: Mapping[str, float]) -> None:
        """Add a row, with measured values of the motion where they differ from the true ones."""
        row = [signals.get(f"{name}_measured", signals[name]) for name in self._own]
        self._rows.append([*row, *(signals[name] for name in self._more)])

    @property
    def empty(self) -> bool:
        """Whether there are fewer than two rows."""
        return len(self._rows) < 2

    @property
    def seconds(self) -> float:
        """Length of the recording [s]."""
        return self._rows[-1][0] - self._rows[0][0] if self._rows else 0.0

    def log(self, name: str = "pilot") -> Log:
        """Return the log.

        Raises
        ------
        InputError
            If it has fewer than two rows.
        """
        if self.empty:
            raise InputError(NOTHING)
        columns = dict(zip(self.names, np.array(self._rows).T, strict=True))
        return Log(name, columns.pop("time"), columns)

    def save(self, folder: Path) -> Path:
        """Write the log to the next free ``pilot-001.csv`` of a folder and return its path.

        Raises
        ------
        InputError
            If there is nothing to save, or the folder cannot be written.
        """
        with refusals(folder):
            names = names_in(folder)
        taken = [int(found[1]) for found in map(_NAME.fullmatch, names) if found]
        for number in itertools.count(max(taken, default=0) + 1):
            path = folder / f"pilot-{number:03d}.csv"
            if write_new(path, self.log(path.name).save):
                break
        return path


def names_in(folder: Path) -> list[str]:
    """Return the names of the logs in a folder, sorted; without hidden files and links."""
    if not folder.is_dir():
        return []
    kinds = (".csv", ".parquet", ".pq")
    files = (entry.name for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False))
    plain = (name for name in files if name.isprintable() and not name.startswith("."))
    return sorted(name for name in plain if name.lower().endswith(kinds))
