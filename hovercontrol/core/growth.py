"""How fast the modes of a linear system grow, in continuous and in discrete time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def growth(poles: ArrayLike, sampled: bool) -> NDArray[np.float64]:
    """Return Re s [1/s] of continuous poles s, ln abs(z) per step of the poles z of a sampled system.

    Examples
    --------
    >>> growth([-2.0 + 1.0j], False).item(), growth([0.5j], True).item()
    (-2.0, -0.6931471805599453)
    """
    values = np.asarray(poles, dtype=complex)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(values)) if sampled else values.real
