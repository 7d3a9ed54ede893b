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
