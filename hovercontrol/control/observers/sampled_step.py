"""One step of C17's estimator (sections III, V) for sampled data, as expressions.

Between two samples ``x[k+1] = x[k] + dt (h + G c)`` and ``c[k+1] = c[k]``. Here h and G are the means of
their values at both ends: the states are measured there, and the inputs are held. Of a sampled Block, whose
next values are ``h + G c`` at the measured states y, they are ``(h - y)/dt`` and ``G/dt`` (:func:`rates`).
Arrays contain SymPy expressions; intermediate results become definitions (:class:`Names`).

Scalar measurements are processed one after the other, so no matrix is inverted. Joseph's form keeps the
covariance positive.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.control.observers.ins.kalman import Equations

Values = NDArray[Any]


class Names:
    """Names intermediate results as definitions of a Block."""

    def __init__(self, write: Equations) -> None:
        self._define = write.define

    def matrix(self, name: str, values: Values) -> Values:
        """Name the entries ``name[i]`` or ``name[i,j]``."""
        named = np.empty_like(values)
        for place, e in np.ndenumerate(values):
            named[place] = self._define(f"{name}[{','.join(map(str, place))}]", e)
        return named

    def symmetric(self, name: str, values: Values) -> Values:
        """Name the entries of the upper triangle and use them for the lower one."""
        named = values.copy()
        for i, j in zip(*np.triu_indices(len(values)), strict=True):
            named[i, j] = named[j, i] = self._define(f"{name}[{i},{j}]", values[i, j])
        return named


def predicted(
    x: Values, P: Values, before: Values, now: Values, Q: Values, dt: Any, names: Names
) -> tuple[Values, Values]:
    """Return states and coefficients, and their covariance, one step later.

    Parameters
    ----------
    x : ndarray, shape (n + m,)
    P : ndarray, shape (n + m, n + m)
    before, now : ndarray, shape (n, 1 + m)
        ``[h G]`` at both ends.
    Q : ndarray, shape (n + m, n + m)
        Intensities of the disturbances.
    dt : sympy.Expr
        Length of the step [s].
    """
    # x+ = x + dt (h + G c),  P+ = A P A' + Q dt,  A = [[I, dt G], [0, I]].
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


def rates(table: Values, y: Values, dt: Any) -> Values:
    """Return ``[h G]`` of the rates of a sampled Block from that of its next values at measured states y."""
    found = table / dt
    found[:, 0] -= y / dt
    return found


def corrected(x: Values, P: Values, y: Values, R: Values, names: Names) -> tuple[Values, Values]:
    """Return states and coefficients, and their covariance, after a measurement of the n states.

    Parameters
    ----------
    x, P
        As for :func:`predicted`.
    y, R : ndarray, shape (n,)
        The sample, and the variances of its noise.
    """
    # For each measured state i, H = e_i':  K = P e_i / (P_ii + R_i),  x+ = x + K (y_i - x_i),
    # P+ = (I - K H) P (I - K H)' + K R_i K' = kept + (K R_i - kept e_i) K',  kept = (I - K H) P.
    for i in range(len(y)):
        gain = names.matrix(f"gain_{i}", P[:, i] / (P[i, i] + R[i]))
        kept = P - np.multiply.outer(gain, P[i])
        P = kept + np.multiply.outer(gain * R[i] - kept[:, i], gain)
        x = names.matrix(f"corrected_{i}_x", x + gain * (y[i] - x[i]))
        P = names.symmetric(f"corrected_{i}_P", P)
    return x, P


def initialised(x: Values, P: Values, y: Values, R: Values) -> tuple[Values, Values]:
    """Return the values initialised from a first sample; arguments and result as for :func:`corrected`."""
    # x = y,  P_xx = diag R,  P_xc = 0; the coefficients and P_cc do not change.
    n = len(y)
    x, P = x.copy(), P.copy()
    x[:n] = y
    P[:n], P[:, :n] = 0, 0
    for i in range(n):
        P[i, i] = R[i]
    return x, P
