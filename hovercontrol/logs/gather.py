"""One run of a craft from its files: poses, commands, bench table, rows to use."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.core.boundary import checked
from hovercontrol.errors import ArgumentError, InputError, did_you_mean
from hovercontrol.logs.bench import BenchTable
from hovercontrol.logs.check import check_gaps
from hovercontrol.logs.column_units import column_of
from hovercontrol.logs.join import join_logs
from hovercontrol.logs.log import Log
from hovercontrol.logs.read import names_in, read_wanted
from hovercontrol.logs.wanted import Wanted

if TYPE_CHECKING:
    from hovercontrol.models.interface import AnyModel

#: What a bench table turns into the force of a fan carries the fan's name behind this.
PULSE = "pwm_"

_COMPARE = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


@checked
@dataclass(frozen=True)
class Condition:
    """A comparison of one column with a number, as a user writes it: ``pwm_lift > 1000``.

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
        """Read a condition.

        Parameters
        ----------
        text : str
            ``"pwm_lift > 1000"``; the number in the column's unit.

        Raises
        ------
        ArgumentError
            If it is not COLUMN, one of > >= < <=, NUMBER.

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
    model: AnyModel | None = None,
    motion: bool = False,
) -> Log:
    r"""Return one run as one log.

    Rows may be missing: a warning counts the gaps.

    Parameters
    ----------
    files : str
        A log's path, or ``POSE.csv+COMMANDS.csv`` for a run whose commands are a file of their own
        on the same clock; they are held between their rows.
    inputs : sequence of str, or mapping of str to str, optional
        The plant's inputs, which the log must have; with their units.
    columns : mapping, optional
        Our column name to the files', ``{"time": "stamp", "psi": "yaw:deg"}``; each is looked up in the
        file that has it.
    bench : BenchTable, optional
        Makes an input ``rear_left`` [N] of a column ``pwm_rear_left``.
    only_while : Condition, optional
        Keep the longest stretch in which it holds.
    settle : float, optional
        Seconds left out at the beginning of that stretch.
    model : Model, BlockModel or Block, optional
        What the run is of, as for :func:`read_log`: its inputs count among `inputs`.
    motion : bool, optional
        As for :func:`read_log`.

    Returns
    -------
    Log

    Raises
    ------
    ArgumentError
        If a name or a unit of `columns`, or the condition, does not fit the files.
    InputError
        As :func:`read_log` and :func:`join_logs`; or if an input is missing, nothing is left, or the gaps
        are longer than what is left.

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
    wanted = Wanted.of(model, inputs, motion)
    units = wanted.inputs
    sent = {f"{PULSE}{name}": "" for name in units} if bench else dict(units)
    extra = {only_while.column: ""} if only_while and only_while.column != "time" else {}
    paths = split_files(files)
    if len(paths) == 1:
        _check_columns(paths[0], columns or {}, extra)
        log = measured = read_wanted(paths[0], columns, replace(wanted, inputs=sent | extra))
    else:
        pose, commands = paths
        ours, theirs = _columns_by_file(pose, commands, columns or {})
        _check_columns(commands, theirs, extra)
        measured = read_wanted(pose, ours, replace(wanted, inputs={}))
        log = join_logs(measured, read_wanted(commands, theirs, Wanted(sent | extra)))
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


def _columns_by_file(
    pose: Path, commands: Path, columns: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Give each renamed column to the files that have it; read_log refuses one that none has."""
    from hovercontrol.logs.source import open_source

    there = {path: open_source(path).header for path in (pose, commands)}

    def has(path: Path, said: str) -> bool:
        return column_of(said, there[path])[0] in there[path]

    ours = {k: v for k, v in columns.items() if has(pose, v) or not has(commands, v)}
    theirs = {k: v for k, v in columns.items() if has(commands, v)}
    return ours, theirs


def _longest(log: Log, condition: Condition, settle: float) -> Log:
    holds = _COMPARE[condition.comparison](log[condition.column], condition.value)
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
