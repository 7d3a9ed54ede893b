"""Predictions some time ahead: as far off as the noise of what they start from says."""

from itertools import pairwise

import numpy as np
import pytest

from hovercontrol.estimation.prediction import horizons, predict


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


def test_predictions_stay_within_their_block(fit):
    longest = fit.problem.rows.seconds.max()
    assert predict(fit, longest + 0.05) is None
    found = predict(fit, 0.9 * longest)
    assert 0 < found.block.size < 100


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
    for w in range(rows.time.shape[1]):
        own = np.flatnonzero(rows.at[:, w] >= 0)
        for k, after in pairwise(own):
            h, F = rows.time[after, w] - rows.time[k, w], log.inputs[0, rows.at[k, w]]
            p, v = path[k, w]
            fade, goal = np.exp(-drag * h), gain * F / drag
            errors.append(rows.values[after, w, 0] - (p + goal * h + (v - goal) * (1 - fade) / drag))
    assert found.rms["p"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-3)


def test_a_slow_machine_is_judged_farther_ahead(fit):
    assert horizons(fit) == pytest.approx((0.5, 1.25, 2.5)[: len(horizons(fit))])
    assert max(horizons(fit)) < 0.8 * fit.problem.rows.seconds.max()
    assert horizons(fit, (0.5, 1.0)) == pytest.approx((0.5, 1.0))
