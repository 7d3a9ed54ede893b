"""Confidence intervals of probabilities that are estimated by counting runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import beta

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError


@checked
def clopper_pearson(successes: ArrayLike, runs: ArrayLike, level: float = 0.95) -> tuple[Array, Array]:
    """Return the exact confidence interval of a probability, lower and upper ends.

    For k successes in n runs the ends solve P(X >= k; low) = P(X <= k; high) = (1 - level)/2, X binomial.
    By the beta distribution, with quantile B and alpha = 1 - level::

        low  = B(alpha/2; k, n - k + 1),
        high = B(1 - alpha/2; k + 1, n - k).

    Source: Clopper and Pearson, Biometrika 26 (1934).

    Parameters
    ----------
    successes, runs : array_like
        Counts, of shapes that broadcast.
    level : float, optional
        Between 0 and 1.

    Raises
    ------
    InputError
        If the level or a count is out of range.

    Examples
    --------
    >>> low, high = clopper_pearson(10_000, 10_000)
    >>> round(float(low), 5), float(high)
    (0.99963, 1.0)
    """
    k, n = np.broadcast_arrays(np.asarray(successes, dtype=float), np.asarray(runs, dtype=float))
    if not 0 < level < 1:
        raise InputError(f"level must lie between 0 and 1, found {level!r}")
    if (k < 0).any() or (k > n).any() or (n < 1).any():
        raise InputError("successes must lie between 0 and the number of runs, and runs be 1 or more")
    tail = (1 - level) / 2
    low = np.where(k == 0, 0.0, beta.ppf(tail, np.maximum(k, 1), n - k + 1))
    high = np.where(k == n, 1.0, beta.isf(tail, k + 1, np.maximum(n - k, 1)))
    return low, high
