"""Blocks that a design, a search or a correction returns, for tests that compare each backend with NumPy."""

from functools import cache, partial

import numpy as np
import pytest

import hovercontrol as hc

CRAFT = hc.vehicle("c17_simulation")
PLANT = CRAFT.plant()


def straight(u):
    return PLANT.trim({"u": u, "r": 0.0, "psi": 0.0})


def placed(period=0.0):
    poles = [-1 + 1j, -1 - 1j, -2.0, -3.0]
    given = {"period": period} if period else {}
    return hc.place(PLANT, straight(1.0), poles, states=["y", "psi", "v", "r"], inputs=["rudder"], **given)


def scheduled():
    design = partial(hc.lqr, Q={"psi": 1.0, "v": 1.0}, R={"rudder": 1.0})
    return hc.gain_scheduled(PLANT, [straight(u) for u in (0.5, 1.0, 1.5)], design)


def cart(*, plane=False):
    """p' = v, v' = F/m - c v, and the same along y."""
    m, c = hc.Signal("m", "kg", start=2.0), hc.Signal("c", "1/s", start=0.5)
    states, slopes, forces = [], {}, []
    for p, v, F in (("x", "vx", "Fx"), ("y", "vy", "Fy"))[: 1 + plane]:
        at, speed, force = hc.Signal(p, "m"), hc.Signal(v, "m/s"), hc.Signal(F, "N")
        states, forces = [*states, at, speed], [*forces, force]
        slopes |= {p: speed.symbol, v: force.symbol / m.symbol - c.symbol * speed.symbol}
    return hc.Block("cart", states, forces, states, [m, c], slopes)


def planned():
    """The reference of a manoeuvre in minimum time."""
    pytest.importorskip("casadi")
    limits = {"Fx": (-1.0, 1.0), "Fy": (-1.0, 1.0)}
    end = {"x": 2.0, "vx": 0.0, "y": 1.0, "vy": 0.0}
    return hc.minimum_time(cart(plane=True), end, limits=limits, intervals=4).reference()


def watched():
    """A monitor: a filter and a bank of tests, sampled."""
    return hc.monitor(
        cart(), ["x_bias"], false_alarms_per_hour=20.0, period=0.1, measured=["x"],
        process_noise={"vx": 0.1}, measurement_noise={"x": 0.05},
    )  # fmt: skip


def corrected():
    """A craft with effects that its model lacked: a law, a lag of the rudder, cubic drag, an added mass."""
    law = CRAFT.effect_class("law_r__abs_v__r")(-0.4)
    lag = hc.effect("rudder_lag", seconds=0.1)
    return CRAFT.with_effects(
        [law, lag, hc.effect("yaw_cubic_drag", 0.2), hc.effect("sway_mass", 0.1)]
    ).plant()


#: Functions that make the Blocks, by name.
MAKERS = {
    "place": placed,
    "place, sampled": partial(placed, 0.05),
    "gain_scheduled": scheduled,
    "minimum_time": planned,
    "monitor": watched,
    "corrected": corrected,
}


@cache
def designed(name):
    """Return the Block of a name of MAKERS."""
    return MAKERS[name]()


def near_start(block, rng, *n):
    """Return states near their start values, shape (n_states, *n): a filter's covariances stay positive."""
    start = np.array([s.start for s in block.states]).reshape(-1, *(1 for _ in n))
    a, b = rng.normal(0, 1, (2, len(block.states), *n))
    return start * (1 + 0.1 * a) + 1e-3 * b
