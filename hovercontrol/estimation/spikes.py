"""Spikes: samples off the rows before and behind alike, as no motion puts them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Standard deviations by which a residual stands out from both sides, and in steps from row to row there.
STANDS_OUT, STEPS = 5.5, 4.0

#: Rows to either side with which a sample is compared.
BESIDE = 3

#: How far sides may lie apart, in parts of how far the sample stands out.
APART = 0.5

#: How far, in those parts, one, two and three samples side by side that may be wrong alike stand out from the
#: nearest rows: the more, the more they are like a peak.
SHARP = (0.5, 0.5, 0.75)

#: How much farther it must stand out where there is one side only.
LONELY = 2.0


def stand_out(z: Array, seen: Mask) -> Mask:
    """Return which samples lie off the rows before and those behind them alike, alone or a few together.

    Parameters
    ----------
    z : ndarray, shape (W, K, C)
        Residuals over the noise.
    seen : ndarray of bool, shape (W, K, C)
        Rows that are not are passed over.

    Examples
    --------
    >>> z = np.array([0.0, 1, 0, -1, 9, 0, 1, 0, 10, 20, 30, 20, 10, 0, 0])[None, :, None]
    >>> np.flatnonzero(stand_out(z, np.ones(z.shape, dtype=bool)))  # a peak is none
    array([4])
    """
    rows = np.where(seen, z, np.nan)
    order = np.argsort(~np.isfinite(rows), axis=1, kind="stable")  # rows that are seen side by side, in front
    rows = np.take_along_axis(rows, order, axis=1)
    found = np.zeros(rows.shape, dtype=np.bool_)
    for width in range(1, len(SHARP) + 1):
        first = _alone(rows, width)
        for k in range(width):
            found[:, k : rows.shape[1] - width + 1 + k] |= first
    out = np.zeros_like(found)
    np.put_along_axis(out, order, found, axis=1)
    return np.asarray(out & seen)


def _alone(rows: Array, width: int) -> Mask:
    """Return at which rows as many as `width` begin that stand out together, (W, K + 1 - width, C)."""
    W, K, C = rows.shape
    edge = np.full((W, BESIDE, C), np.nan)
    padded = np.concatenate([edge, rows, edge], axis=1)
    at = [padded[:, k : k + K - width + 1] for k in range(2 * BESIDE + width)]
    before, own, after = np.stack(at[:BESIDE][::-1]), np.stack(at[BESIDE:-BESIDE]), np.stack(at[-BESIDE:])
    left, right = _ranked(before, 0.5), _ranked(after, 0.5)
    none, no_more = np.isnan(left), np.isnan(right)
    one = none | no_more  # at the end of a stretch there is one side only: it must be whole, and tell more
    left, right = np.where(none, right, left), np.where(no_more, left, right)
    middle = 0.5 * (left + right)
    up = np.sign(own[0] - middle)
    far = (up * (own - middle)).min(axis=0)
    least = far - 0.5 * np.abs(left - right)  # from the nearer side
    highest = np.fmax(up * before[0], up * after[0])
    sharp = (up * own).min(axis=0) - highest > SHARP[width - 1] * least
    changes = np.abs(np.concatenate([np.diff(before, axis=0), np.diff(after, axis=0)]))
    step = np.nan_to_num(np.where(one, _ranked(changes, 1.0), _ranked(changes, 1 / 3)))
    clear = (far > STANDS_OUT * np.where(one, LONELY, 1.0)) & (least > STEPS * step)
    whole = ~one | np.isfinite(np.where(none, after, before)).all(axis=0)
    return np.asarray(clear & sharp & whole & (np.abs(left - right) < APART * least))


def _ranked(rows: Array, part: float) -> Array:
    """Return the number of a rank (0: smallest, 1: largest) among the finite ones along the first axis."""
    ordered, last = np.sort(rows, axis=0), np.isfinite(rows).sum(axis=0) - 1
    place = np.maximum(last, 0) * part
    low, high = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    value = np.take_along_axis(ordered, low[None], axis=0)[0]
    if part == 0.5:
        value = 0.5 * (value + np.take_along_axis(ordered, high[None], axis=0)[0])
    return np.asarray(value)
