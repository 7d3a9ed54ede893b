"""A metric's statistics, against values a reader can check."""

import math

import numpy as np
import pytest

from hovercontrol.documents.scenarios.definition import Metric
from hovercontrol.documents.scenarios.measures import measure

TIME = np.arange(7.0)
VALUES = np.array([9.0, 0.0, 2.0, 1.1, 0.5, 1.05, 0.95])


@pytest.mark.parametrize(
    ("statistic", "value"),
    [("mean", 5.6 / 6), ("min", 0.0), ("max", 2.0), ("peak", 2.0), ("reached", 2.0), ("settled", 4.0)],
)
def test_statistics_of_the_window(statistic, value):
    metric = Metric("m", "r", 1.0, 6.0, statistic=statistic, target=1.0, within=0.11)
    assert measure(metric, TIME, VALUES) == pytest.approx(value)


def test_what_is_never_reached_or_does_not_last_takes_for_ever():
    never = Metric("m", "r", 1.0, 6.0, statistic="reached", target=5.0, within=0.1)
    assert measure(never, TIME, VALUES) == math.inf
    leaves = Metric("m", "r", 1.0, 4.0, statistic="settled", target=1.0, within=0.11)
    assert measure(leaves, TIME, VALUES) == math.inf
    always = Metric("m", "r", 5.0, 6.0, statistic="settled", target=1.0, within=0.11)
    assert measure(always, TIME, VALUES) == 0.0


def test_the_peak_is_the_largest_size_and_the_spread_the_standard_deviation():
    assert measure(Metric("m", "r", 0, 6, statistic="peak"), TIME, -VALUES) == 9.0
    assert measure(Metric("m", "r", 0, 6, statistic="std"), TIME, VALUES) == pytest.approx(VALUES.std())


def test_what_is_passed_between_two_rows_counts_as_crossed_from_either_side():
    """A value that jumps over the target is never near it."""
    near = Metric("m", "r", 1.0, 6.0, statistic="reached", target=1.5, within=0.1)
    crossed = Metric("m", "r", 1.0, 6.0, statistic="crossed", target=1.5)
    assert (measure(near, TIME, VALUES), measure(crossed, TIME, VALUES)) == (math.inf, 1.0)
    falling = Metric("m", "r", 2.0, 6.0, statistic="crossed", target=0.7)
    assert measure(falling, TIME, VALUES) == 2.0
    assert measure(Metric("m", "r", 1.0, 6.0, statistic="crossed", target=2.1), TIME, VALUES) == math.inf


def test_farthest_is_the_largest_distance_on_either_side():
    assert measure(Metric("m", "r", 1.0, 6.0, statistic="farthest", target=1.1), TIME, VALUES) == 1.1
    assert measure(Metric("m", "r", 1.0, 6.0, statistic="farthest", target=0.9), TIME, VALUES) == 1.1
