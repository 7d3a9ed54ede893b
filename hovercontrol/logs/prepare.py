"""Preparation of a log for estimation: missing samples, held commands and repeated samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.angles import unwrapped
from hovercontrol.logs.log import Floats, Log
from hovercontrol.logs.repeated_samples import without_repeats


def prepared(
    log: Log, channels: Sequence[str], inputs: Sequence[str], angles: Sequence[str] = ()
) -> tuple[Log, list[str]]:
    r"""Return a log prepared for estimation, and one line on each change.

    NaN in a measured column is a missing sample. NaN in a command means that the last value is held; rows
    before the first command are left out. Rows that only repeat the previous measurement count as missing
    samples (:func:`.repeated_samples.without_repeats`). Angles that a sensor gives within one turn get their
    turns (:func:`.angles.unwrapped`). Preparing a log twice changes nothing more.

    Parameters
    ----------
    channels, inputs : sequence of str
        Names of measured and commanded columns; those that the log lacks are ignored.
    angles : sequence of str, optional
        Measured columns in rad that count their turns.

    Returns
    -------
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
    log, turned = unwrapped(log, [name for name in angles if name in seen])
    log, repeated = without_repeats(log, seen)
    return replace(log, notes=()), [*said, *blank, *turned, *repeated]


def held_on(values: Floats) -> Floats:
    """Return the values with each NaN replaced by the last number before it; leading NaN remain.

    Examples
    --------
    >>> held_on(np.array([np.nan, 1.0, np.nan, 2.0]))
    array([nan,  1.,  1.,  2.])
    """
    row = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(values.size)))
    found: Floats = values[row]
    return found


def _missing(log: Log, names: Sequence[str]) -> list[str]:
    """Return one line for each group of columns with the same number of missing samples."""
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
    """Return a log with commands held over blank cells, from each trial's first row with all commands."""
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
