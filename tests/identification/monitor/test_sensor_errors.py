"""Errors of sensors: jumps, a tracked point off the centre, a wrong scale."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.identification.monitor.monitor import named_effects

PERIOD = 0.02


def told_by(watch, measured):
    time = PERIOD * np.arange(len(next(iter(measured.values()))))
    found = watch.compile().simulate(time, {**measured, "reset": 0 * time}).outputs
    return dict(zip((s.name for s in watch.outputs), found, strict=True))


def name_at(watch, out, k):
    return named_effects(watch)[round(float(out["effect"][k])) - 1]


def spins(arm, seed):
    """Samples of a point `arm` ahead of the centre of a craft that spins at 8 rad/s from 12 s on."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(1000)
    turn = np.where((t >= 10.0) & (t < 12.0), 4.0, 0.0)
    noise = 0.05 * PERIOD**0.5 * rng.normal(size=(2, t.size))
    v, r = np.cumsum(noise[0]), np.cumsum(noise[1])
    r[1:] += np.cumsum(PERIOD * turn[:-1])
    psi = np.concatenate([[0.0], np.cumsum(PERIOD * (r[:-1] + PERIOD * turn[:-1] / 2))])
    seen_x = PERIOD * np.cumsum(v) + arm * np.cos(psi) + 1e-3 * rng.normal(size=t.size)
    seen_psi = psi + 2e-3 * rng.normal(size=t.size)
    return hc.Log("spins", t, {"seen_x": seen_x, "seen_psi": seen_psi, "turn": turn})


@pytest.fixture(scope="module")
def spinner():
    """x'' = 0, psi'' = turn; measured are psi and x + arm cos psi."""
    x, v, psi, r = (hc.Signal(k, u) for k, u in (("x", "m"), ("v", "m/s"), ("psi", "rad"), ("r", "rad/s")))
    turn, arm, push = hc.Signal("turn", "rad/s^2"), hc.Signal("arm", "m"), hc.Signal("push", "m/s^2")
    seen = [hc.Signal("seen_x", "m"), hc.Signal("seen_psi", "rad")]
    block = hc.Block(
        "spinner", [x, v, psi, r], [turn], seen, [arm, push],
        {"x": v.symbol, "v": push.symbol, "psi": r.symbol, "r": turn.symbol},
        {"seen_x": x.symbol + arm.symbol * sp.cos(psi.symbol), "seen_psi": psi.symbol},
    )  # fmt: skip
    return hc.monitor(
        block, ["arm", "push", "seen_psi_bias"], false_alarms_per_hour=1.0, period=PERIOD,
        measured=["seen_x", "seen_psi"], process_noise={"v": 0.05, "r": 0.05},
        measurement_noise={"seen_x": 1e-3, "seen_psi": 2e-3}, motion=spins(0.0, 9),
        start_std={"x": 0.01, "v": 0.1, "psi": 0.01, "r": 0.1},
    )  # fmt: skip


@pytest.mark.slow("-2", "-3")
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("arm", [0.0, 0.009])
def test_a_tracked_point_off_the_centre_is_named_with_its_place(spinner, arm, seed):
    """The point is off from the start, and shows once the craft spins."""
    log = spins(arm, seed)
    out = told_by(spinner, log.columns)
    assert out["alarm"][log.time < 10.0].max() == 0.0
    assert out["alarm"][-1] == (arm > 0)
    if arm:
        assert name_at(spinner, out, -1) == "arm"
        assert abs(out["change"][-1] - arm) < 2 * out["change_std"][-1] < 0.3 * arm


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_jump_of_a_sensor_is_named_at_once_with_its_size(spinner, seed):
    """The filter follows the jump within a few ticks; later samples say nothing of its size."""
    log = spins(0.0, seed)
    out = told_by(spinner, {**log.columns, "seen_psi": log.columns["seen_psi"] + 0.05 * (log.time >= 6.0)})
    assert out["alarm"][log.time < 6.0].max() == 0.0
    k = round(6.3 / PERIOD)
    assert name_at(spinner, out, k) == "seen_psi_bias"
    assert abs(out["change"][k] - 0.05) < 2 * out["change_std"][k] < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_scale_that_changes_is_named_with_its_size(seed):
    """x' = -c x + F, measured k x: the signature is x, which the filter has wrong after the change."""
    x, seen, F = hc.Signal("x", "m"), hc.Signal("seen", "m"), hc.Signal("F", "m/s")
    k, c = hc.Signal("k", "1", start=1.0), hc.Signal("c", "1/s", start=1.0)
    rates, outputs = {"x": F.symbol - c.symbol * x.symbol}, {"seen": k.symbol * x.symbol}
    watch = hc.monitor(
        hc.Block("cart", [x], [F], [seen], [k, c], rates, outputs), ["k", "seen_bias"],
        false_alarms_per_hour=1.0, period=PERIOD, measured=["seen"],
        process_noise={"x": 0.05}, measurement_noise={"seen": 0.01},
    )  # fmt: skip
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(1000)
    push, true, keep = 1.0 + np.sin(0.7 * t), np.zeros(t.size), np.exp(-PERIOD)
    for i in range(t.size - 1):
        noise = 0.05 * np.sqrt((1 - keep**2) / 2) * rng.normal()
        true[i + 1] = keep * true[i] + (1 - keep) * push[i] + noise
    measured = np.where(t < 10.0, 1.0, 1.1) * true + 0.01 * rng.normal(size=t.size)
    out = told_by(watch, {"seen": measured, "F": push})
    assert out["alarm"][t < 10.0].max() == 0.0
    assert name_at(watch, out, -1) == "k"
    assert abs(out["change"][-1] - 0.1) < 3 * out["change_std"][-1] < 0.1


@pytest.mark.slow
def test_a_large_offset_of_a_sensor_keeps_its_size_where_the_motion_is_not_linear():
    """x' = sin(psi), psi' = turn + w in steps of a millisecond; psi is off by 0.3 rad from 10 s on."""
    x, psi, turn = hc.Signal("x", "m"), hc.Signal("psi", "rad"), hc.Signal("turn", "rad/s")
    speed = hc.Signal("speed", "m/s", start=1.0)
    block = hc.Block(
        "glider", [x, psi], [turn], [x, psi], [speed],
        {"x": speed.symbol * sp.sin(psi.symbol), "psi": turn.symbol},
    )  # fmt: skip
    watch = hc.monitor(
        block, ["psi_bias"], false_alarms_per_hour=1.0, period=PERIOD, process_noise={"psi": 0.02},
        measurement_noise={"x": 1e-3, "psi": 5e-3}, start_std={"x": 0.01, "psi": 0.01},
    )  # fmt: skip
    t, off = PERIOD * np.arange(750), []
    turns = np.cos(1.3 * t)
    for seed in range(6):
        rng, truth, seen = np.random.default_rng(seed), np.zeros(2), []
        for u in turns:
            seen.append(truth)
            for _ in range(20):
                truth = truth + 1e-3 * np.array([np.sin(truth[1]), u])
            truth = truth + np.array([0.0, 0.02 * PERIOD**0.5 * rng.normal()])
        seen = np.array(seen) + [1e-3, 5e-3] * rng.normal(size=(t.size, 2))
        out = told_by(watch, {"x": seen[:, 0], "psi": seen[:, 1] + 0.3 * (t >= 10.0), "turn": turns})
        assert name_at(watch, out, -1) == "psi_bias"
        off.append((out["change"][-1] - 0.3) / out["change_std"][-1])
        assert out["change_std"][-1] < 1e-3
    assert abs(np.median(off)) < 2.0
