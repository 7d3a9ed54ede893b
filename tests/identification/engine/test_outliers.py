"""Samples that stand alone are outliers; where all are far off, none is."""

import numpy as np
import pytest

from hovercontrol.identification.engine.outliers import outliers


@pytest.fixture
def left(rng):
    return rng.normal(size=(400, 3, 2))


def test_normal_samples_are_none(left):
    assert not outliers(left, np.ones(left.shape, dtype=bool)).any()


@pytest.mark.parametrize("at", [(17, 100, 250), (0, 399)], ids=["inside", "ends"])
def test_single_samples_are_found(left, at):
    left[at, 1, 0] = [30.0, -25.0, 400.0][: len(at)]
    found = outliers(left, np.ones(left.shape, dtype=bool))
    assert [tuple(i) for i in np.argwhere(found)] == [(k, 1, 0) for k in at]


def test_of_samples_close_together_the_farthest_goes_first(left):
    left[[100, 102, 104], 0, 1] = [30.0, 200.0, -40.0]
    found = outliers(left, np.ones(left.shape, dtype=bool))
    assert np.argwhere(found).tolist() == [[102, 0, 1]]


def test_where_all_are_far_off_none_is(left):
    left[150:220, 2, 0] *= 30.0
    assert not outliers(left, np.ones(left.shape, dtype=bool)).any()
    left[180, 2, 0] = 3000.0
    assert np.argwhere(outliers(left, np.ones(left.shape, dtype=bool))).tolist() == [[180, 2, 0]]


def test_what_was_not_seen_is_none(left):
    seen = np.ones(left.shape, dtype=bool)
    left[100, 0, 0], seen[100, 0, 0] = 500.0, False
    assert not outliers(left, seen).any()
    assert not outliers(left, np.zeros(left.shape, dtype=bool)).any()
