"""Sub-steps: finer ones change nothing, and only the steps that need them have them."""

import numpy as np
import pytest

from hovercontrol.estimation.problem import Problem
from hovercontrol.estimation.substeps import fine_enough, pieces_needed

from ..discrepancy.generator import Conditions, make


@pytest.fixture
def steep(fitted):
    """Return a fit, in coarse sub-steps, of a craft whose dry friction is steep near standstill."""
    case = make(31, ["yaw_stribeck"], Conditions(duration=20.0, logs=1))
    widths = {k: 5e-4 for k in case.truth.coefficients() if k.endswith("_width")}
    return fitted(case.truth.with_coefficients(widths), case.logs, frozen=True)


def test_steps_that_need_more_sub_steps_have_them_and_others_do_not(steep):
    each = pieces_needed(steep)
    problem = Problem(steep.problem.model, steep.problem.data, pieces=each)
    assert problem.pieces == each.max() > each.min()
    uniform = Problem(steep.problem.model, steep.problem.data, pieces=problem.pieces)
    n = len(problem.free)
    spread = np.sqrt(np.diagonal(steep.covariance_of_path[1:], axis1=2, axis2=3)[..., :n])
    sparing, full = (q.advance(steep.path, steep.p) for q in (problem, uniform))
    assert (np.abs(sparing[0] - full[0]) / spread).max() < 2e-3
    finest = (each == problem.pieces).reshape(problem.dt.shape)
    for part, whole in zip(sparing, full, strict=True):
        np.testing.assert_array_equal(part[finest], whole[finest])
    velocity = np.abs(steep.path[:-1][..., list(problem.free)][..., list(problem.driven)]).min(axis=-1)
    assert np.median(velocity[finest]) < np.median(velocity[~finest])


def test_once_fine_enough_nothing_changes_any_more(steep):
    fit = fine_enough(steep)
    each = pieces_needed(fit)
    np.testing.assert_array_equal(each, fit.problem.each)
    uniform = Problem(fit.problem.model, fit.problem.data, pieces=2 * fit.problem.pieces)
    F, G = (q.advance(fit.path, fit.p, jacobian=False)[0] for q in (fit.problem, uniform))
    assert np.abs(F - G).max() < 1e-3


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
