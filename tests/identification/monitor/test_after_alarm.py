"""Large changes: the samples after the alarm tell the candidates apart, where those before it do not."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.identification.monitor.monitor import named_effects

PERIOD, ONSET = 0.05, 15.0
GIVEN = {"k": 1.0, "c": 0.5, "q": 0.1}


@pytest.fixture(scope="module")
def watch():
    """v' = k F - c v - q v abs(v), of which p is measured."""
    p, v, F = hc.Signal("p", "m"), hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2")
    units = {"k": "1", "c": "1/s", "q": "1/m"}
    k, c, q = (hc.Signal(name, units[name], start=value) for name, value in GIVEN.items())
    V = v.symbol
    rate = k.symbol * F.symbol - c.symbol * V - q.symbol * V * sp.Abs(V)
    block = hc.Block("cart", [p, v], [F], [p, v], [k, c, q], {"p": V, "v": rate})
    return hc.monitor(
        block, list(GIVEN), false_alarms_per_hour=1.0, period=PERIOD, measured=["p"],
        process_noise={"v": 0.02}, measurement_noise={"p": 0.003},
    )  # fmt: skip


def run(name, change, seed, *, controlled):
    """The cart in steps of 5 ms, its speed controlled or its force a square wave; a coefficient changes."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(600)
    at, (x, v), rows = dict(GIVEN), (0.0, 0.0), []
    for now in t:
        if now == ONSET:
            at[name] += change
        wave = np.sin(0.7 * now)
        force = 4.0 * (1.5 * wave - v) if controlled else 2.0 * np.sign(wave)
        rows.append((x + 0.003 * rng.normal(), force))
        for _ in range(10):
            x, v = x + 0.005 * v, v + 0.005 * (at["k"] * force - at["c"] * v - at["q"] * v * abs(v))
        v += 0.02 * PERIOD**0.5 * rng.normal()
    seen, forces = np.array(rows).T
    return t, {"p": seen, "F": forces, "reset": 0 * t}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "controlled"),
    [
        ("c", 3.5, True),
        ("q", 1.0, True),
        ("q", 3.0, True),
        ("k", -0.6, True),
        ("c", 2.0, False),
        ("q", 1.0, False),
    ],
)
def test_a_large_change_is_named_rightly_and_alone(watch, name, change, controlled):
    """Once a quadratic drag ten times as large was a linear one, and a larger drag came with another gain."""
    outputs = [s.name for s in watch.outputs]
    for seed in (11, 12, 13):
        t, inputs = run(name, change, seed, controlled=controlled)
        out = dict(zip(outputs, watch.compile().simulate(t, inputs).outputs, strict=True))
        assert not out["alarm"][t < ONSET].any()
        k = int(np.argmax(out["alarm"] > 0.5)) + round(6.0 / PERIOD)
        assert named_effects(watch)[int(out["effect"][k]) - 1] == name
        assert [o for o in outputs if o.startswith("possible_") and out[o][k]] == [f"possible_{name}"]
        assert out["second"][k] == 0.0
