"""Measured tables: the missing one of the two is computed from the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import csv_rows
from hovercontrol.craft.hardware.actuators.k06 import fan_tables, reverse_ratio
from hovercontrol.craft.hardware.actuators.tables import FanTable, Floats, ServoTable

#: Columns of a table that is made of another, as many as K06's have: over forces, over speeds.
FORCES, SPEEDS = 161, 97

#: First row of a servo table's file.
SERVO_HEAD = ("pulse_ms", "angle_deg")


@checked
def table_pair(
    tables: FanTable | Sequence[FanTable] | None, where: str = "tables"
) -> tuple[FanTable, FanTable]:
    """Return the fan's table of speeds over forces and its table of forces over speeds.

    Parameters
    ----------
    tables : FanTable or two of them, optional
        Both, in any order, or one, which is inverted row by row, with the number of columns of K06's tables.
        Default: K06's stand-ins.
    where : str, optional
        Prefix of messages.

    Raises
    ------
    InputError
        If they are not tables, or both are of the same kind.

    Examples
    --------
    >>> measured = FanTable("mine", "speed", [-30, 30], [-9e3, 0, 9e3], [[-0.5, 0, 1], [-0.5, 0, 1]])
    >>> lookup, reverse = table_pair(measured)
    >>> lookup.shape, lookup.values[0, [0, 40, 80, 120, 160]].tolist()  # RPM for -1, -0.5, 0, 0.5, 1 N
    ((2, 161), [-9000.0, -9000.0, 0.0, 4500.0, 9000.0])
    """
    if tables is None:
        return fan_tables()
    given = [tables] if isinstance(tables, FanTable) else tables
    if not (isinstance(given, Sequence) and 1 <= len(given) <= 2) or not all(
        isinstance(table, FanTable) for table in given
    ):
        raise InputError(f"{where}: expected one fan table or two, as read_fan_table gives, found {tables!r}")
    by = {table.over: table for table in given}
    if len(by) < len(given):
        kinds = " and ".join(f"{table.name!r}" for table in given)
        raise InputError(f"{where}: expected tables over forces and over speeds, found {kinds} over one")
    force = by["force"] if "force" in by else _over_forces(by["speed"])
    return force, by["speed"] if "speed" in by else _over_speeds(by["force"])


@checked
def with_reverse(
    forward: FanTable, ratio: Callable[[Floats], Floats] = reverse_ratio
) -> tuple[FanTable, FanTable]:
    """Return both tables of a fan measured ahead only, by K06's method (section 4.3.2.2).

    K06 measured 14 x 81 entries, rudder angles by forces of 0 to 2 N, and made 14 x 161 of them by the ratio
    of reverse to forward thrust, measured with the rudder straight: at any angle the fan pushes backward
    `ratio` times what it pushes forward at that speed.

    Parameters
    ----------
    forward : FanTable
        Over forces that begin at 0.
    ratio : callable, optional
        Of speeds [RPM]; default K06's (4.4).

    Returns
    -------
    tuple of two FanTable
        Speeds over forces, negative ones too, and forces over speeds.

    Raises
    ------
    InputError
        If the table is not over forces, or its forces do not begin at 0.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.actuators import fan_tables, reverse_ratio
    >>> whole = fan_tables()[0]
    >>> ahead = FanTable("ahead", "force", whole.rudder, whole.columns[80:], whole.values[:, 80:])
    >>> ahead.shape, with_reverse(ahead)[0].shape
    ((14, 81), (14, 161))
    """
    if forward.over != "force" or forward.columns[0] != 0:
        raise InputError(f"{forward.name}: expected a table over forces from 0 N on")
    both = _over_speeds(forward)
    ahead = both.columns > 0
    speeds = both.columns[ahead]
    pushes = np.asarray(ratio(speeds)) * both.values[:, ahead]
    wanted = np.concatenate([-forward.columns[:0:-1], forward.columns])
    rows = []
    for row, back in zip(forward.values, pushes, strict=True):
        slowest = float(row[row > 0][0]) if row[-1] > 0 else 0.0
        astern = -np.maximum(np.interp(forward.columns[:0:-1], back, speeds), slowest)
        rows.append(np.concatenate([astern, row]))
    lookup = FanTable(f"{forward.name}, with reverse", "force", forward.rudder, wanted, np.array(rows))
    values = np.concatenate([-pushes[:, ::-1], both.values[:, both.columns >= 0]], axis=1)
    return lookup, FanTable(f"{forward.name}, with reverse", "speed", forward.rudder, both.columns, values)


def _over_forces(table: FanTable) -> FanTable:
    most = float(np.abs(table.values).max())
    if most == 0:
        raise InputError(f"{table.name}: all its forces are zero")
    wanted = np.linspace(-most, most, FORCES)
    rows = np.array([np.interp(wanted, row, table.columns) for row in table.values])
    if table.columns[0] <= 0 <= table.columns[-1]:
        rows[:, FORCES // 2] = 0.0  # a fan that need not push stands
    return FanTable(f"{table.name}, turned round", "force", table.rudder, wanted, rows)


def _over_speeds(table: FanTable) -> FanTable:
    most = float(np.abs(table.values).max())
    if most == 0:
        raise InputError(f"{table.name}: all its speeds are zero")
    speeds = np.linspace(-most, most, SPEEDS)
    rows = [np.interp(speeds, *_forces(row, table.columns)) for row in table.values]
    return FanTable(f"{table.name}, turned round", "speed", table.rudder, speeds, np.array(rows))


def _forces(row: Floats, forces: Floats) -> tuple[Floats, Floats]:
    """Return the speeds of a row, each once, and the force of each.

    Where many forces share a speed, that speed is the lowest or highest of the fan. The fan then makes the
    largest force at the lowest speed, and the smallest at the highest.
    """
    speeds, first = np.unique(row, return_index=True)
    last = np.append(first[1:], len(row)) - 1
    small, large = np.where(speeds < 0, (last, first), (first, last))
    ends = (speeds == speeds[0]) & (speeds < 0) | (speeds == speeds[-1]) & (speeds > 0)
    found = forces[np.where(ends, small, large)]
    standing = (speeds == 0) & (forces[first] <= 0) & (forces[last] >= 0)
    return speeds, np.where(standing, 0.0, found)


@checked
def read_servo_table(path: str | Path) -> ServoTable:
    r"""Read a measured table of a servo, in place of the stand-in.

    Parameters
    ----------
    path : path
        CSV: a row ``pulse_ms,angle_deg``, then widths of the pulse [ms] and rudder angles [degree].

    Returns
    -------
    ServoTable

    Raises
    ------
    InputError
        If the file does not exist or is not such a table; the message names file and row.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "servo.csv"
    ...     _ = file.write_text("pulse_ms,angle_deg\n1.0,-40\n1.5,0\n2.0,40\n")
    ...     read_servo_table(file).angle.tolist()
    [-40.0, 0.0, 40.0]
    """
    file = Path(path)
    lines = csv_rows(file)
    head = tuple(cell.strip() for cell in lines[0][1]) if lines else ()
    if head != SERVO_HEAD:
        raise InputError(f"{file}: row 1: expected {','.join(SERVO_HEAD)}, found {','.join(head)!r}")
    rows = []
    for line, row in lines[1:]:
        try:
            pulse, angle = (float(cell) for cell in row)
        except ValueError:
            raise InputError(f"{file}: row {line}: expected two numbers, found {','.join(row)!r}") from None
        rows.append((pulse, angle))
    return ServoTable(str(file), *np.array(rows).reshape(-1, 2).T)
