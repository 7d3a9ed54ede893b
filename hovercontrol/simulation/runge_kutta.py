"""Runge-Kutta methods: the classical one, on floats and on arrays, and Dormand and Prince's on floats."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hovercontrol.core.functions import FunctionPair, call_scalar

Array = NDArray[np.float64]


def rk4(
    rhs: FunctionPair,
    t: float,
    x: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    until: float,
    steps: int,
) -> list[float]:
    """Integrate with inputs held, by the classical Runge-Kutta method in equal steps.

    Parameters
    ----------
    rhs : pair of functions
        As ``block.to_numpy().scalar_pair("derivatives")`` gives it.
    t, until : float
        From and to [s].
    x, u, p : sequence of float
        State at t, inputs, parameter values in order.
    steps : int
        How many equal steps.

    Returns
    -------
    list of float
        State at `until`.
    """
    h = (until - t) / steps
    state = list(x)
    for k in range(steps):
        now = t + k * h
        k1 = call_scalar(rhs, now, state, u, p)
        k2 = call_scalar(rhs, now + h / 2, [a + h / 2 * b for a, b in zip(state, k1, strict=True)], u, p)
        k3 = call_scalar(rhs, now + h / 2, [a + h / 2 * b for a, b in zip(state, k2, strict=True)], u, p)
        k4 = call_scalar(rhs, now + h, [a + h * b for a, b in zip(state, k3, strict=True)], u, p)
        state = [
            a + h / 6 * (b1 + 2 * (b2 + b3) + b4)
            for a, b1, b2, b3, b4 in zip(state, k1, k2, k3, k4, strict=True)
        ]
    return state


def rk4_step(slope: Callable[[Array, Array], Array], t: Array, x: Array, h: Array) -> Array:
    """Return states one step later, by the classical Runge-Kutta method; many systems at once.

    The same operations in the same order as :func:`rk4`, which is faster for one system: Python's lists of
    floats need no arrays.

    Parameters
    ----------
    slope : callable
        Of time and state; each result is an array of its own.
    t, h : ndarray
        Begin and length of the step [s], of shapes that go with `x`.
    x : ndarray

    Returns
    -------
    ndarray, of the shape of `x`

    Examples
    --------
    >>> one = np.array([1.0])
    >>> rk4_step(lambda t, x: -x, 0.0 * one, one, 0.1 * one).round(7)
    array([0.9048375])
    """
    k1 = slope(t, x)
    k2 = slope(t + 0.5 * h, x + (0.5 * h) * k1)
    k3 = slope(t + 0.5 * h, x + (0.5 * h) * k2)
    k4 = slope(t + h, x + h * k3)
    k2 += k3  # in place: arrays of many windows are large
    k2 *= 2.0
    k2 += k1
    k2 += k4
    return x + (h / 6.0) * k2


#: Coefficients of Dormand and Prince's pair (1980): nodes, stages, weights of the error.
_C = (0.2, 0.3, 0.8, 8 / 9, 1.0, 1.0)
_A = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


class NoProgressError(Exception):
    """An integration that cannot go on.

    Parameters
    ----------
    status : int
        Of :data:`hovercontrol.simulation.reasons.REASONS`.
    time : float
        The last good time [s].
    state : list of float
        The state there.
    """

    def __init__(self, status: int, time: float, state: list[float]) -> None:
        super().__init__(status, time, state)
        self.status, self.time, self.state = status, time, state


def dormand_prince(
    rhs: FunctionPair,
    t: float,
    x: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    until: float,
    h: float,
    rtol: float,
    atol: float,
    longest: float,
    most: int = 500_000,
) -> tuple[list[float], float]:
    """Integrate with inputs held, in steps as long as the error allows.

    Parameters
    ----------
    rhs, t, x, u, p, until
        As for :func:`rk4`.
    h : float
        Step to begin with [s].
    rtol, atol : float
        Relative and absolute tolerance.
    longest : float
        Longest step [s].
    most : int, optional
        Most steps.

    Returns
    -------
    list of float
        State at `until`.
    float
        Step to go on with [s].

    Raises
    ------
    NoProgressError
        If the steps become too short or too many, or a derivative is not a number.
    """
    state, now, count = list(x), t, 0
    while now < until:
        if count == most:
            raise NoProgressError(4, now, state)
        count += 1
        step = min(h, longest, until - now)
        slopes = [call_scalar(rhs, now, state, u, p)]
        for c, row in zip(_C, _A, strict=True):
            new = [
                v + step * sum(a * k for a, k in zip(row, ks, strict=False))
                for v, ks in zip(state, zip(*slopes, strict=True), strict=True)
            ]
            slopes.append(call_scalar(rhs, now + c * step, new, u, p))
        error = 0.0
        for before, after, ks in zip(state, new, zip(*slopes, strict=True), strict=True):
            off = step * sum(e * k for e, k in zip(_E, ks, strict=True))
            error += (off / (atol + rtol * max(abs(before), abs(after)))) ** 2
        error = math.sqrt(error / len(state))
        if error <= 1.0:
            now, state = (until, new) if step >= until - now else (now + step, new)
        factor = min(5.0, max(0.2, 0.9 * error**-0.2)) if 0 < error < math.inf else 5.0 if error == 0 else 0.2
        if step == h or factor < 1.0:
            h = step * factor
        if not h > 1e-14 * max(abs(until), 1e-3):
            raise NoProgressError(3 if math.isfinite(error) else 2, now, state)
    return state, h
