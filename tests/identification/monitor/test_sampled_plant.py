"""A monitor of a sampled model: the changed number of a loop written by hand is named, and its size."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.identification.monitor.monitor import named_effects

T = 0.05
NOISE = {"process_noise": {"v": 0.002}, "measurement_noise": {"v": 0.005}}


def cart():
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "N")
    d, k = hc.Signal("d", "1", start=0.1), hc.Signal("k", "m/s/N", start=0.2)
    steps = {"v": (1 - d.symbol) * v.symbol + k.symbol * u.symbol}
    return hc.Block("cart", [v], [u], [v], [d, k], steps, period=T)


@pytest.mark.slow
@pytest.mark.parametrize(("change", "size"), [("k", -0.04), ("u_deadzone", 0.2), ("input_delay", 2 * T)])
def test_the_change_is_named_with_its_size(change, size):
    watch = hc.monitor(
        cart(), ["k", "u_deadzone", "input_delay"], false_alarms_per_hour=0.1, period=T, **NOISE
    )
    rng, run, v, past = np.random.default_rng(1), Ticking(watch), 0.0, [0.0] * 3
    u = np.repeat(rng.uniform(-1, 1, 120), 10)
    for k, command in enumerate(u):
        found = run.tick(k * T, {"v": v + 0.005 * rng.normal(), "u": command, "reset": 0.0})
        assert k >= 600 or not found["alarm"]
        past = [command, *past[:2]]
        changed = change if k >= 600 else ""
        arriving = past[2] if changed == "input_delay" else command
        if changed == "u_deadzone":
            arriving = np.sign(command) * max(abs(command) - size, 0.0)
        v = 0.9 * v + (0.2 + size * (changed == "k")) * arriving + 0.002 * rng.normal()
    assert named_effects(watch)[int(found["effect"]) - 1] == change
    assert found["change"] == pytest.approx(size, rel=0.1)


def test_another_period_than_the_models_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"period: expected that of the model, 0.05 s, found 0.1 s"):
        hc.monitor(cart(), ["k"], false_alarms_per_hour=0.1, period=0.1, **NOISE)


@pytest.mark.slow
@pytest.mark.parametrize("slower", [1e-3, 1e5])
def test_a_machine_of_another_time_has_as_many_ticks_until_its_tests_begin(slower):
    v, u = hc.Signal("v", "m"), hc.Signal("u", "V")
    d, k = hc.Signal("d", "1/s", start=2 / slower), hc.Signal("k", "m/s/V", start=4 / slower)
    block = hc.Block("cart", [v], [u], [v], [d, k], {"v": k.symbol * u.symbol - d.symbol * v.symbol})
    noise = {"process_noise": {"v": 0.01 / slower**0.5}, "measurement_noise": {"v": 0.01}}
    watch = hc.monitor(block, ["k"], false_alarms_per_hour=0.1 / slower, period=0.05 * slower, **noise)
    values = {s.name: s.start for s in watch.parameters}
    for name in ("settle", "dead_after"):
        assert 10 <= values[name] / (0.05 * slower) <= 400
    rng, run, x, fade = np.random.default_rng(0), Ticking(watch), 0.0, np.exp(-0.1)
    for n, command in enumerate(np.repeat(rng.uniform(-1, 1, 60), 20)):
        found = run.tick(n * 0.05 * slower, {"v": x + 0.01 * rng.normal(), "u": command, "reset": 0.0})
        x = fade * x + (1 - fade) * 2.0 * (0.7 if n >= 600 else 1.0) * command + 0.002 * rng.normal()
        assert n >= 600 or not found["alarm"]
    assert found["alarm"]
    assert found["change"] * slower == pytest.approx(-1.2, rel=0.15)
