"""A log in terms of a Block: measured channels, inputs, and an estimate of the states.

Only this module decides which rows carry a residual and which rows belong together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array, Mask
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.logs import POSE, VELOCITY, Log, Span, smooth_pose, steady
from hovercontrol.logs.prepare import prepared

#: Maximum number of rows used of one log. More rows add little information and cost memory.
MOST_ROWS = 60_000


@dataclass(frozen=True)
class InputLimits:
    """Tolerances for the inputs and channels of a log.

    No published source: set by hand, exercised by tests/identification/engine/test_measure.py.

    Attributes
    ----------
    margin : float
        Fraction of the larger bound by which a command may exceed its bounds.
    rounding : float
        Changes below this fraction of the largest value (or of 1 if larger) count as rounding errors.
    """

    margin: float = 0.05
    rounding: float = 1e-14


#: The values in use.
INPUTS = InputLimits()


@checked
@dataclass(frozen=True, eq=False)
class Measured:
    """A log in terms of a Block.

    Attributes
    ----------
    name : str
        Name of the log.
    time : ndarray, shape (n,)
        Time on the clock of the log [s].
    origin : float
        Time of the first row of the log [s]; the Block's time starts there.
    inputs : ndarray, shape (n_inputs, n)
        Commands, in the order of the Block's inputs.
    channels : tuple of str
        States or outputs of the Block that were measured.
    values : ndarray, shape (n_channels, n)
        Measurements; NaN for rejected samples and in rows that hold a command only.
    states : ndarray, shape (n_states, n)
        Estimate of the states from the log; rows of states without an estimate are NaN.
    segments : tuple of (int, int)
        First row and end (exclusive) of each stretch without a gap and without loss of tracking.
    stretches : tuple of (int, int)
        First row and end (exclusive) of each trial, and of each stretch cut from a very long log; one pair
        for all rows otherwise.
    sampled : ndarray of bool, shape (n,)
        Rows with a measurement, rejected or not. Other rows hold a command only.
    rejected : tuple of Span
        Samples that the smoother rejected: time, number and reason.
    rows_total : int
        Number of rows of the log, before a very long one was cut.
    starts : tuple of int
        First row of each trial except the first. The rows before it tell nothing about the states.
    moving : tuple of int
        First row of each trial that begins in motion, so that commands were given before (:func:`.gather`).

    Examples
    --------
    >>> import hovercontrol as hc
    >>> t = 0.02 * np.arange(200)
    >>> one, none = np.ones(200), np.zeros(200)
    >>> log = Log("turn", t, {"u": one, "v": none, "r": one, "thrust": one, "rudder": none})
    >>> seen = measure(hc.vehicle("c17_simulation").plant(), log)
    >>> seen.channels, seen.values.shape, seen.segments
    (('u', 'v', 'r'), (3, 200), ((0, 200),))
    """

    name: str
    time: Array
    origin: float
    inputs: Array
    channels: tuple[str, ...]
    values: Array
    states: Array
    segments: tuple[tuple[int, int], ...]
    stretches: tuple[tuple[int, int], ...]
    sampled: Mask
    rejected: tuple[Span, ...]
    rows_total: int
    starts: tuple[int, ...] = field(default=(), kw_only=True)
    moving: tuple[int, ...] = field(default=(), kw_only=True)

    __repr__ = short_repr


@checked
def measure(block: Block, log: Log, most_rows: int = MOST_ROWS) -> Measured:
    """Return a log in terms of a Block.

    Time stamps that scatter about a steady rate are replaced by that rate (:func:`hovercontrol.logs.steady`).
    A log with the whole pose of a planar craft passes through the smoother: implausible samples carry no
    residual, loss of tracking ends a segment, and the estimated body velocities initialise the fit. Each
    trial is read separately. Commands are held over blank cells. Repeated measurements are discarded. Rows
    without a measurement keep the time of their commands. If a log has more than `most_rows` rows, only ten
    evenly spread stretches are used.

    Parameters
    ----------
    block : Block
    log : Log
        Log with every input of the Block, and at least one of its outputs or states.
    most_rows : int, optional
        Maximum number of rows used.

    Returns
    -------
    Measured

    Raises
    ------
    InputError
        If an input of the Block is not in the log (the message names the nearest column), is not finite or
        is outside its bounds (because of degrees or percent, for example); if no state or output of the Block
        was measured; or if a measured pose never changes.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> zero = [0.0, 0.0, 0.0]
    >>> columns = dict.fromkeys(("u", "v", "r", "thrust", "rudder"), zero)
    >>> measure(hoverdemon().plant(), Log("still", [0.0, 0.1, 0.2], columns)).channels
    ('u', 'v', 'r')
    """
    at_least("measure: most_rows", most_rows, least=1)
    inputs = [s.name for s in block.inputs]
    names = dict.fromkeys([s.name for s in (*block.outputs, *block.states)])
    channels = tuple(name for name in names if log.has(name) and name not in inputs)
    if not channels:
        raise InputError(
            f"{log.name}: nothing that {block.name!r} computes was measured: expected some of "
            f"{', '.join(names)}, found {', '.join(log.columns) or 'no columns'}"
        )
    log, _ = prepared(log, channels, inputs, angles(block))
    for signal in block.inputs:
        _check_input(log, signal)
    if log.has(*POSE):
        refuse_still(log.name, channels, [log[c] for c in channels])  # nothing to smooth
    log = steady(log, channels)
    trials = [(k, part) for piece in log.spread(most_rows) for k, part in enumerate(piece.each_trial())]
    parts = [_part(block, part, channels) for _, part in trials]
    starts = np.cumsum([0, *(p.time.size for p in parts)])
    return Measured(
        log.name,
        np.concatenate([p.time for p in parts]),
        float(log.time[0]),
        np.concatenate([p.inputs for p in parts], axis=1),
        channels,
        np.concatenate([p.values for p in parts], axis=1),
        np.concatenate([p.states for p in parts], axis=1),
        tuple((a + int(s), b + int(s)) for s, p in zip(starts, parts, strict=False) for a, b in p.segments),
        tuple(zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)),
        np.concatenate([p.sampled for p in parts]),
        tuple(span for p in parts for span in p.rejected),
        len(log),
        starts=tuple(int(s) for s, (k, _) in zip(starts, trials, strict=False) if k),
    )


def measure_all(block: Block, logs: Sequence[Log | Measured], most_rows: int) -> list[Measured]:
    """Return each log in terms of a Block; :class:`Measured` logs are returned as they are."""
    return [log if isinstance(log, Measured) else measure(block, log, most_rows) for log in logs]


def angles(block: Block) -> list[str]:
    """Return the states and outputs in rad that count their turns.

    Not the heading of a craft, which its smoother follows, nor outputs that the model keeps within a turn.
    """
    within = (sp.Mod, sp.floor, sp.atan2, sp.atan, sp.asin, sp.acos)
    shown = {s.name: block.expand(block.output_expressions[s.name]) for s in block.outputs}
    signals = dict.fromkeys((*block.states, *block.outputs))
    return [
        s.name
        for s in signals
        if s.unit == "rad" and s.name != "psi" and not shown.get(s.name, s.symbol).has(*within)
    ]


def refuse_still(name: str, channels: Sequence[str], rows: Sequence[Array] | Array) -> None:
    """Raise if all measured channels are constant.

    Raises
    ------
    InputError
        The message names the log.
    """
    if not any(steps(row[np.isfinite(row)]).size for row in rows):
        verb = "are" if len(channels) > 1 else "is"
        raise InputError(f"{name}: the craft never moves: {', '.join(channels)} {verb} constant")


def steps(row: Array) -> Array:
    """Return the magnitudes of all changes from row to row, without rounding errors."""
    sizes = np.abs(np.diff(row))
    return sizes[sizes > INPUTS.rounding * max(1.0, float(np.abs(row).max(initial=0.0)))]


def _check_input(log: Log, signal: Signal) -> None:
    """Raise if a command is not finite or exceeds the signal's bounds by more than ``INPUTS.margin``."""
    values = log[signal.name]
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise InputError(f"{log.name}: input {signal.name!r} is not finite at {log.time[bad[0]]:.6g} s")
    bounds = np.array([signal.lower, signal.upper])
    largest = float(np.abs(bounds[np.isfinite(bounds)]).max(initial=0.0))
    outside = np.maximum(values - signal.upper, signal.lower - values)
    worst = int(outside.argmax()) if outside.size else 0
    if not outside.size or outside[worst] <= INPUTS.margin * largest + 1e-9 * signal.nominal:
        return
    unit = "" if signal.unit == "1" else f" {signal.unit}"
    if np.isfinite(bounds).all():
        wanted = f"{signal.lower:.4g} to {signal.upper:.4g}{unit}"
    elif math.isfinite(signal.upper):
        wanted = f"at most {signal.upper:.4g}{unit}"
    else:
        wanted = f"at least {signal.lower:.4g}{unit}"
    size = float(np.abs(values).max())
    turned = math.radians(size) <= (1 + INPUTS.margin) * largest and size > 3 * largest
    hint = "; is it in degrees?" if signal.unit == "rad" and (turned or size > 2 * math.pi) else ""
    if signal.lower == 0.0 and values[worst] < 0.0 and signal.description.startswith("force of the fan"):
        hint = "; a fan that pushes both ways has reverses = true in the model file"
    raise InputError(
        f"{log.name}: column {signal.name!r}: expected {wanted}, found {values[worst]:.4g} at "
        f"{log.time[worst]:.6g} s{hint}"
    )


def _part(block: Block, log: Log, channels: Sequence[str]) -> Measured:
    names = [s.name for s in block.states]
    planar = log.has(*POSE) and set(names) >= {*POSE, *VELOCITY}
    n, time = len(log), log.time
    values = np.array([log[c] for c in channels])
    inputs = np.array([log[s.name] for s in block.inputs]).reshape(-1, n)
    sampled = np.isfinite(values).any(axis=0)
    whole = np.isfinite(log.stack(*POSE)).all(axis=1) if planar else sampled
    if planar and np.count_nonzero(whole) >= 8:
        smooth = smooth_pose(log)
        near = dict(smooth.log.columns)
        time, valid, spans = smooth.log.time, smooth.valid & sampled, smooth.rejected
        if "psi" in channels:
            row = values[channels.index("psi")]
            # the multiple of 2 pi that brings the measured heading within pi of the smoothed one
            row[:] = near["psi"] + (row - near["psi"] + np.pi) % (2 * np.pi) - np.pi
        values[:, whole & ~smooth.accepted] = np.nan
        for row, channel in zip(values, channels, strict=True):
            if channel in POSE:
                row[~whole] = np.nan
    else:
        valid, spans = sampled, ()
        if "psi" in channels:
            row = values[channels.index("psi")]
            row[np.isfinite(row)] = np.unwrap(row[np.isfinite(row)])
        near = dict(zip(channels, values, strict=True))
    values[~np.isfinite(values)] = np.nan
    unknown = np.full(n, np.nan)
    states = np.array([_filled(time, near.get(name, unknown)) for name in names]).reshape(-1, n)
    origin = float(log.time[0]) if n else 0.0
    segments = _segments(log.name, time, valid)
    return Measured(
        log.name,
        time,
        origin,
        inputs,
        tuple(channels),
        values,
        states,
        segments,
        ((0, n),),
        sampled,
        spans,
        n,
    )


def _filled(time: Array, row: Array) -> Array:
    """Return a measured row with missing samples interpolated."""
    known = np.isfinite(row)
    if known.all() or not known.any():
        return row.copy()
    return np.interp(time, time[known], row[known])


def _segments(name: str, time: Array, valid: Mask) -> tuple[tuple[int, int], ...]:
    rows = np.flatnonzero(valid)
    behind = [stop for _, stop in Log(name, time[rows], {}).gaps]
    parts = np.split(rows, np.searchsorted(time[rows], behind))
    return tuple((int(part[0]), int(part[-1]) + 1) for part in parts if part.size)
