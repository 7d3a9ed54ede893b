"""Outliers: samples far from the model and both neighbours, compared with nearby residuals.

The leave-one-out residual of a sample is compared with the residuals of the rows about it. During fast motion
all residuals are large, and none is an outlier. A sample very far off is removed. A doubtful sample is
down-weighted: it gets the noise variance that makes its residual most likely. With plain least squares a few
such samples could distort the fit (Huber, Robust Statistics, 1981, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from hovercontrol.base.arrays import Array, Mask


@dataclass(frozen=True)
class OutlierCriteria:
    """When a sample is an outlier.

    A million normal samples contain none beyond 6 standard deviations. Real noise has heavier tails: on clean
    motion-capture logs of 10,000 rows the largest deviation is 14.8. Other values: no published source,
    exercised by tests/identification/diagnose/test_outliers.py.

    Attributes
    ----------
    stands_out : float
        Size of an outlier in standard deviations of the residuals about it. Outliers are removed.
    doubtful : float
        Size of a doubtful sample in the same standard deviations. Doubtful samples are down-weighted.
    least : float
        Smallest standard deviation of the normalised residuals of a channel, nominally 1. A log without noise
        therefore has no outliers.
    about : int
        Number of rows about a sample from which the standard deviation is estimated.
    alone : int
        Number of consecutive rows of which only one is removed at a time, as it may disturb its neighbours.
    """

    stands_out: float = 16.0
    doubtful: float = 6.0
    least: float = 0.2
    about: int = 51
    alone: int = 7


#: The values in use.
OUTLIERS = OutlierCriteria()


#: Quantiles of the absolute value of a normal variable, in standard deviations: 75 % and 50 %. (Outliers and
#: the neighbours that they disturb may be one in ten of all samples, and more in some channels.)
THREE_IN_FOUR, HALF = 1.150, 0.6745


def outliers(left: Array, seen: Mask, size: float = OUTLIERS.stands_out) -> Mask:
    """Return which samples are outliers.

    Parameters
    ----------
    left : ndarray, shape (K, W, C)
        Residuals over their own standard deviations; zero where not measured.
    seen : ndarray of bool, shape (K, W, C)
        Which samples were measured.
    size : float, optional
        Minimum size of an outlier in standard deviations of the residuals about it.

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
        # Robust standard deviations of the channel (75 % quantile of |z| / 1.150) and of the rows about a
        # sample (running median of |z| / 0.6745); an outlier exceeds `size` times both
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
