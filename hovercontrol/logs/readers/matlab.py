"""MATLAB's .mat files: ``time``, ``log.x``; equally long vectors are a table.

SciPy reads files up to version 7, and mat-io those of version 7.3 (HDF5), and tables and timetables of all
versions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import matlab_script
from hovercontrol.logs.readers.apart import Apart
from hovercontrol.logs.readers.matlab_script import vectors_of
from hovercontrol.logs.readers.tables import Table, Tables, faults, unit_or_none

#: Last parts of variable names that denote time.
CLOCKS = ("time", "t", "timestamp", "stamp", "tout")


def matlab(file: Path) -> Tables:
    """Open a file; a column of a matrix is named ``name[0]``, a field of a struct ``name.field``.

    In a file of one struct or timetable the fields are also known by their own names.

    Raises
    ------
    InputError
        If mat-io is missing and needed, or the file is damaged or contains no vector.
    """
    with faults(file, "MATLAB file"):
        (variables, stated), vectors = _contents(file)
    units = {name: unit for name, text in stated.items() if (unit := unit_or_none(text))}
    groups: dict[tuple[str, int], dict[str, Any]] = {}
    lengths = {len(values) for values in vectors.values()}
    for name, values in vectors.items():  # all of one length are one table; else each struct has its own
        struct = name.partition(".")[0] if len(lengths) > 1 and "." in name else ""
        groups.setdefault((struct, len(values)), {})[name] = values
    if not groups:
        raise InputError(
            f"{file}: expected vectors of numbers, found {', '.join(variables[:5]) or 'nothing'}"
        )
    longest = {struct: max(n for own, n in groups if own == struct) for struct, _ in groups}
    tables = [
        _table(
            file, struct if struct and n == longest[struct] else f"{struct} {n} rows".strip(), columns, units
        )
        for (struct, n), columns in groups.items()
    ]
    short = {name.partition(".")[2]: name for name in vectors} if len(variables) == 1 else {}
    return Tables(file, tables, {own: name for own, name in short.items() if own})


def _contents(file: Path) -> tuple[tuple[list[str], dict[str, str]], dict[str, Any]]:
    """Return variables, stated units and vectors: by SciPy, or by mat-io (version 7.3, tables)."""
    from scipy.io import loadmat

    with file.open("rb") as stream:
        head = stream.read(520)
    hdf = b"\x89HDF\r\n" in (head[:6], head[512:518])  # with a header of 512 bytes or without
    what = "MATLAB files of version 7.3"
    if not hdf and not head.startswith(b"MATLAB 7.3"):
        found: dict[str, Any] = loadmat(file, squeeze_me=False, struct_as_record=True)
        if not any(type(value).__name__ == "MatlabOpaque" for value in found.values()):
            return vectors_of(found)
        what = "timetables and tables of MATLAB"
    return Apart(file, matlab_script, "matio", what, package="mat-io").call("contents", str(file))


def _table(file: Path, name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    clocks = [name for name in columns if name.rpartition(".")[2].lower() in CLOCKS]
    clock = min(clocks, key=lambda clock: CLOCKS.index(clock.rpartition(".")[2].lower()), default="")
    return Table.of(file, name, columns, clock, units)
