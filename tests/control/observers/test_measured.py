"""Which outputs are measured: those with a measurement noise, unless others are named."""

import pytest

import hovercontrol as hc
from tests.control.observers.observed_plants import NOISE, H, cart

POSITION = {"measurement_noise": {"x": 0.02}}
ESTIMATORS = {
    "extended_kalman": NOISE | {"period": H},
    "continuous": NOISE,
    "unscented_kalman": NOISE | {"period": H},
    "moving_horizon": NOISE | {"step": H, "horizon": 3},
    "disturbance_observer": POSITION | {"disturbance_noise": {"v": 0.1}, "period": H},
    "monitor": NOISE | {"candidates": ["drag"], "false_alarms_per_hour": 1.0, "period": H},
}


def made(name, **given):
    function = hc.extended_kalman if name == "continuous" else getattr(hc, name)
    return function(cart(), **(ESTIMATORS[name] | given))


@pytest.mark.slow("monitor")
@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_machine_of_ones_own_is_measured_where_its_noise_is_given(name):
    found, named = made(name), made(name, measured=["x"])
    if name == "moving_horizon":
        found, named = found.sampled, named.sampled
    assert found == named


def test_several_measurements_stand_in_the_order_of_their_noise():
    noise = {"v": 0.1, "x": 0.02}
    found = hc.extended_kalman(cart(), process_noise={"v": 0.3}, measurement_noise=noise, period=H)
    assert [s.name for s in found.inputs] == ["v", "x", "push"]


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_misspelt_key_is_named_with_its_argument(name):
    with pytest.raises(hc.InputError, match=r"measure.*'speed'"):
        made(name, measurement_noise={"speed": 0.1})
