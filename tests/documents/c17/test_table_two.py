"""Table II over what C17 does not print: the sweep's means are those of single runs."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.documents.c17.mean_errors import mean_errors
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.definition import Metric, Phase

TABLE2 = load_scenario("table2")
SHORT = replace(
    TABLE2,
    phases=(Phase("off", 1.0), Phase("on", 3.0, adaptation=1.0, scale={"yaw_coulomb": 1.3})),
    estimator={**TABLE2.estimator, "start": 1.0},
    metrics=(Metric("a", "tracking_error", 0.5, 1.0), Metric("b", "tracking_error", 2.0, 3.0)),
)


@pytest.mark.slow
def test_the_means_are_those_of_single_runs_and_hang_on_what_is_given():
    given = {
        "sensor.seed": np.array([[1.0], [2.0]]),
        "computer.estimator.last_P[7,7]": np.array([100.0, 0.0]),
    }
    found = mean_errors(SHORT, given)
    assert found.shape == (2, 2, 2)
    once = [m.value for m in run_scenario(SHORT).metrics()]
    np.testing.assert_allclose(found[0, 0], once, rtol=1e-2)  # the log has every 10 ms
    assert found[0, 0, 0] == pytest.approx(found[0, 1, 0], rel=1e-9)  # the estimator is off
    assert found[0, 0, 1] != pytest.approx(found[0, 1, 1], rel=1e-6)
    assert found[0, 0, 0] != pytest.approx(found[1, 0, 0], rel=1e-6)


def test_what_has_no_windows_is_refused():
    with pytest.raises(InputError, match="expected a sampled scenario"):
        mean_errors(load_scenario("table1"), {"controller.k1": 1.0})
