"""Logs from which nothing right can follow are refused in one line, doubtful ones are warned about."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.vehicles import four_fan
from hovercontrol.identification.diagnose.checks import check_fitted, check_logs, slow_rows
from hovercontrol.identification.diagnose.checks.clocks import command_drift
from hovercontrol.identification.diagnose.checks.excitation import check_excitation, predicts_nothing
from hovercontrol.identification.diagnose.checks.timing import time_constant
from hovercontrol.identification.diagnose.checks.units import refuse_units
from hovercontrol.identification.diagnose.diagnose import diagnose
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.logs import Log

from .generator import NOISE, SIZES, Conditions, make, simulated

CASE = make(1, [], Conditions(duration=24.0))
LOG, OTHER = CASE.logs


def changed(log=LOG, **columns):
    return Log(log.name, log.time, {**log.columns, **columns})


def without(*names):
    return Log(LOG.name, LOG.time, {k: v for k, v in LOG.columns.items() if k not in names})


def excitation(model, logs):
    return check_excitation(base_fit(model, gather(model, logs)))


def in_degrees(log, *names):
    return changed(log, **{name: np.degrees(log[name]) for name in names})


def test_good_logs_pass_without_a_word():
    assert check_logs(CASE.model, CASE.logs, CASE.holdout) == []
    assert excitation(CASE.model, CASE.logs) == []


@pytest.mark.parametrize("effect", ["thrust_lag", "battery_sag", "input_delay", "sensor_lever_arm", "wind"])
def test_a_missing_effect_is_no_fault_of_the_log(effect):
    case = make(7, [effect], Conditions(duration=24.0))
    assert check_logs(case.model, case.logs, case.holdout) == []


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (changed().select(slice(0, 10)), "log 1: too short: the longest stretch without a break has 10 rows"),
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
        (in_degrees(LOG, "psi", "r"), "columns 'psi' and 'r': expected rad and rad/s"),
        (
            Log(
                "a",
                LOG.time,
                {k: v for k, v in in_degrees(LOG, "r").columns.items() if k not in ("x", "psi")},
            ),
            "a: column 'r': expected rad/s",
        ),
        (
            Log("a", LOG.time, {k: v for k, v in in_degrees(LOG, "psi").columns.items() if k not in "uvr"}),
            "a: column 'psi': expected rad, found a heading from",
        ),
        (in_degrees(LOG, "rudder"), "column 'rudder': expected an angle in rad"),
        (changed(x=1e3 * LOG["x"], y=1e3 * LOG["y"]), "the position moves 1000 times as far"),
        (
            Log(
                "a",
                LOG.time,
                {k: (1e3 if k in "xy" else 1.0) * LOG[k] for k in LOG.columns if k not in "uvr"},
            ),
            "is it in millimetres or centimetres? Give metres",
        ),
        (Log("a", 1e3 * LOG.time, LOG.columns), "a: rows are 20 s apart: is its time in seconds?"),
    ],
)
def test_a_bad_log_is_refused_in_one_line(log, said):
    with pytest.raises(InputError) as error:
        check_logs(CASE.model, [log])
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.slow("1000", "rudder-")
@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("thrust", 1000.0, "thrust would be 0.00"),
        ("thrust", 0.01, "thrust would be "),
        ("rudder", -1.0, "rudder_torque would be -"),
    ],
)
def test_commands_in_other_units_or_of_the_other_sign_are_refused(column, factor, said):
    logs = [changed(log, **{column: factor * log[column]}) for log in CASE.logs]
    with pytest.raises(InputError, match=said) as error:
        check_fitted(base_fit(CASE.model, gather(CASE.model, logs)))
    assert "'thrust' and 'rudder' (rad) in the model's units" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("given", [0.01, -0.01])
def test_a_small_effect_of_the_model_may_be_far_off(given):
    case = make(1, ["thrust_yaw_torque"], Conditions(duration=24.0))
    wanted = case.truth.effect("thrust_yaw_torque").values["value"]
    model = case.model.with_effects([effect("thrust_yaw_torque", given)])
    found = diagnose(model, case.logs)
    assert found.verdict == "none" and found.warnings == ()
    assert found.amended.effect("thrust_yaw_torque").values["value"] == pytest.approx(wanted, rel=0.02)


def test_commands_and_motion_that_are_never_known_together_are_refused():
    half = len(LOG) // 2
    early = {k: np.where(np.arange(len(LOG)) < half, LOG[k], np.nan) for k in ("thrust", "rudder")}
    late = {k: np.where(np.arange(len(LOG)) < half, np.nan, LOG[k]) for k in NOISE}
    with pytest.raises(
        InputError, match=r"input 'thrust' \(from 0 to 11.98 s\) and motion \(from 12 to 23.98 s"
    ):
        check_logs(CASE.model, [changed(**early, **late)])


def test_a_craft_that_whirls_is_not_in_degrees():
    whirling = Conditions(duration=24.0, commands=lambda rng, duration, dt: whirl(LOG.time))
    log = simulated(CASE.truth, np.random.default_rng(0), whirling, "whirl")
    assert np.abs(log["r"]).max() > 6.0
    refuse_units(CASE.model, log)
    with pytest.raises(InputError, match="look like degrees"):
        refuse_units(CASE.model, in_degrees(log, "psi", "r"))


def whirl(time):
    """Full thrust and rudder, to either side by turns."""
    return {"thrust": np.full(time.size, 6.0), "rudder": np.where(time % 8.0 < 5.0, 0.6, -0.6)}


@pytest.mark.slow
def test_a_model_that_predicts_nothing_is_said_to():
    other = make(2, [], Conditions(duration=24.0)).logs
    logs = [
        changed(a, **{k: b[k] for k in ("thrust", "rudder")}) for a, b in zip(CASE.logs, other, strict=True)
    ]
    (said,) = predicts_nothing(base_fit(CASE.model, gather(CASE.model, logs)))
    assert "the model does not predict the motion: 0.2 s ahead" in said
    assert predicts_nothing(base_fit(CASE.model, gather(CASE.model, CASE.logs))) == []


def test_the_model_of_another_craft_is_recognised():
    with pytest.raises(InputError, match="is the model of this craft"):
        check_logs(four_fan(), [LOG])


def test_times_in_other_units_are_seen_between_logs():
    fast = Log("b", 1e-3 * OTHER.time, OTHER.columns)
    with pytest.raises(InputError, match=r"too short|same unit"):
        check_logs(CASE.model, [LOG, fast])


def test_a_hold_out_log_that_is_a_training_log_is_refused():
    again = Log("again", LOG.time + 100.0, dict(reversed(LOG.columns.items())))
    with pytest.raises(InputError, match="again: the held-out log is the training log log 1"):
        check_logs(CASE.model, [OTHER, LOG], again)


def test_a_hold_out_log_that_overlaps_a_training_log_is_refused():
    first, second = LOG.between(0.0, 16.0), LOG.between(12.0, 30.0)
    with pytest.raises(InputError, match=r"shares 20\d rows with the training log log 1"):
        check_logs(CASE.model, [first], second)
    assert check_logs(CASE.model, [LOG.between(0.0, 11.9)], second) == []


@pytest.mark.parametrize("digits", [4, 5, 17])
@pytest.mark.parametrize("left_out", [(), ("r",), ("u", "v", "r")])
def test_a_copy_is_known_though_rounded_later_and_with_fewer_columns(digits, left_out):
    columns = {k: np.array([float(f"{v:.{digits}g}") for v in row]) for k, row in LOG.columns.items()}
    copy = Log("copy", LOG.time + 1000.0, {k: v for k, v in columns.items() if k not in left_out})
    with pytest.raises(InputError, match="copy: the held-out log is the training log log 1"):
        check_logs(CASE.model, [OTHER, LOG], copy)


def test_a_training_log_given_twice_is_refused():
    with pytest.raises(InputError, match="again: it is the training log log 1: its rows would be used twice"):
        check_logs(CASE.model, [LOG, OTHER, Log("again", LOG.time, LOG.columns)])


@pytest.mark.parametrize("noise", [1.0, 0.01])
def test_another_run_with_the_same_commands_is_no_copy(noise):
    again = Conditions(
        duration=24.0,
        noise=noise,
        commands=lambda rng, duration, dt: {k: LOG[k] for k in ("thrust", "rudder")},
    )
    runs = [simulated(CASE.truth, np.random.default_rng(k), again, f"run {k}") for k in range(3)]
    assert np.ptp([run["psi"] for run in runs], axis=0).max() < 0.05  # they do go the same way
    assert check_logs(CASE.model, runs[:2], runs[2]) == []


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


def drifting(log, part):
    """Return a log whose commands were stamped by a clock that runs slow by a part."""
    late = np.searchsorted(log.time, (1.0 - part) * log.time + 1e-9, side="right") - 1
    return changed(log, **{name: log[name][late] for name in ("thrust", "rudder")})


LONG = make(1, [], Conditions(duration=40.0, logs=1))


def test_clocks_that_drift_apart_are_refused():
    log = drifting(LONG.logs[0], 0.005)
    drift, chance, left = command_drift(LONG.model, log)
    assert drift == pytest.approx(-0.2, abs=0.03) and chance < 1e-4 and left < 0.5
    with pytest.raises(
        InputError, match=r"drift apart by -\d+ ms .* multiply the times of the commands"
    ) as error:
        check_logs(LONG.model, [log])
    assert float(str(error.value).split("commands by ")[1].split()[0]) == pytest.approx(0.995, abs=1e-3)
    assert command_drift(LONG.model, LONG.logs[0])[1] > 1e-2


def test_clocks_that_drift_a_little_apart_are_warned_about():
    (said,) = check_logs(LONG.model, [drifting(LONG.logs[0], 0.002)])
    assert "drift apart" in said and "two clocks joined" in said


@pytest.mark.parametrize("hidden", [["parameter_jump"], ["battery_sag"], ["rudder_lag"]])
def test_no_effect_is_taken_for_a_clock(hidden):
    case = make(9, hidden, Conditions(duration=40.0, logs=1))
    assert check_logs(case.model, case.logs) == []


def test_a_craft_whose_thrust_jumps_has_no_bad_clock(monkeypatch):
    """Best shifts of this log rise along a line by chance (1e-6), but no shift explains the misfit."""
    jump = {
        "factor": lambda rng: float(rng.choice([rng.uniform(1.5, 2.5), rng.uniform(0.4, 0.7)])),
        "seconds": lambda rng: float(rng.uniform(10.0, 50.0)),
    }
    monkeypatch.setitem(SIZES, "parameter_jump", jump)
    case = make(50005, ["parameter_jump", "thrust_lag"], Conditions(noise=3.0, logs=1))
    drift, chance, left = command_drift(case.model, case.logs[0])
    assert abs(drift) > 0.1 and chance < 1e-5 and left > 0.9
    assert not any("drift apart" in s for s in check_logs(case.model, case.logs))


def test_positions_at_another_pace_are_warned_about():
    said = check_logs(CASE.model, [changed(x=1.1 * LOG["x"], y=1.1 * LOG["y"])])
    assert any("moves 1.1 times as fast" in s for s in said)


def test_a_short_log_is_warned_about():
    assert check_logs(CASE.model, [LOG.between(0.0, 5.0)])[0].startswith(
        "log 1: 5 s without a break are short"
    )


def test_length_counts_in_time_constants_of_the_model():
    v, u, k = Signal("v", "m/s"), Signal("fan", "m/s"), Signal("k", "1/s", start=15.0)
    servo = BlockModel(Block("servo", [v], [u], [v], [k], {"v": k.symbol * (u.symbol - v.symbol)}))
    assert time_constant(servo) == pytest.approx(1 / 15)
    rng, t = np.random.default_rng(0), 0.005 * np.arange(200)
    log = Log("fast", t, {"v": rng.normal(size=200), "fan": rng.normal(size=200)})
    assert not any("short" in line for line in check_logs(servo, [log]))
    slow = servo.with_coefficients({"k": 1.0})
    said = "fast: 0.995 s without a break are short, 0.99 of the model's longest time constant (1 s)"
    assert check_logs(slow, [log])[0].startswith(said)
    with pytest.raises(InputError, match=r"fast: too short: the longest stretch .* has 10 rows, expected 12"):
        check_logs(servo, [log.select(slice(0, 10))])


def test_what_cannot_be_known_is_named():
    resting = changed(rudder=np.zeros(len(LOG)))
    said = excitation(CASE.model, [resting])
    assert any("rudder_torque is not excited" in s and "rudder stays 0" in s for s in said)


def test_a_log_that_tells_nothing_is_refused():
    rng = np.random.default_rng(0)
    rest = {k: 1e-3 * rng.normal(size=len(LOG)) for k in ("x", "y", "psi", "u", "v", "r")}
    still = Log("still", LOG.time, {**rest, "thrust": 0 * LOG.time, "rudder": 0 * LOG.time})
    with pytest.raises(InputError, match="still: no coefficient of the model is excited"):
        excitation(CASE.model, [still])


def test_another_machine_may_be_slow():
    h, u, k = Signal("h", "V", start=5.0), Signal("pump", "V"), Signal("k", "1/s", start=0.01)
    tank = BlockModel(Block("tank", [h], [u], [h], [k], {"h": k.symbol * (u.symbol - h.symbol)}))
    rng = np.random.default_rng(0)
    log = Log("slow", 4.0 * np.arange(200), {"h": 5.0 + rng.normal(size=200), "pump": rng.normal(size=200)})
    assert not any("is its time in seconds" in line for line in check_logs(tank, [log]))
    assert not slow_rows(tank, log)
    said = "slow: rows are 4 s apart, all motion of the model is over in 0.31 s: is the unit of time wrong"
    assert slow_rows(tank.with_coefficients({"k": 10.0}), log)[0].startswith(said)


def test_what_integrates_is_never_too_slow():
    x, v, u, c = Signal("x", "m"), Signal("v", "m/s"), Signal("u", "m/s^2"), Signal("c", "1/s", start=20.0)
    cart = BlockModel(
        Block("cart", [x, v], [u], [x], [c], {"x": v.symbol, "v": u.symbol - c.symbol * v.symbol})
    )
    t = 4.0 * np.arange(200)
    assert not slow_rows(cart, Log("slow", t, {"x": np.sin(t), "u": np.cos(t)}))
