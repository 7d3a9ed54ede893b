"""Thinning of long signals for drawing: a figure has fewer pixels than a log has rows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

#: Rows that are drawn at most: some for each dot of a picture's width.
MOST_DRAWN = 8000


def envelope(row: NDArray[np.float64], most: int = MOST_DRAWN) -> NDArray[np.intp]:
    """Return which rows to draw: all, or the ends and the smallest and largest of many spans, in order.

    Parameters
    ----------
    row : ndarray, shape (n,)
        Rows that are not a number are left out.

    Examples
    --------
    >>> envelope(np.array([0.0, 1, 0, 0, 5, 0, 0, -3]), most=6)
    array([0, 1, 4, 7])
    """
    known = np.flatnonzero(np.isfinite(row))
    if known.size <= most:
        return known
    edges = np.linspace(0, known.size, most // 2).astype(np.intp)
    values = row[known]
    picked = [0, known.size - 1]
    picked += [a + f(values[a:b]) for a, b in pairwise(edges.tolist()) for f in (np.argmin, np.argmax)]
    return np.asarray(known[np.unique(picked)])
