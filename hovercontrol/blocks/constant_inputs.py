"""Constant inputs of several sizes and directions: starts of a search that do not depend on derivatives."""

from __future__ import annotations

from itertools import product

import numpy as np

from hovercontrol.base.arrays import Array

#: Fractions of the largest input, a factor 2 apart.
SIZES: Array = 0.5 ** np.arange(9.0)
#: Up to this number of inputs all are moved together, with more of them one or two at a time.
TOGETHER = 3


def directions(m: int) -> Array:
    """Return in which directions inputs are moved: -1, 0 or 1 for each of m inputs, shape (n, m).

    Examples
    --------
    >>> [len(directions(m)) for m in (1, 2, 3, 6)]
    [2, 8, 26, 72]
    """
    together = m if m <= TOGETHER else 2
    every = product((-1.0, 0.0, 1.0), repeat=m)
    return np.array([p for p in every if 0 < np.count_nonzero(p) <= together])


def constant_inputs(
    lower: Array, upper: Array, nominal: Array, *, largest: Array | float = np.inf, sizes: Array = SIZES
) -> Array:
    """Return constant inputs of each size in each direction from rest, shape (n_sizes, n_directions, m).

    Parameters
    ----------
    lower, upper : ndarray, shape (m,)
        Bounds; rest is 0 or the bound next to it.
    nominal : ndarray, shape (m,)
        Typical sizes, the least ones that are tried of an input without a bound.
    largest : ndarray, shape (m,), or float, optional
        Largest distance from rest.
    sizes : ndarray, shape (n_sizes,), optional
        As fractions of the largest distance from rest.

    Examples
    --------
    >>> constant_inputs(np.array([0.0]), np.array([8.0]), np.ones(1), sizes=np.array([1.0, 0.25])).tolist()
    [[[0.0], [8.0]], [[0.0], [2.0]]]
    """
    rest, each = np.clip(0.0, lower, upper), directions(len(lower))
    far = np.minimum(np.stack([rest - lower, upper - rest]), largest)
    far = np.where(np.isfinite(far), far, nominal / SIZES[-1])
    moved = np.minimum(each, 0.0) * far[0] + np.maximum(each, 0.0) * far[1]
    return rest + sizes[:, None, None] * moved
