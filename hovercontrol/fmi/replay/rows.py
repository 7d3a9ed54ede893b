"""A log in terms of an FMU: its inputs and measured outputs at each row."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.logs.log import Log
from hovercontrol.logs.prepare import prepared

#: Rows farther apart than this many median distances get rows without measurement in between.
GAP = 3.0
#: Most rows that a gap gets.
MOST_FILLED = 100_000
#: Fewest rows.
FEWEST = 10


@dataclass(frozen=True, eq=False)
class Rows:
    """One log, or one trial of a log.

    Attributes
    ----------
    name : str
    time : ndarray, shape (K,)
        From its first row [s].
    inputs : ndarray, shape (K, n_inputs)
        Held from row to row.
    places : tuple of int
        Of the measured channels among the FMU's outputs and states.
    values : ndarray, shape (K, C)
        NaN where nothing was measured.
    """

    name: str
    time: Array
    inputs: Array
    places: tuple[int, ...]
    values: Array

    def head(self, share: float) -> Rows:
        """Return the first part of the rows."""
        n = max(FEWEST, round(share * len(self.time)))
        return replace(self, time=self.time[:n], inputs=self.inputs[:n], values=self.values[:n])


def rows_of(plant: FmuPlant, log: Log) -> tuple[list[Rows], list[str]]:
    """Return a log's trials in terms of an FMU, and a line on each change of the log.

    Raises
    ------
    InputError
        If the log lacks an input of the FMU, has none of its outputs, or has too few rows.
    """
    names = [s.name for s in (*plant.outputs, *plant.states)]
    inputs = [s.name for s in plant.inputs]
    channels = [n for n in dict.fromkeys(names) if log.has(n) and n not in inputs]
    for name in inputs:
        if not log.has(name):
            raise InputError(f"{log.name}: no column for the input {name!r}{did_you_mean(name, log.columns)}")
    if not channels:
        raise InputError(
            f"{log.name}: no column for an output of {plant.name}; expected one of {', '.join(names)}"
        )
    log, said = prepared(log, channels, inputs)
    if len(log) < FEWEST:
        raise InputError(f"{log.name}: expected at least {FEWEST} rows, found {len(log)}")
    places = tuple(names.index(c) for c in channels)
    u = np.stack([log[n] for n in inputs], axis=1) if inputs else np.zeros((len(log), 0))
    y = np.stack([log[n] for n in channels], axis=1)
    starts = [trial.first for trial in log.trials] or [0]
    ends = [*starts[1:], len(log)]
    found = []
    for k, (a, b) in enumerate(zip(starts, ends, strict=True)):
        if b - a >= FEWEST:
            name = log.name if len(starts) == 1 else f"{log.name} trial {k + 1}"
            time, own, measured = filled(log.time[a:b] - log.time[a], u[a:b], y[a:b])
            found.append(Rows(name, time, own, places, measured))
    return found, said


def trials_of(model: FmuPlant, logs: Sequence[Log]) -> list[Rows]:
    """Return all trials of logs, with a warning for each change of a log."""
    found: list[Rows] = []
    for log in logs:
        rows, said = rows_of(model, log)
        for line in said:
            warnings.warn(line, stacklevel=5)
        found += rows
    if not found:
        raise InputError(f"{logs[0].name}: expected a trial with at least 10 rows")
    for one in found:
        if one.places != found[0].places:
            raise InputError(f"{one.name}: expected the same measured channels in all logs")
    return found


def filled(time: Array, u: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the rows with gaps filled by rows that hold the inputs and measure nothing."""
    step = np.diff(time)
    usual = float(np.median(step))
    count = np.where(step > GAP * usual, np.ceil(step / usual - 1e-6), 1).astype(int)
    if count.sum() > MOST_FILLED + len(step) or (count == 1).all():
        return time, u, y
    at = np.concatenate([[0], np.cumsum(count)])
    new = np.interp(np.arange(at[-1] + 1), at, time)
    place = np.searchsorted(at, np.arange(at[-1] + 1), side="right") - 1
    values = np.full((len(new), y.shape[1]), np.nan)
    values[at] = y
    return new, u[place], values
