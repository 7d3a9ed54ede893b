"""Samples that stand alone: off what the model and the rows on both sides say, by far more than their kind.

A sample is judged by how far it is off what all others say of it, against how far samples about it are off:
where motion is fast all are, and none is an outlier. What lies very far off is left out; what lies between
counts with the variance that its own deviation makes likeliest: squared errors would let a few such samples
pull a fit (Huber, Robust Statistics, 1981, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class OutlierCriteria:
    """When a sample is an outlier.

    Of a million normal samples none is 6 standard deviations off; real noise has heavier tails: on clean
    motion-capture logs of 10,000 rows the largest is 14.8. Other values: no published source, exercised
    by tests/discrepancy/test_outliers.py.

    Attributes
    ----------
    stands_out : float
        Size of an outlier in standard deviations of the residuals about it: it is left out.
    doubtful : float
        The same of a sample that is down-weighted.
    least : float
        Smallest standard deviation of the residuals about it, relative to their own: a log without noise
        has no outliers.
    about : int
        Rows about a sample from which that standard deviation is estimated.
    alone : int
        Rows of which only one is removed at a time, as it may disturb its neighbours.
    """

    stands_out: float = 16.0
    doubtful: float = 6.0
    least: float = 0.2
    about: int = 51
    alone: int = 7


#: The values in use.
OUTLIERS = OutlierCriteria()


#: Three in four, and half of normal samples are less than so many standard deviations off. (Of outliers and
#: what they spoil about them there may be one in ten of all, and more of some.)
THREE_IN_FOUR, HALF = 1.150, 0.6745


def outliers(left: Array, seen: Mask, size: float = OUTLIERS.stands_out) -> Mask:
    """Return which samples stand out.

    Parameters
    ----------
    left : ndarray, shape (K, W, C)
        Residuals over their own standard deviations; zero where not seen.
    seen : ndarray of bool, shape (K, W, C)
    size : float, optional
        In standard deviations of the residuals about them.

    Returns
    -------
    ndarray of bool, shape (K, W, C)
    """
    off = np.abs(left)
    found = np.zeros(seen.shape, dtype=bool)
    for c in range(seen.shape[2]):
        own = seen[..., c]
        if not own.any():
            continue
        z = np.where(own, off[..., c], 0.0)
        usual = max(OUTLIERS.least, float(np.quantile(z[own], 0.75)) / THREE_IN_FOUR)
        suspect = z > size * usual
        if not suspect.any():
            continue
        columns = np.flatnonzero(suspect.any(axis=0))
        filled = np.where(own[:, columns], z[:, columns], np.median(z[own]))
        about = median_filter(filled, size=(OUTLIERS.about, 1), mode="mirror") / HALF
        peak = z[:, columns] == maximum_filter1d(z[:, columns], OUTLIERS.alone, axis=0)
        found[:, columns, c] = suspect[:, columns] & peak & (z[:, columns] > size * about)
    return found
