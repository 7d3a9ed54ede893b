"""One log from a file with several tables, each on its own clock, such as the topics of a flight log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.base.errors import ArgumentError, InputError, did_you_mean
from hovercontrol.logs.column_units import column_of
from hovercontrol.logs.derived import parts_of
from hovercontrol.logs.join import join_logs
from hovercontrol.logs.log import POSE, VELOCITY, Log, gap_rows
from hovercontrol.logs.readers.tables import Table, Tables
from hovercontrol.logs.required_columns import RequiredColumns

#: Reads columns of one table into a log, like :func:`.read.read_log` for a file.
ReadTable = Callable[..., Log]


def join_tables(
    file: Tables,
    columns: Mapping[str, str],
    wanted: RequiredColumns,
    read: ReadTable,
    *,
    clocked: bool = True,
) -> Log:
    """Return the named columns of several tables as one log.

    The rows are those of the table with most of the measured columns. Measured columns of other tables are
    interpolated linearly, and commands are held (:func:`~hovercontrol.logs.join.join_logs`).

    Parameters
    ----------
    columns : mapping
        Signal name to the file's column name.
    wanted : RequiredColumns
        Columns that the log must have; its inputs are commands.
    read : callable
        See :data:`ReadTable`.
    clocked : bool, optional
        Whether each table must have a column of time; else `read` knows the time of those without.

    Raises
    ------
    ArgumentError
        If no table has a column.
    InputError
        If no column is named, or two tables have no time in common.
    """
    columns = {ours: _named(file, said) for ours, said in columns.items()}
    inputs, measured = wanted.inputs, (*POSE, *VELOCITY, *wanted.outputs)
    own = {k: file.named(k) for k in ("time", *measured, *inputs)}
    said = {**{k: name for k, name in own.items() if file.table_of(name)}, **columns}
    clocks = {k: v for k, v in said.items() if k == "time"}
    named = {k: v for k, v in said.items() if k != "time"}
    if not named or (wanted.motion and not named.keys() & {*POSE, *VELOCITY}):
        raise InputError(
            f"{file.file}: {len(file.tables)} topics, and none of the columns is named "
            f"{', '.join(wanted.outputs or measured)}: --columns {next(iter(wanted.outputs or measured))}="
            f"TOPIC/FIELD,... (hovercontrol check {file.file} lists the columns)"
        )
    by_table: dict[str, dict[str, str]] = {}
    tables = {table.name: table for table in file.tables}
    for ours, theirs in named.items():
        by_table.setdefault(_table(file, ours, theirs).name, {})[ours] = theirs
    missing = [name for name in inputs if name not in named]
    if missing:
        raise InputError(f"{file.file}: no column {missing[0]!r} (--columns {missing[0]}=TOPIC/FIELD)")
    logs = []
    for name, own in by_table.items():
        clock = _clock(file, tables[name], clocks, needed=clocked)
        needed = {k: v for k, v in inputs.items() if k in own}
        logs.append(read(tables[name], {**clock, **own}, needed, usecols=list(own)))
    commands = set(inputs) or {k for k in named if k not in measured}
    if not set(named) - commands:
        commands = set()
    return _joined(file.file.name, logs, commands)


def _clock(file: Tables, table: Table, clocks: dict[str, str], *, needed: bool) -> dict[str, str]:
    """Return the column of time of a table: the one that the user names, else its own."""
    if clocks and _table(file, "time", clocks["time"]) is table:
        return clocks
    if not table.clock and needed:
        why = f" ({table.said})" if table.said else ""
        raise InputError(
            f"{file.file}: {table.name}: no column of time is known{why}: --columns time=NAME; rows at a "
            "known period: --period SECONDS"
        )
    return {"time": table.clock} if table.clock else {}


def _named(file: Tables, said: str) -> str:
    """Return a column specification with the file's own names."""
    for part in parts_of(said, file.header):
        name = column_of(part, file.header)[0]
        said = said.replace(name, file.named(name))
    return said


def _table(file: Tables, ours: str, said: str) -> Table:
    """Return the table that has a column, or all parts of a derived column."""
    found = file.table_of(column_of(parts_of(said, file.header)[0], file.header)[0])
    if found:
        return found
    hint = did_you_mean(column_of(said, file.header)[0], file.header)
    raise ArgumentError(f"{file.file}: no column {said!r} to read {ours!r} from{hint}")


def _joined(name: str, logs: Sequence[Log], commands: set[str]) -> Log:
    """Return measured columns at the times of the log with most of them, and the commands held there."""
    measured = [(log, [k for k in log.columns if k not in commands]) for log in logs]
    base, own = max(measured, key=lambda pair: len(pair[1]))
    kept = Log(name, base.time, {k: base[k] for k in own}, origin=base.origin)
    for log, names in measured:
        if log is not base and names:
            kept = _interpolated(kept, log.on_clock_of(base), names)
    sent = [
        Log(log.name, log.time, {k: log[k] for k in log.columns if k in commands}, origin=log.origin)
        for log in logs
        if commands & log.columns.keys()
    ]
    if sent and len(logs) == 1:
        kept = kept.with_columns({k: base[k] for k in base.columns if k in commands})
    elif sent:
        kept = join_logs(kept, _held([log.on_clock_of(base) for log in sent]))
    return replace(kept, notes=tuple(dict.fromkeys(note for log in logs for note in log.notes)))


def _interpolated(log: Log, other: Log, names: Sequence[str]) -> Log:
    """Add columns of another log, interpolated linearly; rows outside it or in its gaps are left out."""
    inside = (log.time >= other.time[0]) & (log.time <= other.time[-1])
    for row in gap_rows(other.time):
        inside &= (log.time <= other.time[row - 1]) | (log.time >= other.time[row])
    if not inside.any():
        raise InputError(
            f"{log.name}: no time in common: {', '.join(log.columns)} from {log.time[0]:g} to "
            f"{log.time[-1]:g} s, {', '.join(names)} from {other.time[0]:g} to {other.time[-1]:g} s"
        )
    kept = log.select(inside)
    values = {k: np.unwrap(other[k]) if k == "psi" else other[k] for k in names}
    return kept.with_columns({k: np.interp(kept.time, other.time, v) for k, v in values.items()})


def _held(logs: Sequence[Log]) -> Log:
    """Return commands of several logs as one log, from the time at which all are known; each is held."""
    if len(logs) == 1:
        return logs[0]
    time = np.unique(np.concatenate([log.time for log in logs]))
    time = time[time >= max(log.time[0] for log in logs)]
    held = {
        k: v[np.searchsorted(log.time, time, side="right") - 1]
        for log in logs
        for k, v in log.columns.items()
    }
    return Log(" + ".join(dict.fromkeys(log.name for log in logs)), time, held, origin=logs[0].origin)
