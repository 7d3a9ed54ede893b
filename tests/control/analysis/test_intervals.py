"""Confidence intervals of probabilities: SciPy's exact test, coverage of drawn counts, wrong arguments."""

import pytest
from scipy.stats import binomtest

from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis import clopper_pearson


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


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: clopper_pearson(3, 2), "between 0 and the number of runs"),
        (lambda: clopper_pearson(1, 2, 1.0), "level must lie between"),
    ],
)
def test_counts_and_levels_out_of_range_are_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()
