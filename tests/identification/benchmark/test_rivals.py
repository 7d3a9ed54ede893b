"""Rivals on a case that they must get right: no noise, a linear drag that the model lacks."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.identification.benchmark.rivals import arx, sindy

DRAG = 1.3


@pytest.fixture(scope="module")
def cart():
    """v' = u - 1.3 v exactly, for steps of u; the model has v' = k u."""
    v, u, k = hc.Signal("v", "m/s"), hc.Signal("u", "1"), hc.Signal("k", "m/s^2", start=1.0)
    model = hc.BlockModel(hc.Block("cart", (v,), (u,), (v,), (k,), {"v": k.symbol * u.symbol}))
    rng, dt, logs = np.random.default_rng(0), 0.02, []
    for name in ("train", "holdout"):
        force, speed = np.repeat(rng.uniform(-1, 1, 40), 30), [0.0]
        for now in force[:-1]:
            end = now / DRAG
            speed.append(end + (speed[-1] - end) * np.exp(-DRAG * dt))
        logs.append(hc.Log(name, dt * np.arange(force.size), {"v": np.array(speed), "u": force}))
    return model, (logs[0],), logs[1]


def test_sindy_finds_a_linear_drag_and_its_coefficient(cart):
    pytest.importorskip("pysindy")
    found = sindy.answer(*cart)
    assert [(t.equation, t.text) for t in found.terms] == [("v", "v")]
    assert found.terms[0].coefficient == pytest.approx(-DRAG, rel=0.02)
    assert found.predicted.to_numpy().derivatives(0.0, [1.0], [0.0])[0] == pytest.approx(-DRAG, rel=0.02)


def test_arx_sees_that_something_is_missing_and_predicts_it(cart):
    found = arx.answer(*cart)
    assert (found.verdict, found.terms) == ("missing", ())
    assert found.predicted.to_numpy().derivatives(0.0, [1.0], [0.0])[0] == pytest.approx(-DRAG, rel=0.02)


def test_neither_finds_anything_in_what_the_model_has(cart):
    pytest.importorskip("pysindy")
    _, train, holdout = cart
    v, u, k = hc.Signal("v", "m/s"), hc.Signal("u", "1"), hc.Signal("k", "m/s^2", start=1.0)
    d = hc.Signal("d", "1/s", start=1.2)
    whole = hc.BlockModel(
        hc.Block("cart", (v,), (u,), (v,), (k, d), {"v": k.symbol * u.symbol - d.symbol * v.symbol})
    )
    rng = np.random.default_rng(1)
    noisy = [
        log.with_columns({"v": log["v"] + 2e-3 * rng.normal(size=len(log))}) for log in (*train, holdout)
    ]
    for tool in (sindy, arx):
        assert tool.answer(whole, (noisy[0],), noisy[1]).verdict == "none"
