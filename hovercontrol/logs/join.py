"""Joining a pose log and a command log that were written on the same clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.logs.clock import measured as measured_names
from hovercontrol.logs.clock import steady
from hovercontrol.logs.log import Floats, Log, Mask
from hovercontrol.logs.prepare import held_on
from hovercontrol.logs.trials import in_sequence


@dataclass(frozen=True)
class JoinCriteria:
    """Threshold for a command at the time of a sample.

    No published source: set by hand, tested in tests/logs/test_gather.py.

    Attributes
    ----------
    same : float
        Largest time between a command and a sample that count as simultaneous, in sampling periods.
    """

    same: float = 0.01


#: The values in use.
JOINING = JoinCriteria()


@checked
def join_logs(
    pose: Log,
    commands: Log,
    before: Mapping[str, float] | float | None = None,
    *,
    hold: float = 0.5,
) -> Log:
    """Add to a pose log the commands in force at each of its samples, and rows where a command changes.

    A command is held until the next one, also over blank cells. A command change between two samples adds a
    row at the time of the change, with NaN in the measured columns. If commands were moved to the next
    sample instead, they would be late by half a sampling period on average. Arrival times of the pose are
    first replaced by a steady sampling clock (:func:`~hovercontrol.logs.clock.steady`), so that a late stamp
    does not select a later command. The trials are those of the pose. If their time restarts, both files
    must have the same number of trials, which are joined one by one.

    Parameters
    ----------
    pose, commands : Log
        Logs on the same clock [s], without a common column.
    before : mapping or float, optional
        The idle value of each command (or of all) before the first command row. Without it, samples of the
        pose before that row are left out.
    hold : float
        Time [s] for which the last command row is held; later samples of the pose are left out.

    Returns
    -------
    Log
        The samples of ``pose`` that have a command, and rows for the command changes between them, with the
        columns of both logs, named after ``pose``.

    Raises
    ------
    InputError
        If a column is in both logs, an idle value is missing or has an unknown name, the logs have no time in
        common, or the time of the trials restarts and their numbers differ.

    Examples
    --------
    >>> pose = Log("pose", [0.0, 1.0, 2.0, 3.0, 4.0], {"x": [0.0, 1.0, 2.0, 3.0, 4.0]})
    >>> fan = Log("fan", [0.5, 1.5, 2.5], {"pwm": [1200.0, 1300.0, 1000.0]})
    >>> joined = join_logs(pose, fan, before=1000.0)
    >>> joined.time, joined["pwm"]
    (array([0. , 0.5, 1. , 1.5, 2. , 2.5, 3. ]), array([1000., 1200., 1200., 1300., 1300., 1000., 1000.]))
    >>> joined["x"]
    array([ 0., nan,  1., nan,  2., nan,  3.])
    """
    both = sorted(pose.columns.keys() & commands.columns.keys())
    if both:
        raise InputError(f"{pose.name}: column {both[0]!r} is also in {commands.name}")
    if any(trial.shift for trial in (*pose.trials, *commands.trials)):
        return _join_each(pose, commands, before, hold)
    idle = _idle_values(commands, before)
    commands = commands.on_clock_of(pose)
    blank = {name: log.missing(name) for log in (pose, commands) for name in log.columns}
    commands = commands.with_columns({name: held_on(column) for name, column in commands.columns.items()})
    kept = steady(pose)
    kept = kept.select(kept.time <= commands.time[-1] + hold)
    if idle is None:
        kept = kept.select(kept.time >= commands.time[0])
    if not len(kept) or kept.time[-1] < commands.time[0]:
        raise InputError(
            f"{pose.name}: no time in common with {commands.name}: "
            f"{pose.time[0]:g} to {pose.time[-1]:g} s against "
            f"{commands.time[0]:g} to {commands.time[-1]:g} s"
        )
    near = JOINING.same * float(np.median(np.diff(kept.time))) if len(kept) > 1 else 0.0
    own = _changes(commands, idle)
    own = own[(own > kept.time[0]) & (own < kept.time[-1])]
    behind = np.searchsorted(kept.time, own)
    own = own[np.minimum(kept.time[behind] - own, own - kept.time[behind - 1]) > near]
    time = np.union1d(kept.time, own)
    row = np.searchsorted(commands.time, time + near * np.isin(time, kept.time), side="right") - 1
    held = {
        name: np.where(row < 0, 0.0 if idle is None else idle[name], column[np.maximum(row, 0)])
        for name, column in commands.columns.items()
    }
    at = np.searchsorted(time, kept.time)
    measured = {name: np.full(time.size, np.nan) for name in kept.columns}
    for name, column in kept.columns.items():
        measured[name][at] = column
    return replace(
        kept,
        time=time,
        columns={**measured, **held},
        trials=tuple(
            replace(trial, first=int(at[trial.first]) if k else 0) for k, trial in enumerate(kept.trials)
        ),
        notes=(*pose.notes, *commands.notes),
        blank=blank,
    )


def measured_rows(log: Log) -> Mask:
    """Return the rows with a measurement; in the other rows a command changes.

    Examples
    --------
    >>> measured_rows(Log("a", [0.0, 0.5, 1.0], {"x": [0.0, np.nan, 1.0], "fan": [0.0, 1.0, 1.0]}))
    array([ True, False,  True])
    """
    names = measured_names(log)
    if not names:
        return np.ones(len(log), dtype=bool)
    return np.asarray(np.isfinite(log.stack(*names)).any(axis=1), dtype=bool)


def _join_each(pose: Log, commands: Log, before: Mapping[str, float] | float | None, hold: float) -> Log:
    """Join trials whose time restarts one by one, each on its own clock."""
    if len(pose.trials) != len(commands.trials):
        raise InputError(
            f"{pose.name}: time begins again: expected as many trials as in {commands.name}, found "
            f"{max(len(pose.trials), 1)} and {max(len(commands.trials), 1)}"
        )
    joined = [
        join_logs(_on_own_clock(pose, k), _on_own_clock(commands, k), before, hold=hold)
        for k in range(len(pose.trials))
    ]
    firsts = np.cumsum([0, *(len(log) for log in joined[:-1])])
    time, trials = in_sequence(np.concatenate([log.time for log in joined]), firsts)
    columns = {name: np.concatenate([log[name] for log in joined]) for name in joined[0].columns}
    blank = {name: log.missing(name) for log in (pose, commands) for name in log.columns}
    notes = (*pose.notes, *commands.notes)
    return Log(pose.name, time, columns, pose.frame, trials=trials, notes=notes, blank=blank)


def _on_own_clock(log: Log, k: int) -> Log:
    part = log.each_trial()[k]
    return replace(part, time=part.time - log.trials[k].shift)


def _changes(commands: Log, idle: Mapping[str, float] | None) -> Floats:
    """Return the times at which a command changes."""
    changed = np.zeros(len(commands), dtype=bool)
    for name, column in commands.columns.items():
        before = np.append(column[0] if idle is None else idle[name], column[:-1])
        changed |= (column != before) & ~np.isnan(column)
    return commands.time[changed]


def _idle_values(commands: Log, before: Mapping[str, float] | float | None) -> Mapping[str, float] | None:
    if before is None:
        return None
    if not isinstance(before, Mapping):
        return dict.fromkeys(commands.columns, float(before))
    for name in before:
        check_known(
            name, commands.columns, f"{commands.name}: idle value for {name!r}, which is not a command"
        )
    for name in commands.columns:
        if name not in before:
            raise InputError(f"{commands.name}: no idle value for command {name!r}")
    return before
