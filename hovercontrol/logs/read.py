"""Reading a log from a CSV or Parquet file, with errors of one line.

Files are read in pieces, so memory stays near the size of the numbers that are kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from hovercontrol.core.boundary import checked
from hovercontrol.errors import ArgumentError, InputError, did_you_mean
from hovercontrol.logs.check import check_codes, check_finite, check_heading, check_time
from hovercontrol.logs.column_units import column_of, factor_to_si
from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log
from hovercontrol.logs.source import Source, open_source
from hovercontrol.logs.wanted import Wanted

if TYPE_CHECKING:
    from hovercontrol.models.interface import AnyModel

LARGEST = 2**30
"""Bytes of numbers that one log may take in memory."""


@checked
def read_log(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    inputs: Sequence[str] | Mapping[str, str] = (),
    *,
    model: AnyModel | None = None,
    motion: bool = False,
    usecols: Sequence[str] | None = None,
) -> Log:
    r"""Read a log from CSV (commas, header) or Parquet.

    Time, pose, body velocities, the columns of the model, the wanted inputs and every column named by
    the caller are checked: finite numbers, time increasing, heading not in degrees. Other columns are
    kept unchecked if they hold numbers, and left out if they hold text.

    Parameters
    ----------
    path : str or Path
        ``.parquet`` and ``.pq`` are read as Parquet, everything else as CSV.
    columns : mapping, optional
        Our column name to the file's, ``{"time": "stamp"}``; with a unit where it is not SI,
        ``{"psi": "yaw:deg"}``; a minus before it turns the sign, ``{"rudder": "servo:-deg"}``.
    inputs : sequence of str, or mapping of str to str
        Columns that must be there besides ``time``; with the units that they are to have.
    model : Model, BlockModel or Block, optional
        What the log is of: its inputs must be there, and of a craft all of ``x, y, psi`` or all of
        ``u, v, r``, of any other machine at least one output or state. Default: no column but ``time`` is
        needed.
    motion : bool, optional
        Whether all of ``x, y, psi`` or all of ``u, v, r`` must be there without a model, too.
    usecols : sequence of str, optional
        The only columns to keep besides ``time`` and ``inputs`` (our names).

    Returns
    -------
    Log
        Named after the file; in SI units, which the file must have where `columns` says no other. Rows
        may be missing: ``Log.gaps`` tells where.

    Raises
    ------
    ArgumentError
        If `columns` names a column that the file does not have, or one twice, or an unknown unit.
    InputError
        Anything wrong with the file: which line (the header is line 1; in Parquet which row, from
        1), which column, what was expected and what was found. Over 1 GiB of numbers is refused.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "demo.csv"
    ...     _ = file.write_text("stamp,u,v,r\n0,1,0,0\n100,1,0,0\n")
    ...     read_log(file, columns={"time": "stamp:ms"}).time
    array([0. , 0.1])
    """
    return read_wanted(path, columns, Wanted.of(model, inputs, motion), usecols)


def read_wanted(
    path: str | Path,
    columns: Mapping[str, str] | None,
    wanted: Wanted,
    usecols: Sequence[str] | None = None,
) -> Log:
    """Return a log as :func:`read_log`, with the columns that are wanted."""
    file = Path(path)
    source = open_source(file)
    said = {ours: column_of(theirs, source.header) for ours, theirs in (columns or {}).items()}
    renamed = {ours: theirs for ours, (theirs, _) in said.items()}
    units = {**wanted.outputs, **wanted.inputs}
    factors = {
        ours: factor_to_si(ours, unit, units.get(ours, "")) for ours, (_, unit) in said.items() if unit
    }
    names = _our_names(str(file), source.header, renamed)
    needed = dict.fromkeys(("time", *wanted.inputs, *(usecols or ())), "")
    replace(wanted, inputs=needed).check(str(file), list(names))
    if usecols is not None:
        names = {ours: theirs for ours, theirs in names.items() if ours in needed}
    measured = {*POSE, *VELOCITY, *wanted.outputs} - wanted.inputs.keys()
    checked = names.keys() & {*needed, *renamed, *measured}
    numeric = source.numeric()
    names = {k: v for k, v in names.items() if k in checked or v in numeric}

    data = _gather(str(file), source, names)
    for ours, factor in factors.items():
        if ours in data:
            data[ours] *= factor
    time = data["time"]
    if not time.size:
        raise InputError(f"{file}: expected samples below the header, found no rows")
    for ours in (name for name in names if name in checked):
        if ours != "time":
            any_number = ours in measured
            check_codes(str(file), source, names[ours], data[ours], any_number=any_number)
        check_finite(str(file), source, names[ours], data[ours])
    check_time(str(file), source, names["time"], time)
    if "psi" in data:
        check_heading(str(file), names["psi"], time, data["psi"], data.get("r"))
    return Log(file.name, data.pop("time"), data)


def names_in(path: Path, columns: Mapping[str, str]) -> dict[str, str]:
    """Return a file's column name under each of ours; its numbers are not read.

    Raises
    ------
    InputError
        As :func:`read_log`.
    """
    header = open_source(path).header
    return _our_names(str(path), header, {k: column_of(v, header)[0] for k, v in columns.items()})


def _our_names(file: str, header: list[str], renamed: Mapping[str, str]) -> dict[str, str]:
    """Return the file's column name under each of ours, in the file's order."""
    ours_of: dict[str, str] = {}
    for ours, theirs in renamed.items():
        if theirs not in header:
            raise ArgumentError(
                f"{file}: no column {theirs!r} to read {ours!r} from{did_you_mean(theirs, header)}"
            )
        if theirs in ours_of:
            raise ArgumentError(
                f"{file}: column {theirs!r} is to be both {ours_of[theirs]!r} and {ours!r}; name it once"
            )
        ours_of[theirs] = ours
    kept = [name for name in header if name in ours_of or (name and name not in renamed)]
    return {ours_of.get(theirs, theirs): theirs for theirs in kept}


def _gather(file: str, source: Source, names: Mapping[str, str]) -> dict[str, Floats]:
    """Read columns piece by piece into one array each."""
    expected = source.rows_expected()
    _check_size(file, expected, len(names))
    data = {ours: np.empty(expected + expected // 50 + 1) for ours in names}
    rows = 0
    for batch in source.batches(list(names.values())):
        start, rows = rows, rows + batch.num_rows
        _check_size(file, rows, len(names))
        for ours, theirs in names.items():
            if rows > data[ours].size:  # the estimate was short
                data[ours].resize(rows + rows // 4, refcheck=False)
            values = batch.column(theirs).cast(pa.float64(), safe=False)
            data[ours][start:rows] = values.to_numpy(zero_copy_only=False)
    for column in data.values():
        column.resize(rows, refcheck=False)
    return data


def _check_size(file: str, rows: int, columns: int) -> None:
    size = 8 * rows * columns
    if size > LARGEST:
        raise InputError(
            f"{file}: expected at most {LARGEST / 2**30:.0f} GiB of numbers, found about "
            f"{size / 2**30:.1f} GiB ({rows} rows of {columns} columns); cut the file"
        )
