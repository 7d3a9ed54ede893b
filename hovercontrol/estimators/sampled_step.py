"""One step of C17's estimator (sections III, V) for samples, written once for numbers and for symbols.

Between two samples ``x[k+1] = x[k] + dt (h + G c)``, with h and G the mean of their values at both ends (the
states are measured there, the inputs are held), and ``c[k+1] = c[k]``. Arrays hold floats, where
:class:`~hovercontrol.estimators.sampled.SampledEstimator` steps, or SymPy's expressions, where
:func:`~hovercontrol.estimators.ticking.sampled_estimator` writes a Block; symbols are named as they arise.

Measurements are taken one by one, so that nothing is inverted, in Joseph's form, which keeps the covariance
positive.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]


class Names(Protocol):
    """What gives intermediate results their names; numbers need none."""

    def matrix(self, name: str, values: Values) -> Values:
        """Name the entries ``name[i]`` or ``name[i,j]``."""

    def symmetric(self, name: str, values: Values) -> Values:
        """Name the entries of the upper triangle and use them for the lower one."""


class Plain:
    """Numbers stay as they are."""

    def matrix(self, name: str, values: Values) -> Values:
        """Return the values."""
        return values

    def symmetric(self, name: str, values: Values) -> Values:
        """Return the values."""
        return values


def predicted(
    x: Values, P: Values, before: Values, now: Values, Q: Values, dt: Any, names: Names
) -> tuple[Values, Values]:
    """Return states with coefficients, and their covariance, a step later.

    Parameters
    ----------
    x : ndarray, shape (n + m,)
    P : ndarray, shape (n + m, n + m)
    before, now : ndarray, shape (n, 1 + m)
        ``[h G]`` at both ends.
    Q : ndarray, shape (n + m, n + m)
        Intensities of the disturbances.
    dt : float or sympy.Expr
        Length of the step [s].
    names : Names
    """
    n = len(before)
    table = names.matrix("table", (before + now) * (dt / 2))
    h, G = table[:, 0], table[:, 1:]
    moved, half = x.copy(), P.copy()
    moved[:n] += h + G @ x[n:]
    half[:n] += G @ P[n:]
    half = names.matrix("half", half)
    whole = half + Q * dt
    whole[:, :n] += half[:, n:] @ G.T
    return names.matrix("predicted_x", moved), names.symmetric("predicted_P", whole)


def corrected(x: Values, P: Values, y: Values, R: Values, names: Names) -> tuple[Values, Values]:
    """Return them with the first n, the states, measured.

    Parameters
    ----------
    x, P
        As for :func:`predicted`.
    y, R : ndarray, shape (n,)
        The sample, and the variances of its noise.
    names : Names
    """
    for i in range(len(y)):
        gain = names.matrix(f"gain_{i}", P[:, i] / (P[i, i] + R[i]))
        kept = P - np.multiply.outer(gain, P[i])
        P = kept + np.multiply.outer(gain * R[i] - kept[:, i], gain)
        x = names.matrix(f"corrected_{i}_x", x + gain * (y[i] - x[i]))
        P = names.symmetric(f"corrected_{i}_P", P)
    return x, P


def begun(x: Values, P: Values, y: Values, R: Values) -> tuple[Values, Values]:
    """Return them after a first sample, from which the states are taken; arguments as :func:`corrected`."""
    n = len(y)
    x, P = x.copy(), P.copy()
    x[:n] = y
    P[:n], P[:, :n] = 0, 0
    for i in range(n):
        P[i, i] = R[i]
    return x, P
