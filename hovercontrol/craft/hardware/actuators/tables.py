"""Calibration tables of a fan with a rudder behind it: their rules and their files."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import write_atomically
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import csv_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: First cell of a table's file: what its rows and its columns are.
HEADS = {"force": "rudder_deg/force_N", "speed": "rudder_deg/speed_rpm"}


@checked
@dataclass(frozen=True, eq=False)
class FanTable:
    """A regular table over rudder angle and force (entries are speeds) or speed (entries are forces).

    Parameters
    ----------
    name : str
        Name in messages: its file.
    over : {"force", "speed"}
        Quantity of the columns: forces [N], with fan speeds [RPM] as entries, or fan speeds, with forces as
        entries.
    rudder : array_like, shape (n,)
        Rudder angles [degree] of the rows.
    columns : array_like, shape (m,)
        Forces [N] or speeds [RPM].
    values : array_like, shape (n, m)
        Entries [RPM] or [N].

    Raises
    ------
    InputError
        If an axis is not regular and increasing, the shape does not fit, a number is missing, or entries
        fall along a row. The message names table, row and column, counted as in the file.

    Examples
    --------
    >>> table = FanTable("demo", "force", [-5, 0, 5], [0.0, 0.5, 1.0], [[0, 5, 9], [0, 4, 8], [0, 5, 9]])
    >>> table.shape, table.step
    ((3, 3), (5.0, 0.5))
    """

    name: str
    over: Literal["force", "speed"]
    rudder: Floats
    columns: Floats
    values: Floats

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for key in ("rudder", "columns", "values"):
            object.__setattr__(self, key, np.array(getattr(self, key), dtype=float))
        if self.over not in HEADS:
            raise InputError(f"{self.name}: a table is over 'force' or 'speed', found {self.over!r}")
        self._need_regular("rudder angles", "row", self.rudder)
        self._need_regular(f"{self.over}s", "column", self.columns)
        if self.values.shape != (len(self.rudder), len(self.columns)):
            found = " x ".join(map(str, self.values.shape))
            raise InputError(
                f"{self.name}: expected {len(self.rudder)} x {len(self.columns)} entries, found {found}"
            )
        for bad, what in ((~np.isfinite(self.values), "a finite number"), (self._falls(), "no less than")):
            if bad.any():
                row, column = (int(k) for k in np.argwhere(bad)[0])
                before = f" {self.values[row, column - 1]:g} before it" if what == "no less than" else ""
                raise InputError(
                    f"{self.name}: rudder {self.rudder[row]:g} deg (row {row + 2}), {self.over} "
                    f"{self.columns[column]:g} (column {column + 2}): expected {what}{before}, "
                    f"found {self.values[row, column]:g}"
                )

    def _falls(self) -> NDArray[np.bool_]:
        return np.diff(self.values, axis=1, prepend=-np.inf) < 0

    def _need_regular(self, what: str, place: str, axis: Floats) -> None:
        if axis.ndim != 1 or len(axis) < 2:
            raise InputError(f"{self.name}: expected two or more {what}, found {axis.size}")
        steps = np.diff(axis)
        first = steps[0]
        bad = np.flatnonzero(~(np.abs(steps - first) <= 1e-6 * abs(first))) if first > 0 else np.array([0])
        if bad.size:
            k = int(bad[0])
            raise InputError(
                f"{self.name}: {what} must increase by equal steps: after {axis[k]:g} expected "
                f"{axis[k] + abs(first):g}, found {axis[k + 1]:g} ({place} {k + 3})"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.rudder), len(self.columns)

    @property
    def step(self) -> tuple[float, float]:
        """Steps of the rudder angle [degree] and of the columns."""
        return tuple(float((a[-1] - a[0]) / (len(a) - 1)) for a in (self.rudder, self.columns))  # type: ignore[return-value]

    def plot(self) -> Figure:
        """Return a curve for each rudder angle: speed over force, or force over speed."""
        from hovercontrol.craft.hardware.actuators.display import fan_table_figure

        return open_in_pyplot(fan_table_figure(self))

    def to_csv(self, path: str | Path) -> Path:
        """Write the table; :func:`read_fan_table` reads it back.

        Parameters
        ----------
        path : path
            The first row has the columns' axis, the first column the rudder angles.
        """

        def write(file: Path) -> None:
            with file.open("w", newline="", encoding="utf-8") as stream:
                out = csv.writer(stream, lineterminator="\n")
                out.writerow([HEADS[self.over], *(f"{c:.10g}" for c in self.columns)])
                out.writerows(
                    [f"{angle:.10g}", *(f"{v:.10g}" for v in row)]
                    for angle, row in zip(self.rudder, self.values, strict=True)
                )

        return write_atomically(path, write)


@checked
def read_fan_table(path: str | Path) -> FanTable:
    r"""Read a measured table, in place of the stand-in.

    Parameters
    ----------
    path : path
        CSV. The first cell is ``rudder_deg/force_N`` (entries in RPM) or ``rudder_deg/speed_rpm`` (entries in
        N); the rest of its row is that axis, the rest of its column the rudder angles [degree].

    Returns
    -------
    FanTable

    Raises
    ------
    InputError
        If the file does not exist, a cell is not a number, a row is too short or too long, or the table is
        not regular or falls along a row. The message names file, row and column.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "fan.csv"
    ...     _ = file.write_text("rudder_deg/force_N,0,1\n-40,0,9000\n40,0,9000\n")
    ...     read_fan_table(file).values.tolist()
    [[0.0, 9000.0], [0.0, 9000.0]]
    """
    file = Path(path)
    lines = csv_rows(file)
    head = lines[0][1][0].strip() if lines else ""
    over = next((key for key, text in HEADS.items() if text == head), None)
    if over is None:
        wanted = " or ".join(map(repr, HEADS.values()))
        raise InputError(f"{file}: row 1, column 1: expected {wanted}, found {head!r}")
    width = len(lines[0][1])
    numbers = []
    for line, row in lines:
        if len(row) != width:
            raise InputError(f"{file}: row {line}: expected {width} cells, found {len(row)}")
        first = 2 if line == lines[0][0] else 1
        cells = [_number(file, line, column, cell) for column, cell in enumerate(row[first - 1 :], first)]
        numbers.append([math.nan] * (first - 1) + cells)
    table = np.array(numbers).reshape(-1, width)
    return FanTable(str(file), over, table[1:, 0], table[0, 1:], table[1:, 1:])  # type: ignore[arg-type]


def _number(file: Path, line: int, column: int, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise InputError(f"{file}: row {line}, column {column}: expected a number, found {cell!r}") from None


@checked
@dataclass(frozen=True, eq=False)
class ServoTable:
    """Rudder angle against the width of the servo's pulse.

    Parameters
    ----------
    name : str
    pulse : array_like, shape (n,)
        Widths [ms], increasing.
    angle : array_like, shape (n,)
        Rudder angles [degree], all increasing or all falling.

    Raises
    ------
    InputError
        If they are not monotone; the message names table and entry.

    Examples
    --------
    >>> ServoTable("demo", [1.0, 1.5, 2.0], [-30.0, 0.0, 35.0]).angle.tolist()
    [-30.0, 0.0, 35.0]
    """

    name: str
    pulse: Floats
    angle: Floats

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for key in ("pulse", "angle"):
            object.__setattr__(self, key, np.array(getattr(self, key), dtype=float))
        if self.pulse.ndim != 1 or self.pulse.shape != self.angle.shape or len(self.pulse) < 2:
            raise InputError(
                f"{self.name}: expected two or more pulses and as many angles, found "
                f"{self.pulse.size} pulses and {self.angle.size} angles"
            )
        sign = 1.0 if self.angle[-1] > self.angle[0] else -1.0
        for what, axis, unit in (("pulse", self.pulse, "ms"), ("angle", sign * self.angle, "deg")):
            bad = np.flatnonzero(~(np.diff(axis) > 0))
            if bad.size:
                k = int(bad[0])
                shown = axis if what == "pulse" else self.angle
                raise InputError(
                    f"{self.name}: {what}s must be monotone: entry {k + 2} is {shown[k + 1]:g} {unit} "
                    f"after {shown[k]:g} {unit}"
                )

    def plot(self) -> Figure:
        """Return rudder angle over pulse width."""
        from hovercontrol.logs.display import curve_figure

        labels = "pulse [ms]", "rudder angle [deg]"
        return open_in_pyplot(curve_figure(self.name, self.pulse, self.angle, *labels))
