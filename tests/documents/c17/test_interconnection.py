"""C17's Theorem 5 by Monte Carlo."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis import clopper_pearson
from hovercontrol.documents.c17.interconnection import region_of_attraction


@pytest.fixture(scope="module")
def near():
    return region_of_attraction((0.0, 1.0), (0.0, 1.0), cells=3, runs=8, limits=False, deadline=8.0)


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
    ],
)
def test_what_cannot_be_drawn_is_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()
