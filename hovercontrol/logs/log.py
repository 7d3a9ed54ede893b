"""The log: named columns of numbers over strictly increasing time.

All functions on measurements take and return a :class:`Log`. :mod:`.read` reads one from a file, and
:meth:`Log.save` writes one to a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean, shown
from hovercontrol.base.files import write_atomically
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import cut

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POSE = ("x", "y", "psi")
VELOCITY = ("u", "v", "r")
PARQUET = (".parquet", ".pq")

#: Number of stretches that represent a very long log.
STRETCHES = 10

#: SI units of the pose and the body velocities.
UNITS = dict(zip((*POSE, *VELOCITY), ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True))

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Trial:
    """One of several trials in a log.

    Attributes
    ----------
    first : int
        Its first row.
    shift : float
        Offset added to the file's time [s]. Trials whose time restarts in the file are placed one after
        the other in a log.
    """

    first: int
    shift: float = 0.0


@checked
@dataclass(frozen=True, eq=False)
class Log:
    """Measured or simulated signals on one time axis.

    Attributes
    ----------
    name : str
        Name of the log in error messages and reports, usually its file name.
    time : ndarray (n,)
        Times [s], strictly increasing.
    columns : mapping of str to ndarray (n,)
        Signals by name in SI units: any of ``x, y, psi`` (pose), ``u, v, r`` (body velocities) and
        the inputs. NaN in rows without a measurement, with inputs only.
    frame : str
        The stated frame of the log's axes before conversion to x, y, psi with z up. If it is empty,
        :func:`.frames.check_frame` checks the axes.
    origin : int
        Time stamp [ns] at which ``time`` is zero, if the file counts time from an epoch; else 0.
    trials : tuple of Trial
        The trials of the log, in order; empty for a single trial. Predictions do not cross from one trial to
        the next.
    notes : tuple of str
        Changes that the reader made to the rows, one line each.
    blank : mapping of str to int, optional
        Number of samples missing in each column of the files; by default the number of NaN. In a joined log
        the rows added for a command also have NaN, which are not counted here.

    Raises
    ------
    InputError
        A column is not as long as ``time``, or time does not increase.

    Examples
    --------
    >>> log = Log("demo", [0.0, 0.1, 0.2], {"r": [1.0, 2.0, 3.0]})
    >>> log.between(0.1, 1.0)["r"]
    array([2., 3.])
    """

    name: str
    time: Floats
    columns: Mapping[str, Floats]
    frame: str = ""
    origin: int = 0
    trials: tuple[Trial, ...] = ()
    notes: tuple[str, ...] = ()
    blank: Mapping[str, int] | None = None

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=float)
        columns = {name: np.asarray(column, dtype=float) for name, column in self.columns.items()}
        for name, column in columns.items():
            if column.shape != time.shape or time.ndim != 1:
                raise InputError(
                    f"{self.name}: column {name!r} has shape {column.shape}, "
                    f"expected one value for each of the {time.size} times"
                )
        stuck = np.flatnonzero(~(np.diff(time) > 0))
        if stuck.size:
            i = int(stuck[0])
            raise InputError(
                f"{self.name}: time must increase, but sample {i + 1} is at {time[i + 1]:.10g} s "
                f"after {time[i]:.10g} s"
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", columns)

    def __repr__(self) -> str:
        rows = f"{len(self)} rows"
        if len(self):
            rows += f" from {self.time[0]:.6g} to {self.time[-1]:.6g} s"
        trials = [f"{len(self.trials)} trials"] if self.trials else []
        frame = [f"frame {self.frame}"] if self.frame else []
        head = "; ".join([f"Log {self.name!r}: {rows}", *trials, *frame])
        lines = [head, f"  columns  {cut(', '.join(self.columns))}"]
        return "\n".join([*lines, *(f"  note     {cut(note)}" for note in self.notes)])

    def __len__(self) -> int:
        return int(self.time.size)

    @checked
    def __getitem__(self, name: str) -> Floats:
        if name == "time":
            return self.time
        if name not in self.columns:
            raise InputError(
                f"{self.name}: no column {shown(name)}{did_you_mean(name, ['time', *self.columns])}"
            )
        return self.columns[name]

    def has(self, *names: str) -> bool:
        """Return whether the log has all of these columns.

        Parameters
        ----------
        *names : str
        """
        return all(name in self.columns for name in names)

    def stack(self, *names: str) -> Floats:
        """Return the named columns as a matrix, shape (n, number of names).

        Raises
        ------
        InputError
            A name is not a column.

        Examples
        --------
        >>> Log("demo", [0.0, 1.0], {"x": [1, 2], "y": [3, 4]}).stack("y", "x")
        array([[3., 1.],
               [4., 2.]])
        """
        return np.column_stack([self[name] for name in names])

    def select(self, rows: Mask | NDArray[np.intp] | slice) -> Log:
        """Return the log reduced to some rows (a mask, indices or a slice).

        Parameters
        ----------
        rows : ndarray of bool, shape (n,), ndarray of int, or slice

        Raises
        ------
        InputError
            If the rows do not exist.

        Examples
        --------
        >>> len(Log("demo", [0.0, 1.0, 2.0], {}).select(slice(1, None)))
        2
        """
        try:
            kept = {k: v[rows] for k, v in self.columns.items()}
            return replace(self, time=self.time[rows], columns=kept, trials=self._trials_of(rows))
        except (IndexError, TypeError, ValueError):
            raise InputError(
                f"{self.name}: expected a mask, indices or a slice of {len(self)} rows, found {shown(rows)}"
            ) from None

    def _trials_of(self, rows: Mask | NDArray[np.intp] | slice) -> tuple[Trial, ...]:
        """Return the trials of some rows."""
        if not self.trials:
            return ()
        firsts = [trial.first for trial in self.trials]
        own = np.searchsorted(firsts, np.arange(len(self))[rows], side="right") - 1
        numbers, at = np.unique(own, return_index=True)
        found = [Trial(int(i), self.trials[k].shift) for k, i in zip(numbers.tolist(), at, strict=True)]
        return tuple(found) if len(found) > 1 else ()

    def each_trial(self) -> list[Log]:
        """Return one log per trial, or the log itself if it is a single trial.

        Examples
        --------
        >>> log = Log("demo", [0.0, 1.0, 60.0, 61.0], {}, trials=(Trial(0), Trial(2)))
        >>> [part.time.tolist() for part in log.each_trial()]
        [[0.0, 1.0], [60.0, 61.0]]
        """
        edges = [*(trial.first for trial in self.trials), len(self)]
        return [self.select(slice(a, b)) for a, b in pairwise(edges)] if self.trials else [self]

    def missing(self, name: str) -> int:
        """Return how many samples of a column are missing.

        Parameters
        ----------
        name : str

        Raises
        ------
        InputError
            If there is no such column.

        Examples
        --------
        >>> Log("demo", [0.0, 1.0], {"x": [1.0, float("nan")]}).missing("x")
        1
        """
        found = np.count_nonzero(np.isnan(self[name]))
        return int(found if self.blank is None else self.blank.get(name, 0))

    def between(self, start: float, stop: float) -> Log:
        """Return the rows with ``start <= time <= stop`` [s].

        Examples
        --------
        >>> Log("demo", [0.0, 1.0, 2.0], {}).between(0.5, 1.5).time
        array([1.])
        """
        return self.select((self.time >= start) & (self.time <= stop))

    def spread(self, most: int) -> list[Log]:
        """Return the log itself, or ten evenly spaced stretches if it has more than `most` rows.

        Examples
        --------
        >>> log = Log("demo", np.arange(1000.0), {})
        >>> [(len(part), float(part.time[0])) for part in log.spread(200)][:3]
        [(20, 0.0), (20, 108.0), (20, 217.0)]
        """
        if len(self) <= most:
            return [self]
        size = most // STRETCHES
        firsts = np.linspace(0, len(self) - size, STRETCHES).astype(int)
        return [self.select(slice(int(first), int(first) + size)) for first in firsts]

    def with_columns(self, columns: Mapping[str, ArrayLike]) -> Log:
        """Return the log with these columns added or replaced, each of shape (n,).

        Examples
        --------
        >>> Log("demo", [0.0, 1.0], {}).with_columns({"u": [2.0, 3.0]}).has("u")
        True
        """
        added = {name: np.asarray(column, dtype=float) for name, column in columns.items()}
        return replace(self, columns={**self.columns, **added})

    def on_clock_of(self, other: Log) -> Log:
        """Return the log with its time counted from the origin of another log.

        Parameters
        ----------
        other : Log

        Examples
        --------
        >>> late = Log("late", [0.0, 1.0], {}, origin=1_700_000_000_500_000_000)
        >>> late.on_clock_of(Log("first", [0.0], {}, origin=1_700_000_000_000_000_000)).time
        array([0.5, 1.5])
        """
        if self.origin == other.origin:
            return self
        return replace(self, time=self.time + (self.origin - other.origin) / 1e9, origin=other.origin)

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Spans [s] without samples, longer than 0.25 s and longer than five median time steps.

        A gap is not an error: smoothing and identification restart after it. Pauses between trials do not
        count as gaps.
        """
        firsts = [trial.first for trial in self.trials]
        rows = np.setdiff1d(gap_rows(self.time), firsts) - 1
        return tuple((float(self.time[i]), float(self.time[i + 1])) for i in rows)

    def _repr_html_(self) -> str:
        from hovercontrol.logs.display import log_html

        return log_html(self)

    def plot(self) -> Figure:
        """Return a figure of the columns over time."""
        from hovercontrol.logs.display import log_figure

        return open_in_pyplot(log_figure(self, UNITS))

    def save(self, path: str | Path) -> None:
        """Write the log as CSV or Parquet, chosen by the suffix; the file is written atomically.

        Parameters
        ----------
        path : path
            Ends in ``.parquet`` for Parquet; else CSV.

        Raises
        ------
        InputError
            The folder cannot be made or written.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     Log("demo", [0.0, 0.5], {"u": [1.0, 2.0]}).save(Path(folder) / "demo.csv")
        ...     print((Path(folder) / "demo.csv").read_text())
        "time","u"
        0,1
        0.5,2
        <BLANKLINE>
        """
        target = Path(path)
        table = pa.table({"time": self.time, **self.columns})
        with_checksums = partial(pyarrow.parquet.write_table, write_page_checksum=True)
        write = with_checksums if target.suffix.lower() in PARQUET else pyarrow.csv.write_csv
        write_atomically(target, lambda temporary: write(table, temporary))


def gap_rows(time: Floats) -> NDArray[np.intp]:
    """Return the first row after each gap: a time step over 0.25 s and over five median steps.

    Examples
    --------
    >>> gap_rows(np.array([0.0, 0.02, 0.04, 1.0, 1.02]))
    array([3])
    """
    steps = np.diff(time)
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > max(5.0 * float(np.median(steps)), 0.25)) + 1
