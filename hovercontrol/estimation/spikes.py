"""Spikes: samples off the rows before and behind alike, as no motion puts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SpikeCriteria:
    """When samples are a spike: off the rows before and after alike.

    No published source: set by hand on recorded logs, exercised by tests/discrepancy/test_outliers.py.

    Attributes
    ----------
    stands_out : float
        Distance of a residual from both sides in standard deviations.
    steps : float
        The same in steps from row to row there.
    beside : int
        Rows to either side that are compared.
    apart : float
        Largest distance between the two sides, relative to the distance of the sample.
    sharp : tuple
        Distance of one, two or three samples from the nearest rows, relative to their distance from the
        sides.
    lonely : float
        Factor for samples with rows on one side only.
    """

    stands_out: float = 5.5
    steps: float = 4.0
    beside: int = 3
    apart: float = 0.5
    sharp: tuple[float, float, float] = (0.5, 0.5, 0.75)
    lonely: float = 2.0


#: The values in use.
SPIKES = SpikeCriteria()


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
    for width in range(1, len(SPIKES.sharp) + 1):
        first = _alone(rows, width)
        for k in range(width):
            found[:, k : rows.shape[1] - width + 1 + k] |= first
    out = np.zeros_like(found)
    np.put_along_axis(out, order, found, axis=1)
    return np.asarray(out & seen)


def _alone(rows: Array, width: int) -> Mask:
    """Return at which rows as many as `width` begin that stand out together, (W, K + 1 - width, C)."""
    W, K, C = rows.shape
    edge = np.full((W, SPIKES.beside, C), np.nan)
    padded = np.concatenate([edge, rows, edge], axis=1)
    at = [padded[:, k : k + K - width + 1] for k in range(2 * SPIKES.beside + width)]
    before, own, after = (
        np.stack(at[: SPIKES.beside][::-1]),
        np.stack(at[SPIKES.beside : -SPIKES.beside]),
        np.stack(at[-SPIKES.beside :]),
    )
    left, right = _ranked(before, 0.5), _ranked(after, 0.5)
    none, no_more = np.isnan(left), np.isnan(right)
    one = none | no_more  # at the end of a stretch there is one side only: it must be whole, and tell more
    left, right = np.where(none, right, left), np.where(no_more, left, right)
    middle = 0.5 * (left + right)
    up = np.sign(own[0] - middle)
    far = (up * (own - middle)).min(axis=0)
    least = far - 0.5 * np.abs(left - right)  # from the nearer side
    highest = np.fmax(up * before[0], up * after[0])
    sharp = (up * own).min(axis=0) - highest > SPIKES.sharp[width - 1] * least
    changes = np.abs(np.concatenate([np.diff(before, axis=0), np.diff(after, axis=0)]))
    step = np.nan_to_num(np.where(one, _ranked(changes, 1.0), _ranked(changes, 1 / 3)))
    clear = (far > SPIKES.stands_out * np.where(one, SPIKES.lonely, 1.0)) & (least > SPIKES.steps * step)
    whole = ~one | np.isfinite(np.where(none, after, before)).all(axis=0)
    return np.asarray(clear & sharp & whole & (np.abs(left - right) < SPIKES.apart * least))


def _ranked(rows: Array, part: float) -> Array:
    """Return the number of a rank (0: smallest, 1: largest) among the finite ones along the first axis."""
    ordered, last = np.sort(rows, axis=0), np.isfinite(rows).sum(axis=0) - 1
    place = np.maximum(last, 0) * part
    low, high = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    value = np.take_along_axis(ordered, low[None], axis=0)[0]
    if part == 0.5:
        value = 0.5 * (value + np.take_along_axis(ordered, high[None], axis=0)[0])
    return np.asarray(value)
