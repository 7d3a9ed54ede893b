"""A reduced blind test: what is hidden is found, named, or honestly not named."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.identification.diagnose import diagnose

from .generator import Conditions, make, mild, outside

SHORT = Conditions(duration=15.0)


def named(found):
    return sorted({e.effect for e in found.effects})


@pytest.mark.slow
@pytest.mark.parametrize(
    "names",
    [
        ["yaw_stribeck"],
        ["thrust_lag"],
        ["thrust_saturation"],
        ["rudder_offset", "thrust_yaw_torque"],
        ["munk_moment", "sway_yaw_coupling"],
    ],
    ids="+".join,
)
def test_hidden_effects_are_named_and_close_the_gap(names):
    case = make(11, names, SHORT)
    found = diagnose(case.model, case.logs, case.holdout)
    assert found.verdict == "effect"
    assert named(found) == sorted(names)
    truth = {e.name: e for e in case.truth.effects}
    for number in found.effects:
        e = truth[number.effect]
        value = next(v for k, v in e.values.items() if e.parameter(k) == number.parameter)
        assert number.value == pytest.approx(value, abs=5 * number.std + 1e-3 * abs(value))
    for channel, after in found.after.nrmse.items():
        assert after < 1.6 * found.after.floor[channel]  # a second ahead, from smoothed states
        assert after <= 1.02 * found.before.nrmse[channel]


@pytest.mark.slow
def test_a_jump_is_found_with_its_time():
    case = make(100, ["parameter_jump"])
    found = diagnose(case.model, case.logs)
    assert named(found) == ["parameter_jump"]
    jump = case.truth.effect("parameter_jump").values
    assert found.amended.effect("parameter_jump").values["seconds"] == pytest.approx(
        jump["seconds"], abs=0.05
    )
    assert found.effects[0].value == pytest.approx(jump["factor"], rel=0.01)


def test_nothing_is_found_where_nothing_is_missing():
    case = make(12, [], SHORT)
    found = diagnose(case.model, case.logs, case.holdout)
    assert (found.verdict, found.effects, found.rivals) == ("none", (), ())
    assert not any(r.there for r in found.remainders)
    left, seen = found.selection.final.left, found.selection.final.problem.seen
    assert np.mean(left[seen] ** 2) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_measurements_ahead_of_the_commands_are_a_clock():
    case = make(3, ["time_offset"], SHORT)
    seconds = case.truth.effect("time_offset").values["seconds"]
    assert seconds < 0
    found = diagnose(case.model, case.logs)
    assert (found.verdict, named(found)) == ("effect", ["time_offset"])
    assert found.effects[0].value == pytest.approx(seconds, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["oscillator", "patch"])
def test_what_no_effect_says_is_not_named(kind):
    case = outside(1, kind, Conditions(duration=24.0))
    found = diagnose(case.model, case.logs)
    assert found.verdict == "unexplained"
    assert found.effects == () and any(r.there for r in found.remainders)


@pytest.mark.slow
def test_a_craft_that_grows_lighter_has_a_thrust_that_grows_with_time():
    # u' = r v + F/(1 + a t), F = c7 T - drag: about F (1 - a t), so the law -a c7 t T, less what drag grows
    case = outside(1, "mass", Conditions(duration=24.0))
    found = diagnose(case.model, case.logs)
    assert (found.verdict, named(found)) == ("partial", ["law_u__time__thrust"])
    lighter = 0.0050140524 * case.model.coefficients()["thrust"]
    assert 0.5 * lighter < found.effects[0].value < lighter


@pytest.mark.slow
def test_gusts_are_no_effect_and_hide_none():
    case = make(14, ["slope"], Conditions(duration=24.0, gusts=True))
    found = diagnose(case.model, case.logs)
    assert found.verdict == "partial" and named(found) == ["slope"]
    level = found.selection.final.noise.process
    np.testing.assert_allclose(level, [0.05, 0.05, 0.15], rtol=0.5)
    calm = make(15, [], Conditions(duration=24.0, gusts=True))
    found = diagnose(calm.model, calm.logs)
    assert found.verdict == "unexplained" and not found.effects


@pytest.mark.slow
def test_in_gusts_what_is_far_from_linear_is_found_by_a_fit():
    case = make(23, ["yaw_stribeck"], Conditions(duration=60.0, gusts=True))  # no score says so
    found = diagnose(case.model, case.logs)
    assert (found.verdict, named(found)) == ("partial", ["yaw_stribeck"])


@pytest.mark.slow
def test_a_drag_held_by_its_bound_hides_no_other():
    case = make(22, ["yaw_stribeck"], Conditions(duration=30.0, logs=1, channels=("u", "v", "r")))
    found = diagnose(case.model, case.logs, case.holdout)  # fitted without it, the linear drag in yaw is zero
    assert (found.verdict, named(found)) == ("effect", ["yaw_stribeck"])


@pytest.mark.slow
def test_faulty_logs_say_what_clean_ones_say():
    case = make(1, ["slope"], Conditions(duration=25.0, faults=True))
    found = diagnose(case.model, case.logs, case.holdout)
    assert (found.verdict, named(found)) == ("effect", ["slope"])
    assert found.rows_dropped > 0.03 * sum(len(log) for log in case.logs)


@pytest.mark.slow
def test_mild_laps_name_an_effect_too():
    case = make(16, ["munk_moment"], Conditions(duration=24.0, commands=mild))
    assert named(diagnose(case.model, case.logs)) == ["munk_moment"]


def test_the_hold_out_log_must_take_no_part():
    case = make(17, [], Conditions(duration=5.0, logs=1))
    with pytest.raises(InputError, match="held-out log is the training log"):
        diagnose(case.model, case.logs, case.logs[0])


def test_without_logs_there_is_nothing_to_say():
    with pytest.raises(InputError, match="at least one log"):
        diagnose(make(17, [], Conditions(duration=5.0, logs=1)).model, [])
