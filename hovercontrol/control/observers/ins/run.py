"""Inertial navigation over a recorded log: the samples of the IMU and the aids' measurements, with times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import call_scalar
from hovercontrol.blocks.simulation.sampled import one_tick
from hovercontrol.blocks.simulation.trajectory import time_response
from hovercontrol.control.observers.ins.imu import IMU
from hovercontrol.control.observers.ins.particles import ParticleFilter
from hovercontrol.control.observers.ins.ranges import RANGE_UNIT

if TYPE_CHECKING:
    import control


#: Number of rows between two progress reports.
_ROWS = 1000


@checked
def run_ins(
    block: Block | ParticleFilter,
    imu: Mapping[str, Any],
    aids: Sequence[Mapping[str, Any]] = (),
    *,
    params: Mapping[str, float] | None = None,
    max_gap: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> control.TimeResponseData:
    """Run a navigation filter over a log.

    The time step between rows is that of the log. The process noise is scaled in proportion to it.

    Parameters
    ----------
    block : Block or ParticleFilter
        Result of :func:`aided_ins`, :func:`coupled_filter`, :func:`range_filter`, :func:`range_particles` or
        :func:`ins_mechanisation`.
    imu : mapping of str to array_like, shape (rows,), or DataFrame
        ``time`` [s], ``acceleration_x``, ``acceleration_y`` [m/s^2], ``yaw_rate`` [rad/s].
    aids : sequence of mappings or DataFrames, optional
        Each with its own ``time`` and the measured inputs of the block: ``heading_aid``; ``fix_x`` and
        ``fix_y``; ``range_1``, ... (and ``range_unit`` if there are several units). NaN means not measured in
        that row. A row is used at the first row of the IMU that is not earlier; if two rows fall on the same
        IMU row, the later one is used.
    params : mapping, optional
        Parameter values by key. Not for a particle filter, whose values are given to :func:`range_particles`.
    max_gap : float, optional
        Longest time between rows of the IMU [s] (default: 1.5 periods of the block).
    progress : callable, optional
        Called every 1000 rows with the finished fraction, 0 to 1.

    Returns
    -------
    control.TimeResponseData
        The block's outputs: the trajectory, innovations and covariances. It has ``plot`` and ``to_pandas``.

    Raises
    ------
    InputError
        If a column is missing, unknown to the block or not a column of numbers; if a time does not increase,
        rows of the IMU are missing, or a value is not finite (the message names the row, counted from 0); if
        an aid's row is outside the IMU's time range.

    Examples
    --------
    >>> from hovercontrol.control.observers.ins import coupled_filter
    >>> zero = [0.0, 0.0, 0.0]
    >>> rest = {"time": [0.0, 0.1, 0.2], "acceleration_x": zero, "acceleration_y": zero, "yaw_rate": zero}
    >>> fix = {"time": [0.1], "fix_x": [0.02], "fix_y": [0.0]}
    >>> found = run_ins(coupled_filter(period=0.1), rest, [fix])
    >>> x_hat = found.outputs[found.output_labels.index("x_hat")]
    >>> bool(x_hat[0] == 0 < x_hat[1] < 0.02)
    True
    """
    gap = 1.5 * block.period if max_gap is None else positive("run_ins: max_gap", max_gap)
    _check_ports(block, params)
    time = _times("imu", imu)
    _check_gaps(time, gap)
    known = [s.name for s in block.inputs]
    columns = dict.fromkeys(known, np.zeros(len(time)))
    for signal in IMU:
        if signal.name in known:
            columns[signal.name] = _column("imu", imu, signal.name, len(time), finite=True)
    for number, aid in enumerate(aids):
        _place(block, f"aids[{number}]", aid, time, columns, gap)
    given = np.array([columns[name] for name in known]).T
    told = len(block.outputs)
    outputs, states = np.empty((told, len(time))), np.empty((len(block.states), len(time)))
    tick = _ticker(block, params)
    spans = np.diff(time, prepend=time[0] - block.period)
    for k, (now, u, span) in enumerate(zip(time.tolist(), given.tolist(), spans.tolist(), strict=True)):
        states[:, k], outputs[:, k] = tick(now, span, u)
        if progress is not None and (k + 1) % _ROWS == 0:
            progress((k + 1) / len(time))
    return time_response(cast(Block, block), time, outputs, states, given.T)


def _ticker(
    block: Block | ParticleFilter, params: Mapping[str, float] | None
) -> Callable[[float, float, list[float]], tuple[ArrayLike, ArrayLike]]:
    """Return a function of time, span and inputs that returns the states before a tick and its outputs."""
    wanted = [s.name for s in block.outputs]
    state = [s.start for s in block.states]
    if isinstance(block, ParticleFilter):
        particles, first = block.start(), state
        period = block.period
        return lambda now, span, u: (
            first,
            particles.tick(np.array(u)[:, None], _regular(span, period), wanted)[:, 0],
        )
    step, values = one_tick(block, wanted), _by_time(block, params)

    def tick(now: float, span: float, u: list[float]) -> tuple[ArrayLike, ArrayLike]:
        nonlocal state
        before = state
        found = call_scalar(step, now, state, u, values(span))
        state = list(found[len(wanted) :])
        return before, found[: len(wanted)]

    return tick


def _check_ports(block: Block | ParticleFilter, params: Mapping[str, float] | None) -> None:
    if not block.period:
        raise InputError(f"run_ins: block {block.name!r} is not sampled: expected a navigation filter")
    for signal in block.inputs:
        ready = [s.name for s in (*IMU, RANGE_UNIT)] + [
            s.name for s in block.inputs if s.name.endswith("_valid")
        ]
        if signal.name not in ready and _valid_input(block, signal.name) is None:
            raise InputError(
                f"run_ins: input {signal.name!r} of block {block.name!r} is neither of the IMU nor of an "
                "aid: join the parts by interconnect first"
            )
    if isinstance(block, Block):
        block.parameter_values(params)
    elif params:
        raise InputError(f"block {block.name!r}: a particle filter's values are given where it is made")


def _valid_input(block: Block | ParticleFilter, name: str) -> str | None:
    """Return the input that is 1 when `name` was measured: ``fix_valid`` of ``fix_x``."""
    known = [s.name for s in block.inputs]
    wanted = (f"{name}_valid", f"{name.rpartition('_')[0]}_valid")
    return next((w for w in wanted if w in known), None)


def _times(where: str, table: Mapping[str, Any]) -> Array:
    time = _column(where, table, "time", None, finite=True)
    if not len(time):
        raise InputError(f"run_ins: {where} has no rows")
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        k = int(late[0]) + 1
        raise InputError(
            f"run_ins: {where} row {k}: time {time[k]:.6g} s is not after that of the row before, "
            f"{time[k - 1]:.6g} s"
        )
    return time


def _check_gaps(time: Array, gap: float) -> None:
    wide = np.flatnonzero(np.diff(time) > gap)
    if len(wide):
        k = int(wide[0]) + 1
        raise InputError(
            f"run_ins: imu row {k} at {time[k]:.6g} s is {time[k] - time[k - 1]:.6g} s after the row before, "
            f"more than {gap:.6g} s: rows are missing (max_gap= allows longer gaps)"
        )


def _column(where: str, table: Mapping[str, Any], name: str, rows: int | None, *, finite: bool) -> Array:
    if name not in table:
        raise InputError(f"run_ins: {where} has no column {name!r}{did_you_mean(name, map(str, table))}")
    try:
        values = np.asarray(table[name], dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"run_ins: {where}: column {name!r} must hold numbers") from None
    if values.ndim != 1 or (rows is not None and len(values) != rows):
        wanted = "one column" if rows is None else f"{rows} rows"
        raise InputError(f"run_ins: {where}: column {name!r} must have {wanted}, found shape {values.shape}")
    bad = np.flatnonzero(~np.isfinite(values) if finite else np.isinf(values))
    if len(bad):
        raise InputError(f"run_ins: {where} row {bad[0]}: {name} = {values[bad[0]]} is not finite")
    return values


def _place(
    block: Block | ParticleFilter,
    where: str,
    aid: Mapping[str, Any],
    time: Array,
    columns: dict[str, Array],
    gap: float,
) -> None:
    """Write an aid's rows into the input columns, at the ticks at which they are used."""
    when = _times(where, aid)
    measured = [s.name for s in block.inputs if s not in IMU and not s.name.endswith("_valid")]
    for name in map(str, aid):
        if name != "time" and name not in measured:
            hint = did_you_mean(name, measured)
            raise InputError(f"run_ins: {where}: block {block.name!r} does not measure {name!r}{hint}")
    at = np.searchsorted(time, when - 1e-9)
    outside = np.flatnonzero((at == len(time)) | (when < time[0] - gap))
    if len(outside):
        k = outside[0]
        raise InputError(
            f"run_ins: {where} row {k} at {when[k]:.6g} s is out of the IMU's time, "
            f"{time[0]:.6g} to {time[-1]:.6g} s"
        )
    groups: dict[str, list[str]] = {}
    for name in measured:
        if name != RANGE_UNIT.name:
            groups.setdefault(str(_valid_input(block, name)), []).append(name)
    for use, names in groups.items():
        if not any(name in aid for name in names):
            continue
        if RANGE_UNIT.name in measured and names[0].startswith("range_"):
            names.append(RANGE_UNIT.name)
        found = [_column(where, aid, name, len(when), finite=False) for name in names]
        there = ~np.isnan(found).any(axis=0)
        for name, values in zip([use, *names], [np.ones(len(when)), *found], strict=True):
            columns[name] = columns[name].copy()
            columns[name][at[there]] = values[there]


def _regular(span: float, period: float) -> float:
    """Return the time between two rows, replaced by the period if it differs only by rounding."""
    return period if abs(span - period) < 1e-6 * period else span


def _by_time(block: Block, params: Mapping[str, float] | None) -> Callable[[float], tuple[float, ...]]:
    """Return the parameter values for a time between rows: dt, and Q scaled in proportion to it."""
    base = block.parameter_values(params)
    last = [p.name.rpartition(".")[2] for p in block.parameters]
    clocks = [k for k, name in enumerate(last) if name == "dt"]
    noises = [k for k, name in enumerate(last) if name.startswith("Q")]
    known: dict[float, tuple[float, ...]] = {}

    def values(span: float) -> tuple[float, ...]:
        span = _regular(span, block.period)
        if span not in known:
            row = list(base)
            for k in clocks:
                row[k] = span
            for k in noises:
                row[k] = base[k] * span / block.period
            known[span] = tuple(row)
        return known[span]

    return values
