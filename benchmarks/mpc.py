"""Model predictive control of C17's craft: limits, an obstacle, 20 steps ahead, 20 samples a second, 60 s.

Times are processor time of one thread for a whole sample: reference, linearisation, quadratic program,
comparison of plans. The compiled Block is the plant.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import thread_time
from typing import Any

import numpy as np

import hovercontrol as hc

OBSTACLE = (3.0, 0.1, 0.6)
WAYPOINTS = [[6.0, 0.0], [6.0, 4.0], [0.0, 4.0], [0.0, 0.0]]
LIMITS = {"thrust": (0.0, 4.0), "rudder": (-0.6, 0.6)}
WEIGHTS = {"x": 20, "y": 20, "psi": 5, "r": 0.1, "v": 0.5, "thrust": 0.02, "rudder": 0.1}


def closed_loop(solver: Any, duration: float) -> tuple[Any, np.ndarray[Any, Any]]:
    """Return the motion, and the time of each sample [s]."""
    controller = hc.mpc(
        hc.vehicle("c17_simulation"),
        period=0.05,
        horizon=20,
        weights=WEIGHTS,
        rate_weights={"thrust": 0.05, "rudder": 0.5},
        limits=LIMITS,
        obstacles=[OBSTACLE],
        waypoints=WAYPOINTS,
        solver=solver,
    )
    own, times = controller._solve, []

    def timed(*args: Any) -> Any:
        begin = thread_time()
        found = own(*args)
        times.append(thread_time() - begin)
        return found

    controller._solve = timed  # type: ignore[method-assign]
    return controller.simulate(duration), np.array(times)


def double_integrator() -> hc.Block:
    """Return x'' = a: from rest to rest over a distance d it takes 2 sqrt(d / a) at least."""
    x, v, a = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    return hc.Block("cart", [x, v], [a], [x, v], derivatives={"x": v.symbol, "v": a.symbol})


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    run, times = closed_loop("rti", 60.0)
    median, worst = 1e3 * np.median(times), 1e3 * times[1:].max()
    yield "one sample, median", f"{median:.2f} ms", "<= 3 ms", bool(median <= 3.0)
    yield "one sample, worst of 1,199 after the first", f"{worst:.2f} ms", "<= 10 ms", bool(worst <= 10.0)
    yield "the first one, which compares constants of all sizes", f"{1e3 * times[0]:.2f} ms", "", None
    x, y, radius = OBSTACLE
    room = np.hypot(run.states[0] - x, run.states[1] - y).min() - radius
    yield "least distance from the obstacle in 60 s", f"{room:.3f} m", ">= 0 m", bool(room >= 0.0)
    limited = zip(run.inputs, LIMITS.values(), strict=True)
    inside = all(low <= u.min() and u.max() <= high for u, (low, high) in limited)
    yield "limits of thrust and rudder hold in 60 s", str(inside), "True", inside
    past = max(np.hypot(run.states[0] - a, run.states[1] - b).min() for a, b in WAYPOINTS)
    yield "farthest from a waypoint when passing it", f"{past:.3f} m", "", None
    _, times = closed_loop("ipopt", 5.0)
    yield (
        "the same with IPOPT, median and worst",
        f"{1e3 * np.median(times):.1f}, {1e3 * times.max():.1f} ms",
        "",
        None,
    )
    cart, limits = double_integrator(), {"a": (-1.0, 1.0)}
    hc.minimum_time(cart, {"x": 4.0, "v": 0.0}, limits=limits)  # its library is built
    begin = thread_time()
    found = hc.minimum_time(cart, {"x": 4.0, "v": 0.0}, limits=limits)
    yield "minimum_time of a cart, exact: 4 s", f"{thread_time() - begin:.2f} s", "", None
    gap = abs(found.duration - 4.0)
    yield "its duration off the exact one", f"{gap:.1e} s", "<= 1e-6 s", gap <= 1e-6
    begin = thread_time()
    plan = hc.minimum_time(
        hc.vehicle("c17_simulation"),
        {"x": 3, "y": 1, "u": 0, "v": 0, "r": 0},
        limits={"thrust": (0, 3.6), "rudder": (-0.54, 0.54)},
        obstacles=[(1.5, 0.3, 0.5)],
        intervals=25,
    )
    spent = thread_time() - begin
    text = f"{plan.duration:.2f} s in {spent:.1f} s"
    yield "minimum_time of C17's craft around an obstacle, 25 intervals", text, "", None
