"""Changes that no candidate explains, that end, that grow, or that are large: a cart in exact steps."""

import numpy as np
import pytest

import hovercontrol as hc
from tests.identification.monitor.cart import cart_monitor, log

SEEDS = [1, 2, 3, 4]


@pytest.mark.parametrize("seed", SEEDS)
def test_an_acceleration_that_no_candidate_explains_is_unknown(seed):
    found = hc.replay(cart_monitor(), log(50.0, seed=seed, push=0.2))
    (alarm,) = found.alarms
    assert (alarm.kind, alarm.name, alarm.unit, alarm.rivals) == ("unknown", "v", "m/s^2", ())
    assert abs(alarm.change - 0.2) < 3 * alarm.std < 0.15
    assert [label.get_text() for label in found.plot().axes[1].get_yticklabels()] == ["v"]
    assert "no candidate explains the change" in found.text()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_weaker_force_is_no_change_of_the_drag(seed):
    """The command changes its sign with the speed, and a drag is no constant force: it follows for a time."""
    first, *_ = hc.replay(cart_monitor(), log(50.0, seed=seed, gain=0.8)).alarms
    assert (first.kind, first.name, first.rivals) == ("unknown", "v", ()) and np.isnan(first.ended)


@pytest.mark.parametrize("seed", SEEDS)
def test_an_offset_of_a_sensor_that_is_no_candidate_is_unknown(seed):
    (alarm,) = hc.replay(cart_monitor("c"), log(50.0, seed=seed, bias=0.1)).alarms
    assert (alarm.kind, alarm.name, alarm.unit) == ("unknown", "p_bias", "m")
    assert abs(alarm.change - 0.1) < 3 * alarm.std < 0.1
    assert "no candidate explains the change: an offset of" in str(alarm)


def test_a_name_has_an_unknown_acceleration_as_its_rival_until_its_size_holds():
    watch, run = cart_monitor(), log(50.0, drag=0.4)
    inputs = {
        s.name: run.columns.get(s.name, 0 * run.time + s.name.startswith("fresh")) for s in watch.inputs
    }
    names = [s.name for s in watch.outputs]
    out = dict(zip(names, watch.compile().simulate(run.time, inputs).outputs, strict=True))
    k = int(np.argmax(out["alarm"] > 0.5))
    assert out["effect"][k] == out["effect"][-1] == 1.0
    assert out["possible_unknown_v"][k + 1] == 1.0 and out["possible_unknown_v"][-1] == 0.0


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_knock_is_no_offset_of_a_sensor(seed):
    """It moves the cart once; the offset that explains the first samples is not significant later."""
    for alarm in hc.replay(cart_monitor(), log(seed=seed, push=1.0, until=30.3)).alarms:
        assert alarm.rivals or alarm.kind == "unknown"


@pytest.mark.parametrize("until", [33.0, 45.0])
def test_a_change_that_ends_is_told_once_with_both_times(until):
    """It ends while the evidence is collected, or after it was put into the monitor."""
    right = 0
    for seed in range(1, 7):
        first, *others = hc.replay(cart_monitor(), log(seed=seed, drag=0.4, until=until)).alarms
        told = first.name == "c" and abs(first.since - 30.0) < 2.0
        right += told and not others and abs(first.ended - until) < 5.0
    assert right == 6


def test_a_change_that_grows_has_its_rate():
    """Ten seconds after the onset; without a restart of the tests."""
    watch, errors = cart_monitor(), []
    for seed in range(8):
        run = log(45.0, seed=seed, ramp=0.1)
        inputs = {
            s.name: run.columns.get(s.name, 0 * run.time + s.name.startswith("fresh")) for s in watch.inputs
        }
        out = dict(
            zip(
                (s.name for s in watch.outputs),
                watch.compile().simulate(run.time, inputs).outputs,
                strict=True,
            )
        )
        assert out["rate_std"][-50] < 0.1
        errors.append((out["rate"][-50] - 0.1) / out["rate_std"][-50])
    assert (np.abs(errors) < 2.0).sum() >= 6


@pytest.mark.parametrize("drag", [0.3, 1.0, 3.0])
def test_errors_hold_for_large_changes(drag):
    """The drag is up to seven times as large: the response is not linear."""
    runs = [hc.replay(cart_monitor(), log(45.0, seed=seed, drag=drag)).alarms[0] for seed in range(8)]
    z = np.array([(a.change - drag) / a.std for a in runs])
    assert {a.name for a in runs} == {"c"} and (np.abs(z) < 2.0).sum() >= 6 and abs(z.mean()) < 1.0
