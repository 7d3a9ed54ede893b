"""What the rows of a log mean to a Block: samples that are missing, commands that hold, repeated samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.logs.held import without_repeats
from hovercontrol.logs.log import Floats, Log


def prepared(log: Log, channels: Sequence[str], inputs: Sequence[str]) -> tuple[Log, list[str]]:
    r"""Return a log as an estimate reads it, and one line on each change.

    NaN in a measured column is a sample that is missing. NaN in a command means that the last value holds;
    rows before the first command are left out. Rows that only repeat a measurement hold none
    (:func:`.held.without_repeats`). A log that was prepared already stays as it is.

    Parameters
    ----------
    log : Log
    channels, inputs : sequence of str
        Columns that are measured and commanded, where the log has them.

    Returns
    -------
    Log
    list of str
        The log's own notes first.

    Raises
    ------
    InputError
        If a column is empty.

    Examples
    --------
    >>> t, nan = np.arange(4.0), float("nan")
    >>> found, said = prepared(Log("a", t, {"v": [0, nan, 2, 3], "fan": [1, nan, 2, nan]}), ["v"], ["fan"])
    >>> found["fan"]
    array([1., 1., 2., 2.])
    >>> print("\n".join(said))
    a: column 'v': 1 of 4 samples missing
    a: column 'fan': 2 blank cells hold the last value
    """
    seen, given = ([name for name in names if log.has(name)] for names in (channels, inputs))
    for name in (*seen, *given):
        if len(log) and np.isnan(log[name]).all():
            raise InputError(f"{log.name}: column {name!r} is empty: NaN in all {len(log)} rows")
    said = [*log.notes, *_missing(log, seen)]
    log, blank = _commanded(log, given)
    log, repeated = without_repeats(log, seen)
    return replace(log, notes=()), [*said, *blank, *repeated]


def held_on(values: Floats) -> Floats:
    """Return values in which NaN is the last number before it; NaN before the first.

    Examples
    --------
    >>> held_on(np.array([np.nan, 1.0, np.nan, 2.0]))
    array([nan,  1.,  1.,  2.])
    """
    row = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(values.size)))
    found: Floats = values[row]
    return found


def _missing(log: Log, names: Sequence[str]) -> list[str]:
    """Return a line for columns that lack as many samples each."""
    by_count: dict[tuple[int, int], list[str]] = {}
    for name in names:
        missing = log.missing(name)
        by_count.setdefault((missing, missing + int(np.isfinite(log[name]).sum())), []).append(name)
    return [
        f"{log.name}: column{'s' * (len(own) > 1)} {', '.join(map(repr, own))}: {count:,} of {every:,} "
        "samples missing"
        for (count, every), own in by_count.items()
        if count
    ]


def _commanded(log: Log, names: Sequence[str]) -> tuple[Log, list[str]]:
    """Return a log whose commands hold over blank cells, from the first row of each trial that has all."""
    if not any(np.isnan(log[name]).any() for name in names):
        return log, []
    parts = log.each_trial()
    held = {name: np.concatenate([held_on(part[name]) for part in parts]) for name in names}
    kept = ~np.isnan(np.array(list(held.values()))).any(axis=0)
    blank = {name: int(np.count_nonzero(np.isnan(log[name][kept]))) for name in names}
    if not kept.any():
        raise InputError(f"{log.name}: no row in which all of {', '.join(names)} are given")
    said = [
        f"{log.name}: column {name!r}: {n:,} blank cell{'s' * (n > 1)} hold{'s' * (n == 1)} the last value"
        for name, n in blank.items()
        if n
    ]
    if not kept.all():
        said.append(f"{log.name}: {(~kept).sum():,} rows before the first command: left out")
    log = log.with_columns(held)
    return (log if kept.all() else log.select(kept)), said
