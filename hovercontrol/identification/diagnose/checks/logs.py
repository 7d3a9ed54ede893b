"""Checks of logs before a diagnosis, with errors and warnings of one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.identification.diagnose.checks.clocks import check_clocks
from hovercontrol.identification.diagnose.checks.timing import (
    check_length,
    refuse_other_pace,
    slow_rows,
    time_constant,
)
from hovercontrol.identification.diagnose.checks.units import refuse_units
from hovercontrol.identification.engine.frame_check import check_frame
from hovercontrol.identification.engine.measure import angles, steps
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.logs import Log
from hovercontrol.logs.check import check_heading
from hovercontrol.logs.codes import code_faults
from hovercontrol.logs.duplicates import refuse_duplicates
from hovercontrol.logs.prepare import prepared
from hovercontrol.logs.scales import scale_faults


@dataclass(frozen=True)
class LogCriteria:
    """Settings that decide when a log is refused or a warning is given before a diagnosis.

    No published source: set by hand, exercised by tests/identification/diagnose/test_checks.py.

    Attributes
    ----------
    stuck : float
        Time for which a sensor may be constant while others change [s].
    stuck_rows : int
        The same as a number of rows; both must be reached.
    cut_off : float
        Fraction of the rows at an extreme value above which a command may be saturated.
    visits : int
        Number of times that such a command must reach this value.
    idle : float
        Values below this fraction of the largest do not count as saturation.
    """

    stuck: float = 0.5
    stuck_rows: int = 10
    cut_off: float = 0.05
    visits: int = 3
    idle: float = 0.05


#: The values in use.
LOG_QUALITY = LogCriteria()


@checked
def as_logs(logs: Log | Sequence[Log] | None) -> tuple[Log, ...]:
    """Return one log, several or none as a tuple.

    Parameters
    ----------
    logs : Log, sequence of Log, or None

    Returns
    -------
    tuple of Log

    Examples
    --------
    >>> len(as_logs(None)), len(as_logs(Log("a", [0.0, 1.0], {})))
    (0, 1)
    """
    if logs is None:
        return ()
    return (logs,) if isinstance(logs, Log) else tuple(logs)


@checked
def check_logs(model: Subject, logs: Sequence[Log], holdout: Log | Sequence[Log] | None = None) -> list[str]:
    """Refuse logs that cannot give a correct diagnosis; return warnings about the others.

    Parameters
    ----------
    model : Model or BlockModel
    logs : sequence of Log
    holdout : Log or sequence of Log, optional

    Returns
    -------
    list of str
        Warnings of one line: stuck sensors, commands at a limit, clocks that drift, short logs.

    Raises
    ------
    InputError
        If a log lacks an input of the model (the nearest column is named); is too short; has a channel that
        is empty, constant or in wrong units, a pose held over several rows, or numbers that stand for missing
        values; has commands and measurements that do not overlap in time, or clocks that drift apart by much;
        or shares rows with another log.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> check_logs(c17_simulation(), [Log("a", [0.0, 0.1], {"u": [0, 1], "trust": [1, 1], "rudder": [0, 0]})])
    Traceback (most recent call last):
        ...
    hovercontrol.base.errors.InputError: a: no column 'thrust', an input of the model; did you mean 'trust'?
    """
    block = structure(model)
    inputs = [s.name for s in block.inputs]
    warnings: list[str] = []
    held = as_logs(holdout)
    every = [*logs, *held]
    refuse_other_pace(every)
    for k, log in enumerate(every):
        _refuse_inputs(block, log)
        channels = _channels(block, log)
        for fault in code_faults(log, [*channels, *inputs]):
            raise InputError(fault)
        _refuse_apart(log, channels, inputs)
        log, said = prepared(log, channels, inputs, angles(block))
        every[k] = log
        warnings += [*said, *check_length(log, time_constant(model), is_craft=model.is_craft)]
        warnings += slow_rows(model, log)
        _refuse_dead(log, channels)
        refuse_units(model, log)
        for fault in scale_faults(log) if model.is_craft else []:
            raise InputError(fault)
        if log.has("psi"):
            check_heading(log.name, "psi", log.time, log["psi"], log["r"] if log.has("r") else None)
        check_frame(model, log)
        warnings += _stuck(log, channels) + _cut_off(log, inputs)
    refuse_duplicates(every[: len(logs)], every[len(logs) :], _measured(block), inputs)
    for log in every:
        warnings += check_clocks(model, log)
    return warnings


def _refuse_inputs(block: Block, log: Log) -> None:
    missing = [s.name for s in block.inputs if not log.has(s.name)]
    if not missing:
        return
    if len(missing) == len(block.inputs) > 1:
        raise InputError(
            f"{log.name}: expected the model's inputs {', '.join(missing)}, found columns "
            f"{', '.join(log.columns)}: is the model of this craft?"
        )
    hint = did_you_mean(missing[0], log.columns)
    raise InputError(f"{log.name}: no column {missing[0]!r}, an input of the model{hint}")


def _channels(block: Block, log: Log) -> list[str]:
    return [name for name in _measured(block) if log.has(name)]


def _measured(block: Block) -> list[str]:
    """Return the names of a Block's outputs and states that a log may contain."""
    inputs = {s.name for s in block.inputs}
    return [
        name for name in dict.fromkeys(s.name for s in (*block.outputs, *block.states)) if name not in inputs
    ]


def _refuse_dead(log: Log, channels: Sequence[str]) -> None:
    """Refuse a channel that is empty, or constant while others change."""
    for c in channels:
        known = log[c][np.isfinite(log[c])]
        if not known.size:
            raise InputError(f"{log.name}: column {c!r} is empty: NaN in all {len(log)} rows")
        if not steps(known).size:
            others = [o for o in channels if o != c and steps(log[o][np.isfinite(log[o])]).size]
            but = f" while {others[0]} moves" if others else ""
            raise InputError(f"{log.name}: column {c!r} is constant{but}: is the sensor stuck? Leave it out")


def _refuse_apart(log: Log, channels: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse commands whose times do not overlap those of the measurements."""
    measured = log.time[np.isfinite(np.array([log[c] for c in channels])).any(axis=0)]
    for name in inputs:
        known = log.time[np.isfinite(log[name])]
        if known.size and measured.size and (known[-1] < measured[0] or measured[-1] < known[0]):
            raise InputError(
                f"{log.name}: input {name!r} (from {known[0]:.6g} to {known[-1]:.6g} s) and motion (from "
                f"{measured[0]:.6g} to {measured[-1]:.6g} s) never overlap in time: do their clocks agree?"
            )


def _stuck(log: Log, channels: Sequence[str]) -> list[str]:
    """Return warnings about sensors that stay constant for a while although they have noise."""
    said = []
    for c in channels:
        known = np.isfinite(log[c])
        row, time = log[c][known], log.time[known]
        resolution = steps(row)
        noise = float(np.median(np.abs(np.diff(row, 3)))) if row.size > 3 else 0.0
        if noise == 0.0 or (resolution.size and resolution.min() > 0.5 * noise):
            continue  # without noise, or with coarse resolution, values repeat normally
        same = np.concatenate([[0], (np.diff(row) == 0.0).astype(int), [0]])
        edges = np.flatnonzero(np.diff(same)).reshape(-1, 2)
        spans = [
            (a, b)
            for a, b in edges
            if b - a >= LOG_QUALITY.stuck_rows and time[b] - time[a] >= LOG_QUALITY.stuck
        ]
        if spans:
            a, b = max(spans, key=lambda s: float(time[s[1]] - time[s[0]]))
            more = f", and {len(spans) - 1} times more" if len(spans) > 1 else ""
            said.append(
                f"{log.name}: {c!r} stays at {row[a]:.4g} from {time[a]:.2f} to {time[b]:.2f} s"
                f"{more}: a stuck sensor?"
            )
    return said


def _cut_off(log: Log, inputs: Sequence[str]) -> list[str]:
    """Return warnings about commands that reach the same extreme value repeatedly: they may be saturated."""
    said = []
    for name in inputs:
        row = log[name]
        if np.unique(row).size <= 5:
            continue  # switched, not cut off
        for value in (float(row.max()), float(row.min())):
            at = row == value
            visits = int((np.diff(np.concatenate([[0], at.astype(int)])) == 1).sum())
            if (
                abs(value) > LOG_QUALITY.idle * float(np.abs(row).max())
                and at.mean() > LOG_QUALITY.cut_off
                and visits >= LOG_QUALITY.visits
            ):
                said.append(
                    f"{log.name}: {name} is at its limit of {value:.4g} in {100 * at.mean():.0f} % of the "
                    "rows: saturated? An effect that acts beyond it cannot show"
                )
    return said
