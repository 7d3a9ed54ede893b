"""Spikes: samples that deviate from the rows before and after in a way that no motion explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array, Mask


@dataclass(frozen=True)
class SpikeCriteria:
    """When samples are a spike: far from the rows before and from the rows after.

    No published source: set by hand on recorded logs, exercised by
    tests/identification/diagnose/test_outliers.py.

    Attributes
    ----------
    stands_out : float
        Smallest distance of a residual from both sides in standard deviations.
    steps : float
        Smallest distance from the nearer side in multiples of the steps from row to row about it.
    beside : int
        Number of rows to either side that are compared.
    apart : float
        Largest distance between the two sides, relative to the distance of the sample.
    sharp : tuple
        Smallest distance of one, two or three samples from the nearest rows, relative to their distance from
        the nearer side.
    lonely : float
        Factor on `stands_out` for samples with rows on one side only.
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
    """Return which samples are spikes: one to three samples far from the rows before and the rows after.

    Parameters
    ----------
    z : ndarray, shape (W, K, C)
        Residuals over the noise.
    seen : ndarray of bool, shape (W, K, C)
        Which samples were measured; the others are skipped.

    Examples
    --------
    >>> z = np.array([0.0, 1, 0, -1, 9, 0, 1, 0, 10, 20, 30, 20, 10, 0, 0])[None, :, None]
    >>> np.flatnonzero(stand_out(z, np.ones(z.shape, dtype=bool)))  # a peak is none
    array([4])
    """
    rows = np.where(seen, z, np.nan)
    order = np.argsort(~np.isfinite(rows), axis=1, kind="stable")  # measured rows first, in order
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
    """Return at which rows a spike of `width` samples begins, shape (W, K + 1 - width, C)."""
    W, K, C = rows.shape
    if width > K:
        return np.zeros((W, 0, C), dtype=np.bool_)
    beside = SPIKES.beside
    edge = np.full((W, beside, C), np.nan)
    padded = np.concatenate([edge, rows, edge], axis=1)
    found = _perhaps(padded, width)
    w, k, c = np.nonzero(found)
    near = padded[w, k + np.arange(2 * beside + width)[:, None], c]  # candidates only: ranking all is slow
    found[w, k, c] = _between(near[:beside][::-1], near[beside:-beside], near[-beside:], width)
    return found


def _perhaps(padded: Array, width: int) -> Mask:
    """Return at which rows a spike of `width` samples may begin, shape (W, K + 1 - width, C).

    This is a fast necessary condition. A spike is farther than ``stands_out`` from the middle of both sides,
    and each side is less than ``apart`` / 2 of that distance from the middle. The first sample is therefore
    above the medians of both sides by ``(1 - apart / 2) * stands_out``, or below both.
    """
    count, beside = padded.shape[1] - 2 * SPIKES.beside - width + 1, SPIKES.beside
    a, b, c = (padded[:, k : padded.shape[1] - 2 + k] for k in range(3))
    median = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
    own = padded[:, beside : beside + count]
    over = own - median[:, :count]
    beyond = own - median[:, beside + width : beside + width + count]
    least = (1.0 - 0.5 * SPIKES.apart) * SPIKES.stands_out
    unknown = np.isnan(over) | np.isnan(beyond)  # beside an end
    clear = (np.minimum(over, beyond) > least) | (np.maximum(over, beyond) < -least)
    return np.asarray((clear | unknown) & np.isfinite(own))


def _between(before: Array, own: Array, after: Array, width: int) -> Mask:
    """Return which samples, shape (width, N), are spikes, given the rows before and after, shape (3, N).

    Rows before and after are ordered by distance, the nearest first.
    """
    # Medians l, r of both sides, middle m = (l + r)/2:
    #   far = min |z - m|,  least = far - |l - r|/2 (distance from the nearer side)
    # A spike has far > stands_out, least > steps * (step size about it), |l - r| < apart * least
    left, right = _ranked(before, 0.5), _ranked(after, 0.5)
    none, no_more = np.isnan(left), np.isnan(right)
    one = none | no_more  # at an end of a stretch: one side only, which must be complete; stricter limits
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
    """Return the value of a rank (0: smallest, 1: largest) among the finite values along the first axis."""
    ordered, last = np.sort(rows, axis=0), np.isfinite(rows).sum(axis=0) - 1
    place = np.maximum(last, 0) * part
    low, high = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    value = np.take_along_axis(ordered, low[None], axis=0)[0]
    if part == 0.5:
        value = 0.5 * (value + np.take_along_axis(ordered, high[None], axis=0)[0])
    return np.asarray(value)
