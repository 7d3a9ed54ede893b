"""Linear systems in continuous and in discrete time: how fast modes grow, and a system over a period."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import cont2discrete

from hovercontrol.base.arguments import whole_periods
from hovercontrol.base.arrays import Array
from hovercontrol.base.tables import positive


def growth(poles: ArrayLike, sampled: bool) -> Array:
    """Return Re s [1/s] of continuous poles s, ln abs(z) per step of the poles z of a sampled system.

    Examples
    --------
    >>> growth([-2.0 + 1.0j], False).item(), growth([0.5j], True).item()
    (-2.0, -0.6931471805599453)
    """
    values = np.asarray(poles, dtype=complex)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(values)) if sampled else values.real


def over_period(where: str, A: Array, B: Array, step: float, period: float) -> tuple[Array, Array]:
    """Return A and B of a linear system over a period [s], exact for inputs that hold.

    Parameters
    ----------
    where : str
        Function and argument, for the error message.
    step : float
        0 of a continuous system, whose A and B give the derivatives; of a sampled one, whose A and B give the
        next states, the time of a step [s].

    Raises
    ------
    InputError
        If the period is not positive, or no multiple of the step.

    Examples
    --------
    >>> A, B = over_period("lqr: period", np.array([[0.5]]), np.array([[1.0]]), 0.1, 0.3)
    >>> A.item(), B.item()  # 0.5^3, 0.5^2 + 0.5 + 1
    (0.125, 1.75)
    """
    positive(where, period)
    n, m = B.shape
    if not step:
        found, acting, *_ = cont2discrete((A, B, np.eye(n), np.zeros((n, m))), period)
        return found, acting
    # x(k + N) = A^N x(k) + (A^(N-1) + ... + I) B u
    one = np.block([[A, B], [np.zeros((m, n)), np.eye(m)]])
    whole = np.linalg.matrix_power(one, whole_periods(where, period, step))
    return whole[:n, :n], whole[:n, n:]
