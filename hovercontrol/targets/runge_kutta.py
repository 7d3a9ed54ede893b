"""The classical Runge-Kutta method on plain floats."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.targets.numpy import FunctionPair, call_scalar


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
