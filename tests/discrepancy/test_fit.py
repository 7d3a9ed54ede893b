"""Fits: widths of dry friction, the weak prior, jumps, and effects that a score misses."""

import numpy as np
import pytest

from hovercontrol.discrepancy import diagnose
from hovercontrol.discrepancy.data import gather
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.holdout import gap, may_rise
from hovercontrol.discrepancy.prior import Prior
from hovercontrol.discrepancy.windowed import Windowed

from .generator import Conditions, make, mild


def ahead(rng, duration, dt):
    """Return thrust alone: the craft goes straight, no sway and no yaw."""
    t = np.arange(0.0, duration, dt)
    return {"thrust": 1.5 + np.sin(t), "rudder": np.zeros(t.size)}


def test_dry_friction_along_an_axis_has_one_width():
    case = make(31, ["yaw_stribeck"], Conditions(duration=15.0, logs=1))
    data = gather(case.model, case.logs)
    found = fit(case.truth, data, 1.0, prior_model=case.model)
    assert "yaw_coulomb_width" in found.windowed.names
    assert "yaw_stribeck_width" not in found.windowed.names
    values = found.model.coefficients()
    assert values["yaw_stribeck_width"] == values["yaw_coulomb_width"] != 0.01
    again = Windowed(found.model, data, 1.0)
    again.set_step(again.start, found.x0, found.windowed.pieces, enough=True)
    residual, _ = again.linearise(again.start, found.x0, jacobian=False)
    np.testing.assert_allclose(residual, found.residual, atol=1e-9)


def test_a_width_that_no_log_tells_stays_where_the_model_has_it():
    case = make(32, [], Conditions(commands=ahead, duration=15.0, logs=1))
    found = fit(case.model, gather(case.model, case.logs), 1.0)
    widths = {k: v for k, v in found.model.coefficients().items() if k.endswith("_width")}
    assert widths["yaw_coulomb_width"] == 0.01
    assert all(1e-3 < width < 0.1 for width in widths.values())  # surge's ran to its bound before


def test_the_prior_says_its_own_slope_and_curvature():
    case = make(33, [], Conditions(duration=5.0, logs=1))
    w = Windowed(case.model, gather(case.model, case.logs), 1.0)
    prior, rng = Prior(w, case.model), np.random.default_rng(0)
    p = w.start * rng.uniform(0.7, 1.4, w.start.size)
    for j, size in enumerate(1e-5 * np.abs(p)):
        step = np.zeros_like(p)
        step[j] = size
        half = (prior.cost(p + step) - prior.cost(p - step)) / (4.0 * size)
        assert prior.slope(p)[j] == pytest.approx(half, rel=1e-5, abs=1e-9)
    assert prior.cost(w.start) == 0.0
    assert (prior.precision(p) > 0.0).all()
    # a width off by a factor of e is as unlikely up as down
    widths = np.where(w.is_width, np.e, 1.0)
    assert prior.cost(w.start * widths) == pytest.approx(prior.cost(w.start / widths))


def test_a_slight_jump_is_found_with_its_time():
    case = make(9029, ["parameter_jump"], Conditions(scale=0.1))
    found = diagnose(case.model, case.logs, names=["parameter_jump"])
    jump = case.truth.effect("parameter_jump").values["seconds"]
    assert found.verdict == "effect"
    assert found.amended.effect("parameter_jump").values["seconds"] == pytest.approx(jump, abs=0.05)


def test_an_effect_that_its_score_hides_is_found_by_a_fit():
    case = make(2206, ["body_surge_force"], Conditions(commands=mild))
    found = diagnose(case.model, case.logs, case.holdout, names=["body_surge_force", "thrust_lag"])
    assert found.verdict == "effect"
    assert [e.effect for e in found.effects] == ["body_surge_force"]
    name, score = found.selection.steps[0]
    assert score < 24.0 < found.selection.gains[name]


def test_errors_of_the_solver_are_no_effect():
    case = make(15017, ["input_delay"], Conditions(laps=True))
    found = diagnose(case.model, case.logs, names=["input_delay", "parameter_jump"])
    assert found.selection.effects == ["input_delay"]  # at 4 sub-steps a jump gained 615, at 32 it is 1.8
    assert found.selection.final.chi2_per_dof < 1.01


def test_a_fit_that_hung_begins_again_at_the_given_coefficients():
    case = make(2310, ["thrust_yaw_torque"], Conditions(commands=mild))
    found = diagnose(case.model, case.logs, names=["thrust_yaw_torque", "yaw_stribeck"])
    assert found.verdict == "effect"
    (e,) = found.effects
    truth = case.truth.effect("thrust_yaw_torque").values["value"]
    assert abs(e.value - truth) < 3.0 * e.std  # it hung at a tenth of it


def test_a_number_more_is_charged_and_the_hold_out_log_may_ask_what_no_training_log_tells():
    case = make(2302, ["yaw_quadratic_drag"], Conditions(commands=mild))
    found = diagnose(case.model, case.logs, case.holdout, names=["yaw_quadratic_drag", "yaw_stribeck"])
    assert (found.verdict, found.selection.effects) == ("ambiguous", ["yaw_quadratic_drag"])
    (rival,) = found.rivals
    assert rival.name == "yaw_stribeck"
    assert rival.behind > 0.0  # by likelihood alone it is ahead: it has a speed to choose, too
    assert not found.signs
    before, after = found.before, found.after
    assert after.chi2 > before.chi2 + 24.0  # by surge's width of friction, which mild logs hardly tell
    final = found.selection.final
    assert after.chi2 - before.chi2 < may_rise(final, found.held, 1.0)


def test_what_a_hold_out_log_may_rise_is_what_draws_of_the_coefficients_make_of_it():
    case = make(34, ["slope"], Conditions(duration=20.0, logs=1))
    found = fit(case.truth, gather(case.model, case.logs), 1.0, prior_model=case.model)
    held = gather(case.model, [case.holdout])
    w, rng = found.windowed, np.random.default_rng(5)
    least = gap(case.truth, held, 1.0).chi2
    rises = []
    for p in rng.multivariate_normal(w.start, found.covariance, 60):  # about the truth
        values = w.coefficients(np.clip(p, w.lower, w.upper))
        rises.append(gap(w.model.with_coefficients(values), held, 1.0).chi2 - least)
    most = may_rise(found, held, 1.0)
    assert np.mean(rises) < most
    assert np.mean(np.array(rises) > most) < 0.05
    assert most < 6.0 * max(np.mean(rises), 1.0)  # no blank cheque
