"""Logs from which nothing right can follow are refused in one line, doubtful ones are warned about."""

import numpy as np
import pytest

from hovercontrol.discrepancy.checks import check_excitation, check_logs
from hovercontrol.discrepancy.clocks import command_drift
from hovercontrol.discrepancy.windowed import gather
from hovercontrol.errors import InputError
from hovercontrol.logs import Log
from hovercontrol.vehicles import four_fan

from .generator import Conditions, make

CASE = make(1, [], Conditions(duration=24.0))
LOG, OTHER = CASE.logs


def changed(log=LOG, **columns):
    return Log(log.name, log.time, {**log.columns, **columns})


def without(*names):
    return Log(LOG.name, LOG.time, {k: v for k, v in LOG.columns.items() if k not in names})


def test_good_logs_pass_without_a_word():
    assert check_logs(CASE.model, CASE.logs, CASE.holdout) == []
    assert check_excitation(CASE.model, gather(CASE.model, CASE.logs)) == []


@pytest.mark.parametrize("effect", ["thrust_lag", "battery_sag", "input_delay", "sensor_lever_arm", "wind"])
def test_a_missing_effect_is_no_fault_of_the_log(effect):
    case = make(7, [effect], Conditions(duration=24.0))
    assert check_logs(case.model, case.logs, case.holdout) == []


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (changed().select(slice(0, 60)), "log 1: too short: the longest stretch without a break is 1.18 s"),
        (
            Log("a", LOG.time, {k.replace("rudder", "ruder"): v for k, v in LOG.columns.items()}),
            "a: no column 'rudder', an input of the model; did you mean 'ruder'?",
        ),
        (
            without("thrust", "rudder"),
            "log 1: expected the model's inputs thrust, rudder, found columns x, y, psi, u, v, r: "
            "is the model of this craft?",
        ),
        (changed(u=np.full(len(LOG), np.nan)), "log 1: column 'u' is empty: NaN in all 1200 rows"),
        (changed(v=np.zeros(len(LOG))), "log 1: column 'v' is constant while x moves"),
        (changed(psi=np.degrees(LOG["psi"])), "column 'psi': expected a heading in rad"),
        (changed(r=np.degrees(LOG["r"])), "column 'r': expected a yaw rate in rad/s"),
        (changed(x=1e3 * LOG["x"], y=1e3 * LOG["y"]), "the position moves 1000 times as far"),
        (Log("a", 1e3 * LOG.time, LOG.columns), "a: rows are 20 s apart: is its time in seconds?"),
    ],
)
def test_a_bad_log_is_refused_in_one_line(log, said):
    with pytest.raises(InputError) as error:
        check_logs(CASE.model, [log])
    assert said in str(error.value) and "\n" not in str(error.value)


def test_the_model_of_another_craft_is_recognised():
    with pytest.raises(InputError, match="is the model of this craft"):
        check_logs(four_fan(), [LOG])


def test_times_in_other_units_are_seen_between_logs():
    fast = Log("b", 1e-3 * OTHER.time, OTHER.columns)
    with pytest.raises(InputError, match=r"too short|same unit"):
        check_logs(CASE.model, [LOG, fast])


def test_a_hold_out_log_that_is_a_training_log_is_refused():
    again = Log("again", LOG.time + 100.0, dict(reversed(LOG.columns.items())))
    with pytest.raises(InputError, match="again: the hold-out log is the training log log 1"):
        check_logs(CASE.model, [OTHER, LOG], again)


def test_a_hold_out_log_that_overlaps_a_training_log_is_refused():
    first, second = LOG.between(0.0, 16.0), LOG.between(12.0, 30.0)
    with pytest.raises(InputError, match=r"shares 20\d rows with the training log log 1"):
        check_logs(CASE.model, [first], second)
    assert check_logs(CASE.model, [LOG.between(0.0, 11.9)], second) == []


def test_logs_that_rest_alike_are_not_the_same():
    still = {k: np.where(LOG.time < 4.0, 0.0, v) for k, v in LOG.columns.items()}
    other = {k: np.where(OTHER.time < 4.0, 0.0, v) for k, v in OTHER.columns.items()}
    said = check_logs(CASE.model, [Log("a", LOG.time, still)], Log("b", LOG.time, other))
    assert not any("shares" in s for s in said)


def test_a_stuck_sensor_is_warned_about():
    row = LOG["u"].copy()
    row[300:400] = row[300]
    (said,) = check_logs(CASE.model, [changed(u=row)])
    assert "'u' stays at" in said and "from 6.00 to 7.98 s" in said


def test_saturated_commands_are_warned_about():
    wave = 3.0 * np.sin(LOG.time)
    said = check_logs(CASE.model, [changed(thrust=np.clip(wave, -4.0, 2.0))])
    assert any("thrust is at its limit of 2 in" in s for s in said)
    assert not any("-4" in s for s in said)


def test_switched_commands_are_not_saturated():
    said = check_logs(CASE.model, [changed(thrust=np.sign(np.sin(LOG.time)))])
    assert not any("limit" in s for s in said)


def test_clocks_that_drift_apart_are_warned_about():
    case = make(1, [], Conditions(duration=40.0, logs=1))
    log = case.logs[0]
    late = np.searchsorted(log.time, 0.995 * log.time + 1e-9, side="right") - 1
    drifting = changed(log, thrust=log["thrust"][late], rudder=log["rudder"][late])
    drift, chance = command_drift(case.model, drifting)
    assert drift == pytest.approx(-0.2, abs=0.03) and chance < 1e-4
    assert any("drift apart" in s for s in check_logs(case.model, [drifting]))
    assert command_drift(case.model, log)[1] > 1e-2


def test_positions_at_another_pace_are_warned_about():
    said = check_logs(CASE.model, [changed(x=1.1 * LOG["x"], y=1.1 * LOG["y"])])
    assert any("moves 1.1 times as fast" in s for s in said)


def test_a_short_log_is_warned_about():
    assert check_logs(CASE.model, [LOG.between(0.0, 5.0)])[0].startswith(
        "log 1: 5 s without a break are little"
    )


def test_what_cannot_be_known_is_named():
    resting = changed(rudder=np.zeros(len(LOG)))
    said = check_excitation(CASE.model, gather(CASE.model, [resting]))
    assert any("rudder_torque cannot be known" in s and "rudder stays 0" in s for s in said)


def test_a_log_that_tells_nothing_is_refused():
    rng = np.random.default_rng(0)
    rest = {k: 1e-3 * rng.normal(size=len(LOG)) for k in ("x", "y", "psi", "u", "v", "r")}
    still = Log("still", LOG.time, {**rest, "thrust": 0 * LOG.time, "rudder": 0 * LOG.time})
    with pytest.raises(InputError, match="still: no coefficient of the model can be known"):
        check_excitation(CASE.model, gather(CASE.model, [still]))
