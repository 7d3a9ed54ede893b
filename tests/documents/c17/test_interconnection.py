"""C17's Theorem 5 by Monte Carlo, and the confidence intervals of what it counts."""

import numpy as np
import pytest
from scipy.stats import binomtest

from hovercontrol.analysis.proportions import clopper_pearson
from hovercontrol.documents.c17.interconnection import region_of_attraction
from hovercontrol.errors import InputError


@pytest.fixture(scope="module")
def near():
    return region_of_attraction((0.0, 1.0), (0.0, 1.0), cells=3, runs=8, limits=False, deadline=8.0)


def test_intervals_are_those_of_scipys_exact_test():
    for k, n in ((0, 20), (7, 20), (20, 20), (1, 1), (999, 1000)):
        low, high = clopper_pearson(k, n, 0.9)
        by_scipy = binomtest(k, n).proportion_ci(0.9, method="exact")
        assert (low, high) == pytest.approx((by_scipy.low, by_scipy.high), abs=1e-12)


def test_intervals_cover_the_truth_as_often_as_they_say(rng):
    for truth in (0.03, 0.5, 0.97):
        count = rng.binomial(50, truth, 4000)
        low, high = clopper_pearson(count, 50)
        assert ((low <= truth) & (truth <= high)).mean() >= 0.95 - 0.01


def test_from_small_errors_every_loop_gets_to_the_reference(near):
    assert (near["in the end"] == 1.0).all()
    assert (near["in time"] == 1.0).all()
    low, _ = clopper_pearson(8, 8)
    assert (near["in the end low"] == low).all()
    np.testing.assert_allclose(near.x.values, [1 / 6, 1 / 2, 5 / 6])


@pytest.mark.slow
def test_the_band_holds_the_share_and_limits_of_the_commands_cost_time(near):
    hard = region_of_attraction((0.0, 8.0), (0.0, 8.0), cells=2, runs=12, deadline=5.0)
    for region in (near, hard):
        for name in ("in time", "in the end"):
            assert (region[f"{name} low"] <= region[name]).all()
            assert (region[name] <= region[f"{name} high"]).all()
    free = region_of_attraction((0.0, 8.0), (0.0, 8.0), cells=2, runs=12, deadline=5.0, limits=False)
    assert hard["in time"].mean() < free["in time"].mean() - 0.1
    assert hard["in the end"].mean() > 0.9


def test_the_same_seed_gives_the_same_numbers(near):
    again = region_of_attraction((0.0, 1.0), (0.0, 1.0), cells=3, runs=8, limits=False, deadline=4.0)
    other = region_of_attraction((0.0, 1.0), (0.0, 1.0), cells=3, runs=8, limits=False, deadline=4.0)
    assert (again["in time"] == other["in time"]).all()
    assert 0 < again["in time"].mean() < 1


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: region_of_attraction((-1.0, 1.0)), "not negative"),
        (lambda: region_of_attraction((1.0, 1.0)), "is empty"),
        (lambda: region_of_attraction(tracking_error=(2.0, 1.0)), "is reversed"),
        (lambda: region_of_attraction(cells=1), "2 or more cells"),
        (lambda: region_of_attraction(runs=0), "1 or more in a cell"),
        (lambda: region_of_attraction(duration=0.0), "duration must be positive"),
        (lambda: region_of_attraction(cells=10_000, runs=10), r"1e\+09 runs would take .* GiB"),
        (lambda: clopper_pearson(3, 2), "between 0 and the number of runs"),
        (lambda: clopper_pearson(1, 2, 1.0), "level must lie between"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()
