"""Whether blocks agree: on made-up numbers, and on logs whose blocks do and do not."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.discrepancy.diagnose import base_fit
from hovercontrol.discrepancy.evidence.blocks import agreement, of_effect, scatter
from hovercontrol.effects import effect
from hovercontrol.estimation.data import gather

from .generator import Conditions, make, outside

SHORT = Conditions(duration=20.0, logs=1)


def said(estimates, information):
    """Return what blocks say that each estimate a size with so much information."""
    estimates, information = np.asarray(estimates, float), np.asarray(information, float)
    estimates = estimates / np.average(estimates, weights=information)
    return scatter(estimates * information, information, np.zeros(estimates.size, dtype=np.intp))


def test_blocks_that_scatter_as_noise_says_have_no_spread(rng):
    spread, t = [], []
    for _ in range(200):
        found = said(1.0 + 0.1 * rng.normal(size=12), np.full(12, 100.0))
        spread.append(found.spread)
        t.append(found.t)
    assert np.mean(spread) < 0.05 and (found.n, found.same_sign) == (12, 12)
    assert np.median(t) == pytest.approx(np.sqrt(12.0) / 0.1, rel=0.15)


def test_spread_beyond_noise_comes_back(rng):
    spread = [said(1.0 + 0.5 * rng.normal(size=400), np.full(400, 1e4)).spread for _ in range(5)]
    assert np.mean(spread) == pytest.approx(0.5, rel=0.1)


def test_t_is_by_the_scatter_not_by_the_information():
    estimates = [1.0, 3.0, -1.0, 1.0, 2.0, 0.0]
    found = said(estimates, np.full(6, 1e6))
    values = np.array(estimates)
    assert found.t == pytest.approx(values.mean() / (values.std(ddof=1) / np.sqrt(6)))
    assert found.dof == pytest.approx(5.0) and found.same_sign == 4
    assert found.p_value > 0.1


def test_blocks_that_tell_nothing_do_not_count():
    found = said([1.0, 1.1, 0.9, -50.0, 30.0], [100.0, 100.0, 100.0, 1e-9, 0.0])
    assert (found.n, found.same_sign) == (3, 3) and found.spread == 0.0
    assert found.std[4] == np.inf and found.estimate[4] == 0.0
    assert found.dof == pytest.approx(2.0)


def test_a_single_block_that_tells_all_is_no_agreement():
    found = said([1.0, 1.0, 1.0, 1.0], [1e6, 1.0, 1.0, 1.0])
    assert found.dof < 0.01 and found.p_value > 0.01


def test_no_information_is_no_size():
    found = scatter(np.zeros(4), np.zeros(4), np.zeros(4, dtype=np.intp))
    assert (found.n, found.t, found.spread) == (0, 0.0, 0.0) and found.p_value > 0.9


@pytest.fixture(scope="module")
def sloped():
    case = make(51, ["slope"], SHORT)
    data = gather(case.model, case.logs)
    return base_fit(case.model, data), base_fit(case.truth, data)


def test_blocks_agree_on_what_is_there(sloped):
    less, fit = sloped
    found = agreement(fit, less, "slope")
    assert found.t > 10.0 and found.p_value < 1e-4
    assert found.spread < 0.2 and found.same_sign == found.n == len(fit.S)
    assert found.estimate.mean() == pytest.approx(1.0, abs=0.1)
    mine = of_effect(fit, "slope")
    assert mine.t == found.t


def test_blocks_do_not_agree_on_what_is_not(sloped):
    _, fit = sloped
    case = make(51, ["slope"], SHORT)
    more = case.truth.with_effects([effect("yaw_quadratic_drag", 0.0), effect("body_side_force", 0.0)])
    fit = base_fit(more, gather(more, case.logs))
    for name in ("yaw_quadratic_drag", "body_side_force"):
        assert of_effect(fit, name).p_value > 1e-3


def test_what_no_number_scales_is_judged_by_its_gain(sloped):
    less, fit = sloped
    with pytest.raises(KeyError):
        of_effect(base_fit(*delayed()), "input_delay")
    model, data = delayed()
    late = base_fit(model, data)
    none = base_fit(model.with_coefficients({"input_delay_seconds": 0.0}), data)
    del less, fit, none
    assert late.problem.model.effect("input_delay")


def delayed():
    case = make(52, ["input_delay"], replace(SHORT, duration=10.0))
    return case.truth, gather(case.truth, case.logs)


def test_a_jump_that_each_block_wants_its_own_of_is_uneven():
    """Rough stripes: drags differ from place to place, no jump in time says it."""
    jump = effect("parameter_jump", factor=1.3, seconds=10.0)
    case = outside(3, "patch", SHORT)
    rough = base_fit(case.model.with_effects([jump]), gather(case.model, case.logs))
    case = make(53, [], SHORT)
    case = make(53, ["parameter_jump"], replace(SHORT, duration=40.0))
    even = base_fit(case.truth, gather(case.truth, case.logs))
    assert of_effect(even, "parameter_jump").spread < 0.1
    assert of_effect(rough, "parameter_jump").spread > 1 / 3
