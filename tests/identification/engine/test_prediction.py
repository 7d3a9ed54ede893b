"""Predictions some time ahead: as far off as the noise of what they start from says."""

from itertools import pairwise

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.engine.prediction import horizons, predict


@pytest.fixture
def fit(fitted, cart_model, pushed_log):
    return fitted(cart_model, [pushed_log(push=0.0, seconds=30.0)])


def test_a_model_that_lacks_nothing_predicts_to_the_noise(fit):
    for horizon in (0.2, 1.0):
        found = predict(fit, horizon)
        assert found.channels == ("p",)
        assert found.rms["p"] == pytest.approx(0.01, rel=0.15)
        assert found.errors.shape == (found.block.size, 1)


def test_predictions_are_worse_the_farther_where_pushes_come(fitted, cart_model, pushed_log):
    fit = fitted(cart_model, [pushed_log(push=0.5, seconds=30.0)])
    near, far = predict(fit, 0.2).rms["p"], predict(fit, 1.5).rms["p"]
    assert near < 0.02 < 0.1 < far


def test_predictions_go_on_into_the_next_block(fit):
    block, whole = fit.problem.rows.seconds.max(), float(np.ptp(fit.problem.logs[0].time))
    far = predict(fit, 2.0 * block)
    assert 0.009 < far.rms["p"] < 0.015  # where the path is known to a third of the noise
    apart = np.diff(np.unique(far.block))
    assert far.block.size > 200 and (apart >= 4).all()  # what overlaps is one part of the log
    assert predict(fit, whole + 0.1) is None


def test_no_prediction_crosses_a_very_long_gap(fitted, cart_model, pushed_log):
    log = pushed_log(push=0.0, seconds=30.0)
    near = (log.time > 10.0) & (log.time < 13.0)
    fit = fitted(
        cart_model, [type(log)(log.name, log.time[~near], {k: v[~near] for k, v in log.columns.items()})]
    )
    assert len(np.unique(fit.problem.rows.piece)) == 2
    ahead = round(0.5 / fit.problem.shortest)  # rows at the end of each piece from which none starts
    assert predict(fit, 0.5).block.size == (~near).sum() - 2 * ahead


def test_starts_are_spread_evenly(fit):
    every, some = predict(fit, 0.5), predict(fit, 0.5, starts=40)
    assert some.block.size == 40 and set(some.block) == set(every.block)
    assert some.rms["p"] == pytest.approx(every.rms["p"], rel=0.5)


def test_predictions_are_those_of_the_model(fit, cart):
    """From the path at rest the closed form of a cart with drag, pushed by what the log says."""
    found = predict(fit, 0.05)
    rows, path = fit.problem.rows, fit.path
    drag, gain = fit.p[fit.problem.names.index("drag")], fit.p[fit.problem.names.index("gain")]
    log = fit.problem.logs[0]
    errors = []
    own = [(k, w) for w in range(rows.time.shape[1]) for k in np.flatnonzero(rows.at[:, w] >= 0)]
    for start, after in pairwise(own):
        h, F = rows.time[after] - rows.time[start], log.inputs[0, rows.at[start]]
        p, v = path[start]
        fade, goal = np.exp(-drag * h), gain * F / drag
        errors.append(rows.values[after][0] - (p + goal * h + (v - goal) * (1 - fade) / drag))
    assert found.rms["p"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-3)


def test_a_slow_machine_is_judged_farther_ahead(fit):
    assert horizons(fit) == pytest.approx((0.5, 1.25, 2.5))  # 5 s would fit six times only
    assert horizons(fit, (0.5, 1.0)) == pytest.approx((0.5, 1.0))


def test_a_few_fast_rows_are_predicted_as_exactly_as_the_others(fitted):
    """x' = g (1 - x) - k u x: a valve u opens for one row in 200, and x falls within a tenth of a row."""
    x, u = hc.Signal("x", start=1.0), hc.Signal("u")
    g, k = hc.Signal("g", "1/s", start=0.5), hc.Signal("k", "1/s", start=2e3)
    law = {"x": g.symbol * (1 - x.symbol) - k.symbol * u.symbol * x.symbol}
    flask, t = hc.Block("flask", [x], [u], [x], [g, k], law), 0.02 * np.arange(1500)
    open_ = (np.arange(1500) % 200 == 100).astype(float)
    rate, rows = 0.5 + 2e3 * open_, np.ones(1500)
    for i in range(1499):  # exact from row to row
        goal = 0.5 / rate[i]
        rows[i + 1] = goal + (rows[i] - goal) * np.exp(-0.02 * rate[i])
    seen = rows + 1e-3 * np.random.default_rng(0).normal(size=1500)
    fit = fitted(as_model(flask), [hc.Log("run", t, {"x": seen, "u": open_})])
    assert predict(fit, 0.5).rms["x"] == pytest.approx(1e-3, rel=0.15)
