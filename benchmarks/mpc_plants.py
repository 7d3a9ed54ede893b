"""Predictive control of ten plants, each from rest to a set point or along waypoints: reached, or said.

A set point is reached if the last state is within 5 % of the step, waypoints if the path passes each within
0.25 m. What is not reached must be said: by a warning, or as a one-line error.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import sympy as sp

import hovercontrol as hc
from hovercontrol.blocks.delays import pade

S = hc.Signal
WAYPOINTS = [[4.0, 0.0], [4.0, 2.0]]
x, y, psi = S("x", "m"), S("y", "m"), S("psi", "rad")
u, v, r = S("u", "m/s"), S("v", "m/s"), S("r", "rad/s")


def pushed(force: sp.Expr, command: hc.Signal, *parameters: hc.Signal, drag: float = 0.5) -> hc.Block:
    """Return x' = v, v' = force - drag v."""
    d = S("d", "1/s", start=drag)
    rates = {"x": v.symbol, "v": force - d.symbol * v.symbol}
    return hc.Block("plant", (x, v), (command,), (x, v), (*parameters, d), rates)


def square_law() -> hc.Block:
    n, k = S("n", "1/s"), S("k", "m", start=0.004)
    return pushed(k.symbol * n.symbol * sp.Abs(n.symbol), n, k)


def heater() -> hc.Block:
    T, i, k, c = S("T", "K"), S("i", "A"), S("k", "K/s/A", start=0.4), S("c", "1/s", start=0.1)
    rates = {"T": k.symbol * sp.Abs(i.symbol) - c.symbol * T.symbol}
    return hc.Block("heater", (T,), (i,), (T,), (k, c), rates)


def dead_zone() -> hc.Block:
    e, k, w = S("e", "V"), S("k", "m/s^2/V", start=0.5), S("w", "V", start=2.0)
    beyond = sp.Max(e.symbol - w.symbol, 0) + sp.Min(e.symbol + w.symbol, 0)
    return pushed(k.symbol * beyond, e, k, w)


def saturation() -> hc.Block:
    e, k, w = S("e", "V"), S("k", "m/s^2", start=1.0), S("w", "V", start=0.5)
    return pushed(k.symbol * sp.tanh(e.symbol / w.symbol), e, k, w)


def late(order: int | None) -> hc.Block:
    """Return a cart whose command acts 0.3 s late, exactly or by Pade's fraction."""
    a, tau = S("a", "m/s^2"), S("tau", "s", start=0.3)
    d = S("d", "1/s", start=0.5)
    rates = {"x": v.symbol, "v": a.symbol - d.symbol * v.symbol}
    plant = hc.Block("plant", (x, v), (a,), (x, v), (d, tau), rates, delays={"a": tau.symbol})
    return plant if order is None else pade(plant, order)


def unstable() -> hc.Block:
    a, k = S("a", "m/s^2"), S("k", "1/s^2", start=4.0)
    return hc.Block("plant", (x, v), (a,), (x, v), (k,), {"x": v.symbol, "v": k.symbol * x.symbol + a.symbol})


def non_minimum_phase() -> hc.Block:
    """Return y/a = (1 - s)/(1 + s)^2."""
    a, z, w, k = S("a"), S("z"), S("w"), S("k", "1/s", start=1.0)
    rates = {"z": k.symbol * (a.symbol - z.symbol), "w": k.symbol * (2 * z.symbol - w.symbol - a.symbol)}
    return hc.Block("plant", (z, w), (a,), (w,), (k,), rates)


def no_reverse() -> hc.Model:
    values = {"surge_coulomb": 0.0, "sway_coulomb": 0.0, "yaw_coulomb": 0.0, "surge_linear_drag": 0.28}
    values |= {"sway_linear_drag": 0.75, "yaw_linear_drag": 1.5, "thrust": 0.31, "rudder_torque": 4.4}
    return hc.vehicle("c17_simulation").with_coefficients(values)


def two_fans() -> hc.Block:
    left, right = S("left", "1/s"), S("right", "1/s")
    k, j, d, e = (
        S("k", "m", start=0.004), S("j", "rad", start=0.02),
        S("d", "1/s", start=0.6), S("e", "1/s", start=1.2),
    )  # fmt: skip
    a, b = (n.symbol * sp.Abs(n.symbol) for n in (left, right))
    rates = {
        "x": u.symbol * sp.cos(psi.symbol),
        "y": u.symbol * sp.sin(psi.symbol),
        "psi": r.symbol,
        "u": k.symbol * (a + b) - d.symbol * u.symbol,
        "r": j.symbol * (b - a) - e.symbol * r.symbol,
    }
    return hc.Block("fans", (x, y, psi, u, r), (left, right), (x, y, psi), (k, j, d, e), rates)


def sampled() -> hc.Block:
    """Return the square law stepped every 0.1 s: v(k + 1) = 0.95 v(k) + b n abs(n)."""
    n, b, a = S("n", "1/s"), S("b", "m*s", start=0.0004), S("a", start=0.95)
    nexts = {"v": a.symbol * v.symbol + b.symbol * n.symbol * sp.Abs(n.symbol)}
    return hc.Block("sampled", (v,), (n,), (v,), (b, a), nexts, period=0.1)


SPEED = {"period": 0.1, "weights": {"v": 10.0, "n": 1e-4}, "limits": {"n": (-30.0, 30.0)}}
PLACE = {"period": 0.1, "horizon": 30, "weights": {"x": 10.0, "v": 1.0}}
WAY = {"waypoints": WAYPOINTS}
BOAT = {"thrust": (0.0, 6.0), "rudder": (-0.45, 0.45)}
CASES: dict[str, tuple[Callable[[], Any], dict[str, Any], dict[str, float], float]] = {
    "square law, v = 1 m/s": (square_law, SPEED, {"v": 1.0}, 6.0),
    "square law, x = 2 m": (square_law, PLACE | {"limits": {"n": (-30.0, 30.0)}}, {"x": 2.0}, 15.0),
    "abs(i), T = 5 K": (
        heater, {"period": 1.0, "weights": {"T": 1.0, "i": 1e-3}, "limits": {"i": (-4.0, 4.0)}},
        {"T": 5.0}, 60.0,
    ),
    "dead zone, x = 1 m": (dead_zone, PLACE | {"limits": {"e": (-6.0, 6.0)}}, {"x": 1.0}, 15.0),
    "saturation, x = 2 m": (saturation, PLACE | {"limits": {"e": (-12.0, 12.0)}}, {"x": 2.0}, 15.0),
    "delay, x = 1 m": (lambda: late(None), PLACE | {"limits": {"a": (-2.0, 2.0)}}, {"x": 1.0}, 15.0),
    "delay as Pade's fraction, x = 1 m": (
        lambda: late(3), PLACE | {"limits": {"a": (-2.0, 2.0)}}, {"x": 1.0}, 15.0,
    ),
    "unstable, x = 0.5 m": (unstable, PLACE | {"limits": {"a": (-6.0, 6.0)}}, {"x": 0.5}, 10.0),
    "unstable, limits too tight": (unstable, PLACE | {"limits": {"a": (-1.0, 1.0)}}, {"x": 0.5}, 6.0),
    "non-minimum phase, w = 1": (
        non_minimum_phase,
        {"period": 0.1, "horizon": 40, "weights": {"w": 1.0}, "limits": {"a": (-3.0, 3.0)}},
        {"w": 1.0}, 10.0,
    ),
    "no reverse, two waypoints": (no_reverse, WAY | {"limits": BOAT}, {}, 40.0),
    "no reverse, horizon 1 s": (
        no_reverse,
        WAY | {
            "limits": BOAT, "period": 0.05, "horizon": 20,
            "weights": {"x": 20, "y": 20, "psi": 5, "r": 0.1, "v": 0.5, "thrust": 0.02, "rudder": 0.1},
            "rate_weights": {"thrust": 0.05, "rudder": 0.5},
        }, {}, 40.0,
    ),
    "two fans, two waypoints": (two_fans, WAY | {"limits": {"left": (0, 20), "right": (0, 20)}}, {}, 40.0),
    "two fans with reverse, two waypoints": (
        two_fans, WAY | {"limits": {"left": (-20, 20), "right": (-20, 20)}}, {}, 40.0,
    ),
    "sampled square law, v = 1 m/s": (sampled, SPEED, {"v": 1.0}, 6.0),
}  # fmt: skip


def outcome(name: str, solver: Any = "rti") -> tuple[bool, str]:
    """Return whether a case reached its goal, and what was said."""
    make, options, reference, duration = CASES[name]
    plant = make()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            controller = hc.mpc(plant, solver=solver, **options)
            run = controller.simulate(duration, reference=reference or None)
        except hc.InputError as error:
            return False, str(error)
    states = dict(zip(run.state_labels, np.asarray(run.states), strict=True))
    if reference:
        reached = all(abs(states[key][-1] - value) <= 0.05 * value for key, value in reference.items())
    else:
        gaps = [np.hypot(states["x"] - a, states["y"] - b).min() for a, b in WAYPOINTS]
        reached = max(gaps) <= 0.25
    return reached, "; ".join(str(one.message) for one in told)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for solver in ("rti", "ipopt"):
        for name in CASES:
            if solver == "ipopt" and "waypoints" in name:
                continue  # minutes
            reached, said = outcome(name, solver)
            text = "reached" if reached else f"said: {said}"[:120] if said else "neither"
            yield f"{solver}: {name}", text, "reached, or said", reached or bool(said)
