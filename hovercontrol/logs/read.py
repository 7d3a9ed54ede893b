"""Reading a log from a file, with one-line error messages.

Files are read in pieces, so that memory use stays near the size of the columns that are kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import ArgumentError, InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.plant_model import PlantModel
from hovercontrol.logs.check import (
    check_codes,
    check_days,
    check_finite,
    check_heading,
    check_size,
    check_time,
)
from hovercontrol.logs.column_units import (
    column_of,
    conversion_to_si,
    conversions_of_file,
    unit_hints,
    with_angles,
)
from hovercontrol.logs.derived import Derived, with_derived
from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log
from hovercontrol.logs.readers.tables import Table, Tables
from hovercontrol.logs.required_columns import RequiredColumns
from hovercontrol.logs.source import Source, open_log
from hovercontrol.logs.topics import join_tables
from hovercontrol.logs.trials import in_sequence, trial_rows, trials_text

LARGEST = 2**30
"""Bytes of numbers that one log may take in memory."""


@checked
def read_log(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    inputs: Sequence[str] | Mapping[str, str] = (),
    *,
    model: PlantModel | Block | None = None,
    motion: bool = False,
    usecols: Sequence[str] | None = None,
    missing: Sequence[float] = (),
    trial: str = "",
    period: float | None = None,
) -> Log:
    r"""Read a log from CSV, Parquet or another of the formats in :data:`~hovercontrol.logs.source.FORMATS`.

    Time, pose, body velocities, the columns of the model, the required inputs and every column named by
    the caller are checked: values must be plausible, time must increase, and the heading must not be in
    degrees. A blank or NaN cell is a missing sample, except in the time column, where it is an error. Other
    columns are kept unchecked if they contain numbers, and left out if they contain text.

    A file may contain several trials. A new one begins where time restarts, where time pauses for more than
    30 s and more than 100 time steps, or where the column `trial` changes. ``Log.trials`` gives their first
    rows, and ``Log.notes`` describes them.

    Parameters
    ----------
    path : str or Path
        The format is recognised by the content, else by the suffix; any other file is read as CSV.
    columns : mapping, optional
        Signal name to the file's column name, ``{"time": "stamp"}``. A unit follows if it is not SI,
        ``{"psi": "yaw:deg"}``; a minus before the unit flips the sign, ``{"rudder": "servo:-deg"}``.
        ``{"time": "sec+nanosec"}`` adds two time columns, and ``{"psi": "qx,qy,qz,qw:z-up"}`` computes the
        heading from a quaternion (:mod:`.heading`). ``{"x": "lat,lon:east"}`` is the distance [m] east of the
        first fix. In a file with topics columns are named ``topic/field``.
    inputs : sequence of str, or mapping of str to str
        Columns required besides ``time``; a mapping also gives the units that they are converted to.
    model : Model, BlockModel or Block, optional
        Model of the logged system. Its inputs are required; for a craft also all of ``x, y, psi`` or all of
        ``u, v, r``, and for any other system at least one output or state. Default: only ``time`` is
        required.
    motion : bool, optional
        Whether all of ``x, y, psi`` or all of ``u, v, r`` are required even without a model.
    usecols : sequence of str, optional
        The only columns to keep besides ``time`` and ``inputs`` (by signal name).
    missing : sequence of float, optional
        Numbers in the file that mean a missing value, in any column except ``time``: ``[-999]``.
    trial : str, optional
        A column with a number for each trial. Rows in which it is blank belong to no trial and are left out.
    period : float, optional
        Time between two rows [s], positive, of a file without a column of time.

    Returns
    -------
    Log
        Named after the file, in SI units. Columns of the file must be in SI units unless `columns` or the
        file itself states another unit. Rows may be missing: see ``Log.gaps``.

    Raises
    ------
    ArgumentError
        If `columns` or `trial` names a column that the file does not have, or one twice, or an unknown unit;
        or if `period` is not positive, or the file has a time.
    InputError
        If the file is invalid. The message names the line (the header is line 1; in Parquet the row, from
        1), the column, and the expected and the found value. More than 1 GiB of numbers is an error.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "demo.csv"
    ...     _ = file.write_text("stamp,u,v,r\n0,1,0,0\n100,1,0,0\n")
    ...     read_log(file, columns={"time": "stamp:ms"}).time
    array([0. , 0.1])
    """
    of = RequiredColumns.of(model, inputs, motion)
    return read_wanted(path, columns, of, usecols, missing=missing, trial=trial, period=period)


def read_wanted(
    path: str | Path,
    columns: Mapping[str, str] | None,
    wanted: RequiredColumns,
    usecols: Sequence[str] | None = None,
    *,
    missing: Sequence[float] = (),
    trial: str = "",
    period: float | None = None,
) -> Log:
    """Return a log as :func:`read_log` does, with the required columns given by `wanted`."""
    file, given = Path(path), columns or {}
    opened = open_log(file)
    if not isinstance(opened, Tables):
        return _read_source(file, opened, given, wanted, usecols, missing, trial, period)

    def read(table: Table, own: Mapping[str, str], inputs: Mapping[str, str], usecols: Sequence[str]) -> Log:
        return _read_source(file, table, own, RequiredColumns(inputs), usecols, missing, period=period)

    return join_tables(opened, given, wanted, read, clocked=period is None)


def _read_source(
    file: Path,
    opened: Source,
    columns: Mapping[str, str],
    wanted: RequiredColumns,
    usecols: Sequence[str] | None,
    missing: Sequence[float] = (),
    trial: str = "",
    period: float | None = None,
) -> Log:
    """Read a log from one table, as described in :func:`read_log`."""
    source = with_derived(file, opened, columns, period)
    said = {ours: column_of(theirs, source.header) for ours, theirs in columns.items()}
    renamed = {ours: theirs for ours, (theirs, _) in said.items()}
    units = {**wanted.outputs, **wanted.inputs}
    names = _our_names(str(file), source.header, renamed)
    stated = with_angles(source.units, source.angles, names, units)
    conversions = _conversions(said, stated, units)
    conversions |= conversions_of_file(str(file), stated, names, conversions, units)
    if trial and trial not in names:
        raise ArgumentError(f"{file}: no column {trial!r} to tell trials by{did_you_mean(trial, names)}")
    needed = wanted.needed(*(usecols or ()), *filter(None, [trial]))
    replace(wanted, inputs=needed).check(str(file), list(names), stated)
    if usecols is not None:
        names = {ours: theirs for ours, theirs in names.items() if ours in needed}
    measured = {*POSE, *VELOCITY, *wanted.outputs} - wanted.inputs.keys()
    checked = names.keys() & {*needed, *renamed, *measured}
    numeric = source.numeric()
    names = {k: v for k, v in names.items() if k in checked or v in numeric}

    data = _gather(str(file), source, names)
    if not data["time"].size:
        raise InputError(f"{file}: expected samples below the header, found no rows")
    _convert(data, conversions, missing)
    own = {k: v for k, v in names.items() if k in checked}
    _check_values(str(file), source, own, data, measured)
    firsts = trial_rows(data["time"], data.get(trial))
    copies = copied_rows(data)
    check_time(str(file), source, names["time"], data["time"], firsts, copies)
    check_days(str(file), names["time"], data["time"], conversions)
    left_out: list[str] = []
    if copies.size:
        left_out = [f"{file}: {copies.size:,} copies of the row before: left out"]
        firsts = firsts - np.searchsorted(copies, firsts)
        data = {name: np.delete(column, copies) for name, column in data.items()}
    if "psi" in data:
        check_heading(str(file), names["psi"], data["time"], data["psi"], data.get("r"))
    log = _log(file.name, data, firsts, trial)
    known = {*conversions, *(ours for ours, theirs in names.items() if theirs in stated)}
    remarks: Sequence[str] = ()
    if isinstance(source, Derived):
        remarks = source.remarks
        if source.stamps:
            known.add("time")
            log = replace(log, origin=source.stamps.origin or 0)
    notes = [f"{file}: read with {source.said}"] if source.said else []
    notes += unit_hints(str(file), own, known, units)
    notes += [f"{file}: {text}" for text in remarks]
    return replace(log, notes=(*notes, *left_out, *log.notes))


def _conversions(
    said: Mapping[str, tuple[str, str]], stated: Mapping[str, str], units: Mapping[str, str]
) -> dict[str, tuple[float, float]]:
    """Return factor and offset to SI of the columns whose unit the caller says; - turns the file's around."""
    own = {
        ours: f"-{stated.get(theirs, '')}" if unit == "-" else unit for ours, (theirs, unit) in said.items()
    }
    return {o: conversion_to_si(o, unit, units.get(o, "")) for o, unit in own.items() if unit}


def _convert(
    data: dict[str, Floats], conversions: Mapping[str, tuple[float, float]], missing: Sequence[float]
) -> None:
    """Replace the numbers that stand for a missing value, then convert columns to SI."""
    for ours in data.keys() - {"time"} if missing else ():
        data[ours][np.isin(data[ours], missing)] = np.nan
    for ours in conversions.keys() & data.keys():
        factor, offset = conversions[ours]
        data[ours] *= factor
        data[ours] += offset


def _check_values(
    file: str, source: Source, names: Mapping[str, str], data: Mapping[str, Floats], measured: Set[str]
) -> None:
    """Raise if a column's values cannot be of its signal: codes in a measured one, or numbers too large."""
    for ours, theirs in names.items():
        if ours == "time":
            check_finite(file, source, theirs, data[ours])
            continue
        check_codes(file, source, theirs, data[ours], any_number=ours in measured)
        check_size(file, source, theirs, data[ours])


def copied_rows(data: Mapping[str, Floats]) -> NDArray[np.intp]:
    """Return the rows that equal the row before in time and in every other column.

    Examples
    --------
    >>> copied_rows({"time": np.array([0.0, 1.0, 1.0, 1.0]), "x": np.array([0.0, np.nan, np.nan, 2.0])})
    array([2])
    """
    rows = np.flatnonzero(np.diff(data["time"]) == 0.0) + 1
    for column in data.values():
        rows = rows[
            (column[rows] == column[rows - 1]) | (np.isnan(column[rows]) & np.isnan(column[rows - 1]))
        ]
    return rows


def _log(name: str, data: dict[str, Floats], firsts: NDArray[np.intp], trial: str) -> Log:
    """Return a log with its trials; rows that belong to no trial are left out."""
    if not firsts.size:
        return Log(name, data.pop("time"), data)
    time, trials = in_sequence(data.pop("time"), firsts)
    log = Log(name, time, data, trials=trials)
    notes = []
    if trial and not (known := np.isfinite(log[trial])).all():
        log = log.select(known)
        notes.append(f"{name}: {(~known).sum():,} rows with no {trial!r}: left out")
    said = [trials_text(name, log.trials, trial)] if log.trials else []
    return replace(log, notes=(*said, *notes))


def names_in(path: Path, columns: Mapping[str, str]) -> dict[str, str]:
    """Return the file's column name for each signal name, without reading the numbers.

    Raises
    ------
    InputError
        As :func:`read_log`.
    """
    header = header_of(path, columns)
    return _our_names(str(path), header, {k: column_of(v, header)[0] for k, v in columns.items()})


def header_of(path: Path, columns: Mapping[str, str]) -> list[str]:
    """Return a file's column names, and the names of columns that ``--columns`` derives from them.

    Raises
    ------
    InputError
        As :func:`read_log`.
    """
    opened = open_log(path)
    if isinstance(opened, Tables):
        return [*opened.header, *(said for said in columns.values() if said not in opened.header)]
    return with_derived(path, opened, columns).header


def _our_names(file: str, header: list[str], renamed: Mapping[str, str]) -> dict[str, str]:
    """Return the file's column name for each signal name, in the file's order."""
    ours_of: dict[str, str] = {}
    for ours, theirs in renamed.items():
        if theirs not in header:
            raise ArgumentError(
                f"{file}: no column {theirs!r} to read {ours!r} from"
                f"{did_you_mean(theirs, filter(None, header))}"
            )
        if theirs in ours_of:
            raise ArgumentError(
                f"{file}: column {theirs!r} is to be both {ours_of[theirs]!r} and {ours!r}; name it once"
            )
        ours_of[theirs] = ours
    kept = [name for name in header if name in ours_of or (name and name not in renamed)]
    return {ours_of.get(theirs, theirs): theirs for theirs in kept}


def _gather(file: str, source: Source, names: Mapping[str, str]) -> dict[str, Floats]:
    """Read columns in pieces into one array each."""
    expected = source.rows_expected()
    _check_size(file, expected, len(names))
    data = {ours: np.empty(expected + expected // 50 + 1) for ours in names}
    rows = 0
    for batch in source.batches(list(names.values())):
        start, rows = rows, rows + batch.num_rows
        _check_size(file, rows, len(names))
        for ours, theirs in names.items():
            if rows > data[ours].size:  # the estimate was too small
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
