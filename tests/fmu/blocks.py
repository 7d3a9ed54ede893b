"""Small Blocks of which FMUs are made: dry friction, delays, ticks, a plant and its controller."""

from __future__ import annotations

import sympy as sp

from hovercontrol import Block, Signal, interconnect, waypoints
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import time
from hovercontrol.craft.models.actuated import actuated
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts


def driven() -> Block:
    """v' = sin t - c sgn v."""
    v, c = Signal("v", "m/s"), Signal("c", "m/s^2", start=0.7, lower=0.0)
    size, rate, width = (
        Signal("size", "m/s^2", start=1.0),
        Signal("rate", "1/s", start=1.0),
        Signal("width", "m/s"),
    )
    derivative = size.symbol * sp.sin(rate.symbol * time) - c.symbol * sgn(v.symbol, width.symbol)
    return Block("driven", (v,), (), (v,), (c, size, rate, width.replace(start=1e-3)), {"v": derivative})


def axes() -> Block:
    """Three masses in a row of springs, each on a rough floor; the first is shaken."""
    k, size, rate, width = (
        Signal(name, unit, start=start)
        for name, unit, start in (
            ("k", "1/s^2", 30),
            ("size", "m/s^2", 5),
            ("rate", "1/s", 5),
            ("width", "m/s", 1e-3),
        )
    )
    mass = (1.0, 0.6, 1.7)
    x = [Signal(f"x{i}", "m") for i in range(3)]
    v = [Signal(f"v{i}", "m/s") for i in range(3)]
    mu = [Signal(f"mu{i}", "m/s^2", start=s, lower=0.0) for i, s in enumerate((2.0, 1.0, 0.5))]
    first, second = (k.symbol * (x[i + 1].symbol - x[i].symbol) for i in (0, 1))
    shaken = size.symbol * sp.sin(rate.symbol * time)
    force = (shaken + first - k.symbol * x[0].symbol, second - first, -second)
    derivatives = {x[i].name: v[i].symbol for i in range(3)}
    for i in range(3):
        friction = mu[i].symbol * sgn(v[i].symbol, width.symbol)
        derivatives[v[i].name] = (force[i] - friction) / mass[i]
    return Block("axes", (*x, *v), (), tuple(v), (*mu, k, size, rate, width), derivatives)


def follower() -> Block:
    """A first-order lag behind a reference that jumps at 1 s and 2.5 s, an input and a nonlinear output."""
    q, gain = Signal("q", "m", nominal=2.0), Signal("gain", "1/s", start=3.0, lower=0.1, upper=50.0)
    push, path = (
        Signal("push", "m/s", lower=-5.0, upper=5.0),
        waypoints([[0, 0], [1, 2], [3, 1]], [0, 1, 2.5]),
    )
    reference = Signal(path.outputs[0].name, path.outputs[0].unit)
    lag = Block(
        "lag",
        (q,),
        (reference, push),
        (q, Signal("power", "m^2/s")),
        (gain,),
        {"q": gain.symbol * (reference.symbol - q.symbol) + push.symbol},
        {"power": q.symbol**2 * gain.symbol + push.symbol * q.symbol},
    )
    return interconnect([path, lag], "follower")


def plant() -> Block:
    return loop_parts(load_scenario("table1"))["plant"]


def fails_late() -> Block:
    """x' = -sqrt(end - t): no number after 1 s."""
    x, end, unit = Signal("x", "s"), Signal("end", "s", start=1.0), Signal("unit", "1/s", start=1.0)
    derivative = -sp.sqrt(unit.symbol * (end.symbol - time))
    return Block("fails_late", (x,), (), (x,), (end, unit), {"x": derivative})


def controller() -> Block:
    """No states at all."""
    return loop_parts(load_scenario("table1"))["controller"]


def remembers() -> Block:
    """x' = fast + slow - rate x, where `slow` acts late, and shows when it does."""
    x, fast = Signal("x", "m"), Signal("fast", "m/s")
    slow = Signal("slow", "m/s", start=0.25)
    rate, late = Signal("rate", "1/s", start=2.0), Signal("late", "s", start=0.32)
    return Block(
        "remembers",
        (x,),
        (fast, slow),
        (x, Signal("felt", "m/s")),
        (rate, late),
        {"x": fast.symbol + slow.symbol - rate.symbol * x.symbol},
        {"felt": slow.symbol},
        delays={"slow": late.symbol},
    )


def counts() -> Block:
    """Nothing but ticks: n becomes n + 1 every 0.1 s."""
    n = Signal("n")
    return Block("counts", [n], [], [n], derivatives={"n": n.symbol + 1}, period=0.1).in_continuous_time


def pushed() -> Block:
    """A cart of 2 kg whose push is limited to -1 to 4 N and lags by 0.1 s."""
    v, m = Signal("v", "m/s"), Signal("m", "kg", start=2.0, lower=0.5)
    F = Signal("F", "N", lower=-1.0, upper=4.0)
    return actuated(Block("pushed", (v,), (F,), (v,), (m,), {"v": F.symbol / m.symbol}), lag=0.1)


def relay() -> Block:
    """v' = -a sign(v), which a solver without sliding modes cannot pass, beside w' = -k w."""
    v, w = Signal("v", "m/s", start=1.0), Signal("w", "m/s", start=1.0)
    a, k = Signal("a", "m/s^2", start=2.0), Signal("k", "1/s", start=0.1)
    brake = sp.Piecewise((-a.symbol, v.symbol > 0), (a.symbol, True))
    return Block("relay", (w, v), (), (v,), (a, k), {"v": brake, "w": -k.symbol * w.symbol})


MAKERS = (driven, axes, follower, plant, controller, fails_late, remembers, counts, pushed, relay)
BLOCKS = {f.__name__: f for f in MAKERS}
