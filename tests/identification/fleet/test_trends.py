"""Changes of a coefficient over time, in simulated estimates."""

import numpy as np
import pytest

from hovercontrol.identification.fleet.random_effects import flagged
from hovercontrol.identification.fleet.trends import outlying, scatter, trend

DAYS = np.arange(25.0)


def test_a_jump_is_found_with_its_day(rng):
    y = 1.0 + 0.1 * rng.normal(size=25) + 0.5 * (DAYS >= 15)
    found = trend(y, np.full(25, 0.01), DAYS, 500)
    assert found.shape == "step" and found.earliest <= 14.5 <= found.latest and found.p < 1e-6
    assert found.before == pytest.approx(1.0, abs=0.1) and found.now == pytest.approx(
        1.5, abs=4 * found.now_std
    )


def test_a_drift_that_begins_is_a_ramp(rng):
    y = 1.0 + 0.02 * rng.normal(size=25) + 0.05 * np.maximum(DAYS - 10, 0)
    found = trend(y, np.full(25, 0.0004), DAYS, 500)
    assert found.shape == "ramp" and found.earliest <= 10.5 and found.latest >= 9.5
    assert found.now == pytest.approx(1.7, abs=4 * found.now_std)


def test_of_constants_five_percent_change_at_most(rng):
    p = [trend(rng.normal(size=25), np.ones(25), DAYS, 500).p for _ in range(200)]
    assert np.mean(np.array(p) < 0.05) < 0.08


def test_the_scatter_between_logs_is_not_that_of_a_drift(rng):
    craft, time = np.repeat(np.arange(20), 25), np.tile(DAYS, 20)
    y = 0.3 * rng.normal(size=500) + 0.1 * rng.normal(size=500) + 0.2 * time * (craft < 5)
    found, dof = scatter(y, np.full(500, 0.01), craft, time)
    assert found == pytest.approx(0.3, rel=0.15) and dof == int(0.37 * 480)


def test_one_log_in_other_units_is_unlike_its_neighbours_and_a_jump_is_not(rng):
    craft, time = np.repeat(np.arange(4), 25), np.tile(DAYS, 4)
    y = 1.0 + 0.1 * rng.normal(size=100)
    y[7] *= 57.3
    y[25:50] += 1.0 * (DAYS >= 12)
    p = outlying(y, np.full(100, 0.01), craft, time, 100)
    assert np.flatnonzero(flagged(p)).tolist() == [7]
