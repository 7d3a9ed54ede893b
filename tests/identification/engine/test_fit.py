"""Fits: path, unknowns and levels of noise together."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import CONVERGENCE, estimate, first_noise, refit
from hovercontrol.identification.engine.noise import averaged
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.logs import Log
from tests.identification.diagnose.generator import Conditions, make

SHORT = Conditions(duration=12.0, logs=1)


def ahead(rng, duration, dt):
    """Return thrust alone: the craft goes straight, no sway and no yaw."""
    t = np.arange(0.0, duration, dt)
    return {"thrust": 1.5 + np.sin(t), "rudder": np.zeros(t.size)}


def deviations(fit, truth):
    """Return how many standard errors each unknown is off."""
    std = np.sqrt(np.diag(fit.covariance))
    found = zip(fit.problem.names, fit.p, std, strict=True)
    return {name: abs(v - truth[name]) / s for name, v, s in found if name in truth}


def test_without_noise_coefficients_come_back_exactly(fitted, cart_model, pushed_log):
    fit = fitted(cart_model, [pushed_log(push=0.0, noise=1e-7)])
    assert dict(zip(fit.problem.names, fit.p, strict=True)) == pytest.approx(
        {"drag": 0.6, "gain": 1.7}, rel=1e-3
    )
    assert fit.converged


def test_process_noise_goes_to_zero_where_nothing_is_missing(fitted):
    case = make(41, [], SHORT)
    fit = fitted(case.model, case.logs, pieces=2)
    assert fit.converged
    assert (averaged(fit.noise, 0.2) < 5e-3 * fit.problem.accelerations).all()
    noise = dict(zip(fit.problem.rows.channels, fit.noise.measured, strict=True))
    assert noise == pytest.approx(
        {"x": 1e-3, "y": 1e-3, "psi": 2e-3, "u": 5e-3, "v": 5e-3, "r": 1e-2}, rel=0.15
    )
    own = {k: v for k, v in case.truth.coefficients().items() if not k.endswith("_width")}
    assert max(deviations(fit, own).values()) < 4.0


@pytest.mark.parametrize("seed", range(3))
def test_coefficients_come_back_in_pushes_that_no_command_says(fitted, cart_model, pushed_log, seed):
    fit = fitted(cart_model, [pushed_log(push=0.5, seconds=60.0, seed=seed)])
    assert max(deviations(fit, {"drag": 0.6, "gain": 1.7}).values()) < 3.5
    assert fit.noise.process[0] == pytest.approx(0.5, rel=0.4)
    assert fit.noise.measured[0] == pytest.approx(0.01, rel=0.1)


def test_gaps_and_irregular_stamps_do_not_bend_the_result(fitted, cart_model, pushed_log):
    log = pushed_log(push=0.0, seconds=30.0)
    rng, n = np.random.default_rng(2), len(log)
    kept = rng.random(n) > 0.2
    kept[200:218] = False
    log = log.select(kept)
    fit = fitted(cart_model, [log])
    # where rows are lost it is not known when the command changed: that is allowed for
    assert max(deviations(fit, {"drag": 0.6, "gain": 1.7}).values()) < 4.0
    assert fit.p[1] == pytest.approx(1.7, rel=0.03)
    assert fit.noise.process[0] < 0.05


def test_outliers_are_left_out_and_nothing_else(fitted, cart_model, pushed_log):
    log = pushed_log(push=0.3, seconds=30.0)
    rng = np.random.default_rng(3)
    hit = rng.random(len(log)) < 0.02
    sizes = np.where(hit, rng.choice([-1.0, 1.0], len(log)) * rng.uniform(0.3, 3.0, len(log)), 0.0)
    bad = Log("bad", log.time, {**log.columns, "p": log["p"] + sizes})
    clean, fit = fitted(cart_model, [log], gate=True), fitted(cart_model, [bad], gate=True)
    out = np.zeros(len(log), dtype=bool)
    values = np.full(len(log), np.nan)
    problem = fit.problem
    for w in range(len(problem.rows.log)):
        own = problem.rows.at[:, w] >= 0
        out[problem.rows.at[own, w]] = ~problem.seen[own, w, 0]
        values[problem.rows.at[own, w]] = fit.path[own, w, 0]
    assert clean.problem.seen.sum() == len(log)
    far = np.abs(sizes) > 30 * clean.noise.measured[0]
    assert out[far].mean() > 0.9 and out[~hit].mean() < 0.003
    assert fit.p == pytest.approx(clean.p, rel=0.15)
    assert np.nanstd((values - log["p"])[~hit]) < 0.012


def test_outliers_too_small_to_be_left_out_do_not_pull(fitted, cart_model, pushed_log):
    """Nor do they make a channel noisier than it is, and no sample of a clean log is taken for one."""
    log = pushed_log(push=0.0, seconds=60.0)
    rng = np.random.default_rng(5)
    hit = np.zeros(len(log), dtype=bool)
    hit[rng.choice(np.arange(5, len(log), 6), 30, replace=False)] = True
    sizes = np.where(hit, 0.01 * rng.choice([-1.0, 1.0], len(log)) * rng.uniform(11.0, 15.0, len(log)), 0.0)
    bad = Log("bad", log.time, {**log.columns, "p": log["p"] + sizes})
    clean, fit = fitted(cart_model, [log], gate=True), fitted(cart_model, [bad], gate=True)
    assert not clean.problem.data.down_weighted.any()
    down, rows = fit.problem.data.down_weighted[..., 0], fit.problem.rows
    at = rows.at[down]
    assert len(at) > 0.9 * hit.sum() and hit[at].mean() > 0.95
    assert fit.noise.measured[0] == pytest.approx(clean.noise.measured[0], rel=0.1)
    assert fit.p == pytest.approx(clean.p, abs=np.sqrt(np.diag(clean.covariance)).max())
    off = sizes[at] / 0.01
    np.testing.assert_allclose(fit.problem.data.variance[..., 0][down], off**2, rtol=0.8)
    again = refit(fit, Problem(cart_model, fit.problem.data), fit.prior)  # the weights stay with the data
    assert again.noise.measured[0] == pytest.approx(fit.noise.measured[0], rel=0.01)


def test_dry_friction_along_an_axis_has_one_width(fitted):
    case = make(31, ["yaw_stribeck"], SHORT)
    fit = fitted(case.truth, case.logs, pieces=2)
    assert "yaw_coulomb_width" in fit.problem.names and "yaw_stribeck_width" not in fit.problem.names
    values = fit.model.coefficients()
    assert values["yaw_stribeck_width"] == values["yaw_coulomb_width"] != 0.01


def test_a_width_that_no_log_tells_stays_where_the_model_has_it(fitted):
    case = make(32, [], replace(SHORT, commands=ahead))
    fit = fitted(case.model, case.logs)
    widths = {k: v for k, v in fit.model.coefficients().items() if k.endswith("_width")}
    assert widths["yaw_coulomb_width"] == pytest.approx(0.01, rel=0.05)
    assert all(5e-4 <= width < 0.1 for width in widths.values())


def test_the_prior_says_its_own_slope(rng):
    case = make(33, [], replace(SHORT, duration=5.0))
    problem = Problem(case.model, gather(case.model, case.logs))
    prior = prior_of(problem, case.model)
    z = problem.inside(
        problem.outside(problem.inside(problem.start) + 0.3 * rng.normal(size=len(problem.start)))
    )
    for j in range(z.size):
        step = np.zeros_like(z)
        step[j] = 1e-6
        half = (prior.cost(z + step) - prior.cost(z - step)) / 4e-6
        assert prior.slope(z)[j] == pytest.approx(half, rel=1e-4, abs=1e-7)
    assert prior.cost(problem.inside(problem.start)) == 0.0
    assert (prior.precision > 0.0).all()  # of all that the model has
    assert problem.log_scale.tolist() == [name.endswith("_width") for name in problem.names]


def test_nothing_is_held_of_what_was_added():
    case = make(33, [], replace(SHORT, duration=5.0))
    more = case.model.with_effects([effect("yaw_quadratic_drag", 0.1), effect("thrust_lag", seconds=0.1)])
    problem = Problem(more, gather(more, case.logs))
    precision = dict(zip(problem.names, prior_of(problem, case.model).precision, strict=True))
    assert [name for name, v in precision.items() if v == 0.0] == ["yaw_quadratic_drag", "thrust_lag_seconds"]


def test_unknowns_stay_within_their_bounds(fitted, cart, pushed_log):
    drag, gain = cart.parameters
    narrow = replace(cart, parameters=(drag.replace(start=0.3, upper=0.3), gain))
    fit = fitted(as_model(narrow), [pushed_log()])
    assert fit.p[fit.problem.names.index("drag")] == 0.3  # the truth is 0.6
    assert fit.movable.tolist() == [fit.problem.names.index("gain")]


def test_a_refit_ends_where_the_first_one_did(fitted, cart_model, pushed_log):
    fit = fitted(cart_model, [pushed_log()])
    again = refit(fit, fit.problem, fit.prior)
    assert again.cost == pytest.approx(fit.cost, abs=1.0)
    assert (np.abs(again.p - fit.p) < 0.1 * np.sqrt(np.diag(fit.covariance))).all()


def test_a_path_that_sticks_and_slips_comes_to_rest(fitted):
    """Undamped, each pass takes the path across dry friction's kink, and the cost by 20."""
    case, costs = make(16, ["input_delay"], SHORT), []
    note = lambda line: costs.append(float(line.split(":")[1].split()[0]))  # noqa: E731
    fit = fitted(as_model(case.model), case.logs, trace=note)
    assert fit.converged and len(costs) < 18 and abs(costs[-1] - costs[-2]) < 2.0 * CONVERGENCE.settled


def test_frozen_unknowns_do_not_move(fitted, cart_model, pushed_log):
    fit = fitted(cart_model, [pushed_log(push=0.0)], frozen=True)
    assert fit.p.tolist() == fit.problem.start.tolist()
    assert fit.noise.process[0] > 0.1  # the coefficients are off


def test_costs_of_blocks_add_up(fitted, cart_model, pushed_log):
    fit = fitted(cart_model, [pushed_log()])
    z = fit.problem.inside(fit.p)
    assert fit.block_costs.sum() + fit.prior.cost(z) == pytest.approx(fit.cost)
    assert fit.S.shape == (len(fit.block_costs), 2, 2)


def test_standard_errors_cover_the_truth(cart_model, pushed_log):
    z = []
    for seed in range(25):
        problem = Problem(cart_model, gather(cart_model, [pushed_log(seed=seed, seconds=15.0)]))
        fit = estimate(problem, prior_of(problem, cart_model), first_noise(problem))
        z.append(list(deviations(fit, {"drag": 0.6, "gain": 1.7}).values()))
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5
