"""Sub-steps: halved ones change nothing, only the steps that need them have them, and all fit together."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose.search.candidates import Candidate
from hovercontrol.identification.diagnose.search.columns import columns
from hovercontrol.identification.engine.problem import MOST, Problem
from hovercontrol.identification.engine.step_control import CLOSE, controlled, deviations
from hovercontrol.identification.engine.substeps import within
from tests.identification.diagnose.generator import Conditions, make


@pytest.fixture
def steep(fitted):
    """Return the fit of a craft whose dry friction is steep near standstill."""
    case = make(31, ["yaw_stribeck"], Conditions(duration=20.0, logs=1))
    widths = {k: 2e-3 for k in case.truth.coefficients() if k.endswith("_width")}
    return fitted(case.truth.with_coefficients(widths), case.logs, frozen=True)


def in_pieces(fit, pieces):
    return Problem(fit.problem.model, fit.problem.data, pieces=pieces)


def test_a_fit_has_sub_steps_of_which_halved_ones_change_nothing(steep):
    std = deviations(steep.problem, steep.variance_of_path)
    problem = controlled(steep.problem, steep.path, steep.p, std)  # the last pass moved the path a little
    assert problem.each.sum() < 1.05 * steep.problem.each.sum()
    halved = in_pieces(steep, np.minimum(2 * problem.each, MOST))
    ends = [q.advance(steep.path, steep.p, jacobian=False)[0] for q in (problem, halved)]
    assert (np.abs(ends[0] - ends[1]) / std[1:]).max() <= CLOSE / np.sqrt(problem.dt.size)
    assert controlled(problem, steep.path, steep.p, std) is problem


def test_only_steps_near_standstill_have_many_sub_steps(steep):
    each = steep.problem.each.reshape(steep.problem.dt.shape)
    velocity = np.abs(steep.path[:-1][..., list(steep.problem.free)][..., list(steep.problem.driven)])
    many = each >= 4 * each.min()
    assert 0.0 < many.mean() < 0.5
    assert np.median(velocity.min(axis=-1)[many]) < 0.3 * np.median(velocity.min(axis=-1)[~many])


def test_the_ends_of_steps_are_those_of_scipy(steep):
    """Within a small part of what the logs can tell, where friction is steepest."""
    problem, parameters = steep.problem, steep.problem.parameters(steep.p)
    std = deviations(problem, steep.variance_of_path)
    found = problem.advance(steep.path, steep.p, jacobian=False)[0]
    slopes = problem.block.to_numpy().array_derivatives
    W = problem.dt.shape[1]
    for at in np.argsort(problem.each)[-4:]:
        row, window = divmod(int(at), W)
        steps = [g.steps for g in problem.steps.in_time(parameters).groups if at in g.at]
        (column,) = (
            np.flatnonzero(g.at == at) for g in problem.steps.in_time(parameters).groups if at in g.at
        )
        x = steep.path[row, window].copy()
        for t, h, u in zip(
            steps[0].t[:, column[0]], steps[0].h[:, column[0]], steps[0].u[:, :, column[0]].T, strict=True
        ):
            x = solve_ivp(
                lambda t, x, u=u: np.array(slopes(t, x, u, parameters)), (t, t + h), x, rtol=1e-9, atol=1e-12
            ).y[:, -1]
        assert (
            np.abs(found[row, window] - x[list(problem.free)]) / std[row + 1, window]
        ).max() < 3 * CLOSE / np.sqrt(problem.dt.size)


def test_a_fit_in_its_own_sub_steps_costs_what_one_in_the_finest_does(fitted, steep):
    finest = fitted(steep.problem.model, steep.problem.logs, pieces=MOST, frozen=True)
    assert steep.cost == pytest.approx(finest.cost, abs=0.5)


def test_columns_of_candidates_do_not_depend_on_how_steps_are_divided(fitted):
    case = make(31, [], Conditions(duration=12.0, logs=1))
    tried = [
        Candidate("slope", effect("slope", x=0.1), ("x",)),
        Candidate("thrust_lag", effect("thrust_lag", 0.1), ("seconds",)),
    ]
    found = []
    for pieces in (1, 16):
        fit = fitted(case.truth, case.logs, pieces=pieces, frozen=True, levels=False)
        ((drive, _),) = columns(fit, tried)[0]
        found.append(drive)
    for k in range(found[0].shape[-1]):
        one, other = (f[..., k] for f in found)
        assert np.abs(one - other).max() < 0.02 * np.abs(other).max() > 0.0


def test_sub_steps_in_time_follow_each_other(steep):
    problem = steep.problem
    steps = problem.steps.in_time(problem.parameters(steep.p))
    own = steps.h > 0
    assert own.sum(axis=0).tolist() == [
        int(e[d > 0].sum())
        for e, d in zip(problem.each.reshape(problem.dt.shape).T, problem.dt.T, strict=True)
    ]
    np.testing.assert_allclose((steps.t[:-1] + steps.h[:-1])[own[1:]], steps.t[1:][own[1:]], atol=1e-9)
    np.testing.assert_allclose(steps.h.sum(axis=0), problem.dt.sum(axis=0))
    middle = within(steep).states
    straight = steps.between(steep.path)
    assert np.abs(middle - straight)[:, own].max() < 0.1 * np.ptp(steep.path, axis=(0, 1)).max()


@pytest.mark.parametrize("name", ["thrust_lag", "input_delay"])
def test_sub_steps_that_are_kept_are_those_made_anew(fitted, name):
    case = make(3, [name], Conditions(duration=10.0, logs=1))
    problem = fitted(case.truth, case.logs, frozen=True).problem
    for factor in (1.0, 1.5, 1.0, 2.0, 2.5, 3.0, 1.0):  # more than are kept
        p = problem.start * np.where([name in n for n in problem.names], factor, 1.0)
        parameters = problem.parameters(p)
        kept = problem.steps.divided(parameters)
        fresh = Problem(problem.model, problem.data, pieces=problem.each).steps.divided(parameters)
        for (which, one), (whose, other) in zip(kept, fresh, strict=True):
            np.testing.assert_array_equal(which, whose)
            np.testing.assert_array_equal(one.t, other.t)
            np.testing.assert_array_equal(one.u, other.u)
            assert one.lagged.keys() == other.lagged.keys()
            for i, values in one.lagged.items():
                np.testing.assert_array_equal(values, other.lagged[i])
