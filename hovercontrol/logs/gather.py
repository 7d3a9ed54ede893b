"""One run of a craft from its files: poses, commands, a bench table and the selection of rows."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import ArgumentError, InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.plant_model import PlantModel
from hovercontrol.logs.bench import BenchTable
from hovercontrol.logs.check import check_gaps
from hovercontrol.logs.column_units import column_of
from hovercontrol.logs.derived import parts_of
from hovercontrol.logs.join import join_logs
from hovercontrol.logs.log import Log
from hovercontrol.logs.prepare import held_on
from hovercontrol.logs.read import header_of, names_in, read_wanted
from hovercontrol.logs.required_columns import RequiredColumns

#: Prefix of a command column that a bench table converts to the force of a fan: ``pwm_`` and the fan's name.
PULSE = "pwm_"

_COMPARE = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


@checked
@dataclass(frozen=True)
class Condition:
    """A comparison of a column with a number, in the user's notation: ``pwm_lift > 1000``.

    Parameters
    ----------
    column : str
    comparison : {">", ">=", "<", "<="}
    value : float
        In the column's unit.
    """

    column: str
    comparison: str
    value: float

    @classmethod
    def parse(cls, text: str) -> Condition:
        """Parse a condition.

        Parameters
        ----------
        text : str
            ``"pwm_lift > 1000"``; the number in the column's unit.

        Raises
        ------
        ArgumentError
            If it does not consist of COLUMN, one of > >= < <=, and NUMBER.

        Examples
        --------
        >>> Condition.parse("pwm_lift > 1000")
        Condition(column='pwm_lift', comparison='>', value=1000.0)
        """
        found = re.fullmatch(r"\s*(\w+)\s*(>=|<=|>|<)\s*([-+.\deE]+)\s*", text)
        try:
            return cls(found[1], found[2], float(found[3]))  # type: ignore[index]
        except (TypeError, ValueError):
            raise ArgumentError(f"expected a condition like 'pwm_lift>1000', found {text!r}") from None


@checked
def gather(
    files: str,
    inputs: Sequence[str] | Mapping[str, str] = (),
    *,
    columns: Mapping[str, str] | None = None,
    bench: BenchTable | None = None,
    only_while: Condition | None = None,
    settle: float = 0.0,
    model: PlantModel | Block | None = None,
    motion: bool = False,
    missing: Sequence[float] = (),
    trial: str = "",
    period: float | None = None,
) -> Log:
    r"""Return one run as one log.

    If rows are missing, a warning gives the number of gaps.

    Parameters
    ----------
    files : str
        A log's path, or ``POSE.csv+COMMANDS.csv`` for a run whose commands are in a separate file
        on the same clock. Commands are held between their rows.
    inputs : sequence of str, or mapping of str to str, optional
        The plant's inputs, which the log must have; a mapping also gives their units.
    columns : mapping, optional
        Signal name to the files' column name, ``{"time": "stamp", "psi": "yaw:deg"}``; each is looked up in
        the file that has it. If both files have the column, ``{"u": "torque.csv:xyz[2]"}`` selects one.
    bench : BenchTable, optional
        Converts a column ``pwm_rear_left`` to an input ``rear_left`` [N].
    only_while : Condition, optional
        Keep the longest stretch in which it holds.
    settle : float, optional
        Time left out at the beginning of that stretch [s].
    model : Model, BlockModel or Block, optional
        Model of the system, as for :func:`read_log`; its inputs are added to `inputs`.
    motion : bool, optional
        As for :func:`read_log`.
    missing : sequence of float, optional
        Numbers in the files that mean a missing value.
    trial : str, optional
        Column with the number of the trial, in the file with the measurements.
    period : float, optional
        Time between two rows [s] of files without a column of time.

    Returns
    -------
    Log

    Raises
    ------
    ArgumentError
        If a name or a unit of `columns`, the condition or `period` does not fit the files.
    InputError
        As :func:`read_log` and :func:`join_logs`; or if an input is missing, no row is left, or the gaps
        are longer in total than the rest of the log.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     rows = [f"{0.02 * k},0,0,0,1" for k in range(50)]
    ...     _ = file.write_text("\n".join(["stamp,u,v,r,thrust", *rows]))
    ...     len(gather(str(file), ["thrust"], columns={"time": "stamp"}))
    50
    """
    wanted = RequiredColumns.of(model, inputs, motion)
    units = wanted.inputs
    sent = {f"{PULSE}{name}": "" for name in units} if bench else dict(units)
    extra = {only_while.column: ""} if only_while and only_while.column != "time" else {}
    paths = split_files(files)
    own = columns_by_file(paths, columns or {})
    _check_columns(paths[-1], own[-1], extra)
    if len(paths) == 1:
        log = measured = read_wanted(
            paths[0],
            own[0],
            replace(wanted, inputs=sent | extra),
            missing=missing,
            trial=trial,
            period=period,
        )
    else:
        pose, commands = paths
        given = read_wanted(commands, own[1], RequiredColumns(sent | extra), missing=missing, period=period)
        seen = replace(wanted, inputs={})
        measured = read_wanted(pose, own[0], seen, missing=missing, trial=trial, period=period)
        log = join_logs(*_each_once(measured, given, own, sent))
    if bench:
        log = bench.apply(log, dict(zip(sent, units, strict=True)))
    log = _longest(log, only_while, settle) if only_while else log
    check_gaps(measured.between(log.time[0], log.time[-1]))
    return log


def split_files(files: str) -> list[Path]:
    """Return the file of a log, or the two (pose, commands) of ``POSE+COMMANDS``.

    Raises
    ------
    InputError
        If there are more than two.
    """
    if Path(files).exists() or "+" not in files:
        return [Path(files)]
    paths = [Path(part) for part in files.split("+")]
    if len(paths) != 2:
        raise InputError(f"{files}: expected POSE+COMMANDS, two files, found {len(paths)}")
    return paths


def _check_columns(file: Path, columns: Mapping[str, str], conditions: Iterable[str]) -> None:
    """Raise if a condition is of a column that the file does not have."""
    for name in conditions:
        if name not in (known := names_in(file, columns)):
            raise ArgumentError(f"{file}: condition: no column {name!r}{did_you_mean(name, known)}")


def columns_by_file(paths: Sequence[Path], columns: Mapping[str, str]) -> list[dict[str, str]]:
    """Return the renamed columns of each file of a run, without the file name as prefix.

    A column that no file has is assigned to the first file.

    Raises
    ------
    ArgumentError
        If both files have a column and neither is selected.
    """
    headers = [header_of(path, {}) for path in paths]
    found: list[dict[str, str]] = [{} for _ in paths]
    for ours, said in columns.items():
        named = [(k, rest) for k, path in enumerate(paths) if (rest := _in_file(said, path, headers[k]))]
        there = [(k, said) for k, names in enumerate(headers) if _has(said, names)]
        chosen = named or there or [(0, said)]
        if len(chosen) > 1 and ours != "time":
            column = column_of(chosen[0][1], headers[chosen[0][0]])[0]
            one, other = paths
            raise ArgumentError(
                f"{one}: column {column!r}, to be {ours!r}, is also in {other}: name the file, "
                f"--columns {ours}={one if one.name == other.name else one.name}:{said}"
            )
        for k, rest in chosen:
            found[k][ours] = rest
    return found


def _has(said: str, header: Sequence[str]) -> bool:
    """Return whether a file has all columns of a specification: one, those of a rotation or of a stamp."""
    return all(column_of(part, header)[0] in header for part in parts_of(said, header))


def _in_file(said: str, path: Path, header: Sequence[str]) -> str:
    """Return a column specification without its file name; empty if it does not name this file."""
    if _has(said, header):
        return ""
    for name in (str(path), path.name):
        if said.startswith(f"{name}:"):
            return said.removeprefix(f"{name}:")
    return ""


def _each_once(
    measured: Log, sent: Log, own: Sequence[Mapping[str, str]], inputs: Iterable[str]
) -> tuple[Log, Log]:
    """Return the logs of two files without common columns; the first file's column is kept by default.

    Raises
    ------
    ArgumentError
        If both have a command column and neither is selected.
    """
    for name in sorted(measured.columns.keys() & sent.columns.keys()):
        if name in own[1] and name not in own[0]:
            measured = _without(measured, name)
        elif name in inputs and name not in own[0]:
            raise ArgumentError(
                f"{measured.name}: column {name!r} is also in {sent.name}: name the file, "
                f"--columns {name}={sent.name}:{name}"
            )
        else:
            sent = _without(sent, name)
    return measured, sent


def _without(log: Log, name: str) -> Log:
    return replace(log, columns={k: v for k, v in log.columns.items() if k != name})


def _longest(log: Log, condition: Condition, settle: float) -> Log:
    column = log.time if condition.column == "time" else held_on(log[condition.column])
    holds = _COMPARE[condition.comparison](column, condition.value)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    if not edges.size:
        text = f"{condition.column} {condition.comparison} {condition.value:g}"
        raise ArgumentError(f"{log.name}: {text} holds in no row")
    starts, stops = edges[::2], edges[1::2]
    k = int(np.argmax(log.time[stops - 1] - log.time[starts]))
    kept = log.between(log.time[starts[k]] + settle, log.time[stops[k] - 1])
    if not len(kept):
        raise ArgumentError(f"{log.name}: nothing is left after {settle:g} s to settle")
    return kept
