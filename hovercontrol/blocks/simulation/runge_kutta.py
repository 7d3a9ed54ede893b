"""Runge-Kutta methods: the classical one for floats and for arrays, and Dormand-Prince 5(4) for floats."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.functions import FunctionPair, call_scalar


def rk4(
    rhs: FunctionPair,
    t: float,
    x: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    until: float,
    steps: int,
) -> list[float]:
    """Integrate with held inputs by the classical Runge-Kutta method in equal steps.

    Parameters
    ----------
    rhs : pair of functions
        Right-hand side f(t, x, u, p), from ``block.to_numpy().scalar_pair("derivatives")``.
    t, until : float
        Begin and end [s].
    x, u, p : sequence of float
        State at `t`, inputs, parameter values in order.
    steps : int
        Number of equal steps.

    Returns
    -------
    list of float
        State at `until`.
    """
    # k1 = f(t, x),  k2 = f(t + h/2, x + h/2 k1),  k3 = f(t + h/2, x + h/2 k2),  k4 = f(t + h, x + h k3),
    # x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4)
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
    """Return the states after one step of the classical Runge-Kutta method, for many systems at once.

    The formula is that of :func:`rk4`, which is faster for one system because it uses lists of floats:
    x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4).

    Parameters
    ----------
    slope : callable
        Right-hand side f(t, x); each call must return a new array, because results are changed in place.
    t, h : ndarray
        Begin and length of the step [s]; shapes must broadcast with `x`.
    x : ndarray
        States at `t`.

    Returns
    -------
    ndarray, of the shape of `x`

    Examples
    --------
    >>> import numpy as np
    >>> one = np.array([1.0])
    >>> rk4_step(lambda t, x: -x, 0.0 * one, one, 0.1 * one).round(7)
    array([0.9048375])
    """
    k1 = slope(t, x)
    k2 = slope(t + 0.5 * h, x + (0.5 * h) * k1)
    k3 = slope(t + 0.5 * h, x + (0.5 * h) * k2)
    k4 = slope(t + h, x + h * k3)
    k2 += k3  # k2 becomes k1 + 2 (k2 + k3) + k4, in place because arrays of many windows are large
    k2 *= 2.0
    k2 += k1
    k2 += k4
    return x + (h / 6.0) * k2


#: Coefficients of the Dormand-Prince 5(4) pair (1980). The first stage k_1 = f(t, x) has the node 0;
#: _C[i] is the node c and _A[i] the row a of stage i + 2. The last row of _A holds the fifth-order weights b.
#: _E = b - b^ holds the weights of the error, with the embedded fourth-order weights b^.
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
    """An integration that cannot continue.

    Parameters
    ----------
    status : int
        Index into :data:`hovercontrol.blocks.simulation.reasons.REASONS`.
    time : float
        Time of the last accepted step [s].
    state : list of float
        State at that time.
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
    """Integrate with held inputs by the Dormand-Prince method with step-size control.

    Parameters
    ----------
    rhs, t, x, u, p, until
        As for :func:`rk4`.
    h : float
        Initial step size [s].
    rtol, atol : float
        Relative and absolute tolerance.
    longest : float
        Maximum step size [s].
    most : int, optional
        Maximum number of steps, rejected ones included.

    Returns
    -------
    list of float
        State at `until`.
    float
        Step size for the continuation [s].

    Raises
    ------
    NoProgressError
        If a step becomes too short, the number of steps reaches `most`, or a derivative is not a number.
    """
    state, now, count = list(x), t, 0
    while now < until:
        if count == most:
            raise NoProgressError(4, now, state)
        count += 1
        step = min(h, longest, until - now)
        # k_i = f(t + c_i h, x + h sum_j a_ij k_j),  x_new = x + h sum_i b_i k_i (the last stage's argument)
        slopes = [call_scalar(rhs, now, state, u, p)]
        for c, row in zip(_C, _A, strict=True):
            new = [
                v + step * sum(a * k for a, k in zip(row, ks, strict=False))
                for v, ks in zip(state, zip(*slopes, strict=True), strict=True)
            ]
            slopes.append(call_scalar(rhs, now + c * step, new, u, p))
        # err = sqrt(1/n sum_states (h sum_i e_i k_i / (atol + rtol max(|x|, |x_new|)))^2), accepted if <= 1;
        # next step size: h min(5, max(0.2, 0.9 err^(-1/5)))
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
