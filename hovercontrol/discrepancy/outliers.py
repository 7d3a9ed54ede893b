"""Samples that stand out alone from their neighbours by more than noise does: taken out, and counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.navigation import Navigated
from hovercontrol.discrepancy.spikes import STANDS_OUT, seen_first, stand_out
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.identify.measure import Measured
from hovercontrol.identify.windows import noise_levels
from hovercontrol.logs import POSE, Log

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

#: Why a sample is left out.
ALONE = f"stands out alone from its neighbours by more than {STANDS_OUT:g} times the noise"
EMPTY = "empty"
REJECTED = "rejected by the reader: no craft moves so"
NO_POSE = "in a row without a whole pose"
INTEGRATED = "position of a navigation, which its velocities say already"

#: Times that windows are solved again without what was found, for what it hid.
ROUNDS = 5

#: Times at most that a log is simulated again without what was found.
CLEANED = 3

#: Beyond this part of all samples they are no outliers.
MOST = 0.15


@dataclass(frozen=True)
class LeftOut:
    """Samples of one channel of one log that were left out for one reason.

    Attributes
    ----------
    log : str
    held_out : bool
        Whether that is the hold-out log.
    channel : str
    count : int
    reason : str
    """

    log: str
    held_out: bool
    channel: str
    count: int
    reason: str


def without_outliers(fit: Fit) -> Data | None:
    """Return the data without what stands out of a fit's residuals, or None if nothing does.

    What a model lacks changes residuals over several rows, or bends them; a sample that is wrong lies off the
    rows before and the rows behind it alike.

    Parameters
    ----------
    fit : Fit
        In short windows.
    """
    w = fit.windowed
    out = _outliers(fit)
    if not out.any() or out.sum() > MOST * w.seen.sum():
        return None
    values = [m.values.copy() for m in w.data.logs]
    for j, (log, first, stop) in enumerate(w.ranges):
        for row, c in zip(*np.nonzero(out[j, : stop - first]), strict=True):
            measured = w.data.logs[log]
            values[log][measured.channels.index(w.data.channels[c]), first + row] = np.nan
    logs = tuple(replace(m, values=v) for m, v in zip(w.data.logs, values, strict=True))
    return replace(w.data, logs=logs, noise=noise_levels(logs, w.data.channels))


def cleaned(model: Subject, data: Data, lengths: Sequence[float]) -> Data:
    """Return data without what stands out beside a model whose coefficients stay.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
    lengths : sequence of float
        Of the windows [s]: short ones, which what is missing bends least, then some in whose middle is what
        lay at the ends of those.
    """
    near = None
    for length in lengths:
        for _ in range(CLEANED):
            near = fit(model, data, length, frozen=True, near=near)
            clean = without_outliers(near)
            if clean is None:
                break
            data = clean
    return data


def left_out(logs: Sequence[Log], read: Data, kept: Data, *, held_out: bool = False) -> tuple[LeftOut, ...]:
    """Return which samples of logs are not used, by log, channel and reason.

    Parameters
    ----------
    logs : sequence of Log
    read, kept : Data
        What the reader made of them; without what stands out.
    held_out : bool, optional
    """
    found = []
    for log, before, after in zip(logs, read.logs, kept.logs, strict=True):
        rows = _rows(log, before)
        for channel, first, last in zip(before.channels, before.values, after.values, strict=True):
            known = np.isfinite(log[channel])
            gone = ~np.isfinite(first)
            counts = {
                ALONE: int((np.isfinite(first) & ~np.isfinite(last)).sum()),
                EMPTY: int((~known).sum()),
                REJECTED: int((gone & known[rows]).sum() if rows is not None else gone.sum()),
                NO_POSE: int(known.sum() - known[rows].sum()) if rows is not None else 0,
            }
            found += [LeftOut(log.name, held_out, channel, n, why) for why, n in counts.items() if n]
        if isinstance(before, Navigated):
            count = {c: int(np.isfinite(log[c]).sum()) for c in ("x", "y")}
            found += [LeftOut(log.name, held_out, c, n, INTEGRATED) for c, n in count.items()]
    return tuple(found)


def _rows(log: Log, measured: Measured) -> Rows | None:
    """Return which rows of a log were read; None of a log so long that only stretches were."""
    n = measured.time.size
    whole = np.isfinite(log.stack(*POSE)).all(axis=1) if log.has(*POSE) else np.ones(len(log), dtype=bool)
    for rows in (np.arange(len(log)), np.flatnonzero(whole)):
        if rows.size == n:
            return rows
    return None


def _outliers(fit: Fit) -> Mask:
    """Return which samples stand out, (W, K, C): large ones move their window, and so hide small ones."""
    w = fit.windowed
    z = np.where(w.seen, fit.residual / w.data.noise, 0.0)
    measured = np.nan_to_num(w.cut.values.transpose(1, 2, 0)) / w.data.noise
    moves = fit.moves / w.data.noise[:, None]
    out = np.zeros(z.shape, dtype=np.bool_)
    begins = {(log, first): j for j, (log, first, _) in enumerate(w.ranges)}
    behind = np.array([begins.get((log, stop), -1) for log, _, stop in w.ranges])
    z = _solved(z, moves, w.seen)  # a fit may end before the worst windows do
    for _ in range(ROUNDS):
        beside = _beside(measured - z, w.cut.time, w.seen, behind)
        found = stand_out(z, w.seen & ~out, behind, beside)
        if not found.any():
            break
        out |= found
        moved = np.flatnonzero(found.any(axis=(1, 2)))
        z[moved] = _solved(z[moved], moves[moved], w.seen[moved] & ~out[moved])
    return out


def _beside(simulated: Array, time: Array, seen: Mask, behind: Rows) -> Array:
    """Return by how much each window's run ends off the beginning of the next one's, (W, C)."""
    order, count = seen_first(seen), seen.sum(axis=1)
    far = np.maximum(count[:, None] + np.array([-2, -1])[:, None], 0)
    ends = np.take_along_axis(order, far, axis=1)
    every = np.broadcast_to(time[..., None], seen.shape)
    (t1, t2), (y1, y2) = (np.take_along_axis(a, ends, axis=1).swapaxes(0, 1) for a in (every, simulated))
    starts = order[behind, :2]
    (t3, t4), (y3, y4) = (
        np.take_along_axis(a[behind], starts, axis=1).swapaxes(0, 1) for a in (every, simulated)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = 0.5 * ((y2 - y1) / (t2 - t1) + (y4 - y3) / (t4 - t3))
        found = y3 - y2 - slope * (t3 - t2)
    known = (behind >= 0)[:, None] & (count > 1) & (count[behind] > 1)
    return np.where(known, found, np.nan)


def _solved(z: Array, moves: Array, kept: Mask) -> Array:
    """Return residuals with each window's initial states solved for from the samples that are kept."""
    W, n = len(z), moves.shape[-1]
    J = moves.reshape(W, -1, n)
    weighed = np.where(kept.reshape(W, -1, 1), J, 0.0)
    size = np.sqrt((weighed**2).sum(axis=1))
    size = np.where(size > 0, size, 1.0)
    weighed = (weighed / size[:, None]).swapaxes(1, 2)
    normal = weighed @ weighed.swapaxes(1, 2) + 1e-9 * np.eye(n)
    step = np.linalg.solve(normal, weighed @ z.reshape(W, -1, 1))[..., 0] / size
    return np.asarray(z - (J @ step[..., None]).reshape(z.shape))
