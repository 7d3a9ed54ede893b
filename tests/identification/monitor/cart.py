"""A cart in exact steps whose drag or sensor changes, and its monitor."""

from functools import cache

import numpy as np
from scipy.linalg import expm

import hovercontrol as hc

PERIOD, DRAG, MASS, NOISE = 0.1, 0.5, 2.0, 0.01


@cache
def cart_monitor(*candidates):
    """Return a monitor of the cart, by default of its drag and sensor, with 0.1 false alarms an hour."""
    p, v = hc.Signal("p", "m"), hc.Signal("v", "m/s")
    F, m, c = hc.Signal("F", "N"), hc.Signal("m", "kg", start=MASS), hc.Signal("c", "1/s", start=DRAG)
    slopes = {"p": v.symbol, "v": F.symbol / m.symbol - c.symbol * v.symbol}
    cart = hc.Block("cart", [p, v], [F], [p, v], [m, c], slopes)
    return hc.monitor(
        cart, candidates or ["c", "p_bias"], false_alarms_per_hour=0.1, period=PERIOD, measured=["p"],
        process_noise={"v": 0.01}, measurement_noise={"p": NOISE}, lost_samples=["p"],
    )  # fmt: skip


@cache
def step(c, m=MASS):
    """Return the exact solution over a tick, p and v by p, v and F."""
    return expm(PERIOD * np.array([[0.0, 1.0, 0.0], [0.0, -c, 1.0 / m], [0.0, 0.0, 0.0]]))[:2]


def log(
    seconds=60.0,
    *,
    seed=1,
    drag=0.0,
    bias=0.0,
    onset=30.0,
    start=0.0,
    until=1e9,
    push=0.0,
    ramp=0.0,
    gain=1.0,
):
    """Return a log of the cart, p and F.

    From the onset until a time the drag is larger by `drag`, and by `ramp` in each second; the sensor has a
    bias; `push` [m/s^2] acts; and the force is `gain` times the command.
    """
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round(seconds / PERIOD))
    F = 2.0 * np.sign(np.sin(0.9 * t + 0.1))
    x, p = np.zeros(2), []
    for k, now in enumerate(t):
        on = onset <= now < until
        p.append(x[0] + (bias if on else 0.0) + NOISE * rng.normal())
        c = DRAG + (drag + ramp * (now - onset) if on else 0.0)
        x = step(c) @ [*x, (gain * F[k] + MASS * push) if on else F[k]]
    return hc.Log("cart.csv", start + t, {"p": np.array(p), "F": F})
