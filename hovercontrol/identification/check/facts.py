"""Facts of a log without a model: timing of its rows, range and noise of its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.engine.levels import noise_levels
from hovercontrol.identification.engine.measure import Measured, steps
from hovercontrol.identification.engine.navigation import NAVIGATION, corrections
from hovercontrol.identification.engine.spikes import stand_out
from hovercontrol.logs import POSE, VELOCITY, Clock, Log, Span, fit_clock, smooth_pose
from hovercontrol.logs.codes import code_faults
from hovercontrol.logs.cross_checks import convention_faults
from hovercontrol.logs.log import UNITS
from hovercontrol.logs.prepare import prepared
from hovercontrol.logs.scales import scale_faults

#: Number of rows searched for outliers at a time, and of rows added on either side as neighbours.
PIECE, BESIDE = 1_000_000, 12


@checked
@dataclass(frozen=True)
class Timing:
    """Timing of the rows of a log, or of one of its files.

    Attributes
    ----------
    of : str
        Name of the file.
    rows : int
    start, stop : float
        Times of the first and the last row [s].
    rate : float
        Measurements per second, from the steady clock or else from the median time step.
    steady : bool
        Whether a steady clock explains the stamps.
    jitter : float
        Standard deviation of the stamps about that clock, or else of the time steps [s].
    worst_delay : float
        Longest time from sampling to stamp [s].
    lost : int
        Samples of the steady clock that are missing.
    gaps : tuple of (float, float)
        Spans [s] without rows, longer than 0.25 s and longer than five median time steps.
    trials : int
    seconds : float
        Total duration of all trials [s].

    Examples
    --------
    >>> t = 0.02 * np.arange(200)
    >>> timing = facts(Log("a.csv", t, {"x": np.sin(t), "y": 0.3 * t, "psi": 0 * t})).timing[0]
    >>> timing.rows, round(timing.stop, 2)
    (200, 3.98)
    """

    of: str
    rows: int
    start: float
    stop: float
    rate: float
    steady: bool
    jitter: float
    worst_delay: float
    lost: int
    gaps: tuple[tuple[float, float], ...]
    trials: int
    seconds: float

    __repr__ = short_repr


@checked
@dataclass(frozen=True)
class Column:
    """Facts of one column of a log.

    Attributes
    ----------
    name, unit : str
        The unit is empty if neither the model nor the name determines it.
    kind : str
        ``"measured"``, ``"command"`` or ``"other"``.
    missing : int
        Samples missing in the file.
    low, high : float
        Smallest and largest value.
    noise : float or None
        Standard deviation of the measurement noise, from third differences; None for a column that is not
        measured or is constant.
    resolution : float or None
        Smallest change from row to row; None if the column is constant.
    outliers : tuple of float
        Times of outliers [s].
    change_every : float or None
        Median time from one change of a command to the next [s].

    Examples
    --------
    >>> t = 0.02 * np.arange(200)
    >>> column = facts(Log("a.csv", t, {"x": np.sin(t), "y": 0.3 * t, "psi": 0 * t})).columns[0]
    >>> column.name, column.unit, column.kind
    ('x', 'm', 'measured')
    """

    name: str
    unit: str
    kind: str
    missing: int
    low: float
    high: float
    noise: float | None
    resolution: float | None
    outliers: tuple[float, ...]
    change_every: float | None

    __repr__ = short_repr


@checked
@dataclass(frozen=True, eq=False)
class LogFacts:
    """Facts of a log without a model.

    Attributes
    ----------
    log : Log
    timing : tuple of Timing
        Timing of the file with the measurements, then of the file with the commands if there is one.
    columns : tuple of Column
    rejected : tuple of Span
        Poses that a craft cannot reach: flips and jumps of a marker body.
    remarks : tuple of str
        Warnings that need no model, one line each.

    Examples
    --------
    >>> t = 0.02 * np.arange(200)
    >>> found = facts(Log("a.csv", t, {"x": np.sin(t), "y": 0.3 * t, "psi": 0 * t}))
    >>> [c.name for c in found.columns], found.rejected
    (['x', 'y', 'psi'], ())
    """

    log: Log
    timing: tuple[Timing, ...]
    columns: tuple[Column, ...]
    rejected: tuple[Span, ...]
    remarks: tuple[str, ...]

    __repr__ = short_repr


@checked
def facts(
    log: Log,
    inputs: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    files: Mapping[str, Array] | None = None,
    craft: bool | None = None,
    angles: Sequence[str] = (),
) -> LogFacts:
    """Return the facts of a log.

    Parameters
    ----------
    log : Log
    inputs : sequence of str, optional
        Columns that are commands.
    units : mapping, optional
        Units of columns, in addition to those of pose and body velocities.
    files : mapping of str to ndarray, shape (n,), optional
        Original stamps [s] of the files that the log was joined from.
    craft : bool, optional
        Whether the log is of a craft, with its scales; default: by the names of its columns.
    angles : sequence of str, optional
        Columns in rad that count their turns.

    Returns
    -------
    LogFacts

    Examples
    --------
    >>> rng, t = np.random.default_rng(1), 0.02 * np.arange(200)
    >>> found = facts(Log("demo", t, {"r": np.sin(t) + 0.01 * rng.normal(size=200)}))
    >>> found.timing[0].rate.__round__(3), [(c.name, c.unit, round(c.noise, 2)) for c in found.columns]
    (50.0, [('r', 'rad/s', 0.01)])
    """
    known = {**UNITS, **(units or {})}
    of_known = {**dict.fromkeys(known, "measured"), **dict.fromkeys(inputs, "command")}
    kinds = {name: of_known.get(name, "other") for name in log.columns}
    measured, other = (
        [name for name, kind in kinds.items() if kind == sought] for sought in ("measured", "other")
    )
    measured = measured or other
    corrected = corrections(log)
    navigated = NAVIGATION.least <= corrected.size <= NAVIGATION.most * len(log)
    if craft is None:  # other systems may be slow or fast
        craft = any(log.has(name) for name in (*POSE, *VELOCITY))
    remarks = code_faults(log, measured)
    blank = {name: log.missing(name) for name in kinds}
    log, notes = _read(log, measured, inputs, angles)
    remarks = remarks or (scale_faults(log) if craft else [])
    remarks = remarks or (convention_faults(log) if craft else [])
    rejected = _rejected(log) if log.has(*POSE) and not navigated and not remarks else ()
    columns = tuple(
        _column(log, name, known.get(name, ""), kind, blank[name], name in measured, rejected)
        for name, kind in kinds.items()
    )
    timing = [_timing(name, Log(name, stamps, {}), []) for name, stamps in (files or {}).items()]
    timing = timing or [_timing_of_measured(log, measured)]
    if navigated and not remarks:
        apart = float(np.median(np.diff(log.time[corrected])))
        remarks.append(
            f"{log.name}: its position jumps {corrected.size} times, usually after {apart:.3g} s, and stays "
            f"there: output of a navigation with position fixes; between fixes its velocities drift"
        )
    return LogFacts(log, tuple(timing), columns, rejected, (*notes, *remarks))


def _timing_of_measured(log: Log, measured: Sequence[str]) -> Timing:
    """Return the timing of the rows in which something is measured."""
    seen = np.zeros(len(log), dtype=bool)
    for name in measured:
        seen |= np.isfinite(log[name])
    return _timing(log.name, log.select(seen) if seen.any() else log, measured)


def _read(
    log: Log, measured: Sequence[str], inputs: Sequence[str], angles: Sequence[str]
) -> tuple[Log, list[str]]:
    """Return a log prepared for a fit, with one line on each change, or on why it cannot be fitted."""
    try:
        return prepared(log, measured, inputs, angles)
    except InputError as error:
        return log, [str(error)]


def _timing(name: str, log: Log, measured: Sequence[str]) -> Timing:
    trials = log.each_trial()
    clocks = [fit_clock(part.time, part.stack(*measured) if measured else None) for part in trials]
    clock = clocks[int(np.argmax([len(part) for part in trials]))]
    off = np.concatenate([_off(part.time, own) for part, own in zip(trials, clocks, strict=True)])
    return Timing(
        name, len(log), float(log.time[0]), float(log.time[-1]),
        1.0 / (clock.period if clock.period > 0 else float("nan")), clock.steady,
        float(np.std(off)) if off.size else 0.0, max(own.worst_delay for own in clocks),
        sum(own.lost for own in clocks), log.gaps, len(trials),
        sum(float(part.time[-1] - part.time[0]) for part in trials),
    )  # fmt: skip


def _off(stamps: Array, clock: Clock) -> Array:
    """Return the deviations of stamps from their clock, or without a clock their time steps but gaps [s]."""
    steps_ = np.diff(stamps)
    return stamps - clock.time if clock.steady else steps_[steps_ < 5 * np.median(steps_)]


def _column(
    log: Log, name: str, unit: str, kind: str, missing: int, measured: bool, rejected: Sequence[Span]
) -> Column:
    row = log[name]
    known = np.isfinite(row)
    time, seen = _rows(log.time, known), _rows(row, known)
    resolution = float(steps(seen).min(initial=np.inf))
    noise: float | None = None
    outliers: tuple[float, ...] = ()
    if measured and seen.size > 3 and resolution < np.inf:
        right = known & ~_within(log.time, rejected)  # rejected samples must not affect the noise
        alone = replace(log, columns={name: row})
        noise, outliers = _noise(alone if right.all() else alone.select(right), name)
    every = None
    if kind == "command":
        at = time[1:][np.diff(seen) != 0.0]
        every = float(np.median(np.diff(at))) if at.size > 1 else None
    low, high = (float(f(seen)) if seen.size else float("nan") for f in (np.min, np.max))
    return Column(
        name, unit, kind, missing, low, high, noise,
        resolution if resolution < np.inf else None, outliers, every,
    )  # fmt: skip


def _rows(column: Array, wanted: NDArray[np.bool_]) -> Array:
    """Return some rows of a column, or the column itself if all are wanted, to avoid a copy in memory."""
    return column if wanted.all() else column[wanted]


def _within(time: Array, spans: Sequence[Span]) -> NDArray[np.bool_]:
    """Return a mask of the times that lie in one of the spans, ends included."""
    found = np.zeros(time.size, dtype=bool)
    begin = np.searchsorted(time, [s.start for s in spans], side="left")
    end = np.searchsorted(time, [s.stop for s in spans], side="right")
    for a, b in zip(begin, end, strict=True):
        found[a:b] = True
    return found


def _noise(log: Log, name: str) -> tuple[float | None, tuple[float, ...]]:
    """Return the noise of a column and the times of its outliers."""
    row, n = log[name], len(log)
    if name == "psi":
        row = np.unwrap(row)
    gaps = [int(np.searchsorted(log.time, stop)) for _, stop in log.gaps]
    edges = [0, *sorted({*gaps, *(trial.first for trial in log.trials[1:])}), n]
    segments = tuple((a, b) for a, b in pairwise(edges) if b > a)
    none = np.empty((0, n))
    seen = Measured(
        log.name, log.time, 0.0, none, (name,), row[None], none, segments, ((0, n),), np.isfinite(row), (), n
    )  # fmt: skip
    try:
        noise = float(noise_levels([seen], [name])[0])
    except InputError:  # constant
        return None, ()
    alone = np.zeros(n, dtype=bool)
    for a, b in segments:
        for begin in range(a, b if b - a > 8 else a, PIECE):
            end, first, last = min(begin + PIECE, b), max(begin - BESIDE, a), min(begin + PIECE + BESIDE, b)
            z = (row[first:last] / noise)[None, :, None]
            found = stand_out(z, np.ones(z.shape, dtype=bool))[0, :, 0]
            alone[begin:end] = found[begin - first : end - first]
    return noise, tuple(log.time[alone].tolist())


def _rejected(log: Log) -> tuple[Span, ...]:
    found: list[Span] = []
    for part in log.each_trial():
        with suppress(InputError):  # too few rows, or too many
            found += smooth_pose(part).rejected
    return tuple(found)
