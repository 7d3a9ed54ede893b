"""Whether blocks agree: on made-up numbers, and on logs whose blocks do and do not."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose.evidence.blocks import agreement, capped, of_effect, scatter
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather

from .generator import Conditions, make

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
    assert (found.n, found.same_sign) == (3, 3) and found.spread < 1e-4
    assert found.std[4] == np.inf and found.estimate[4] == 0.0
    assert found.dof == pytest.approx(2.0)


def test_a_single_block_that_tells_all_is_no_agreement():
    found = said([1.0, 1.3, 0.6, 1.2], [1e6, 1.0, 1.0, 1.0])
    assert found.t < 4.0 and found.p_value > 0.05


def test_few_blocks_that_each_know_enough_agree():
    """Of eight blocks one has most of the information; the others know the size to two per cent each."""
    std = np.array([0.015, 0.025, 0.003, 0.011, 0.012, 0.008, 0.012, 0.013])
    found = said([1.009, 1.011, 1.0, 1.005, 0.977, 1.004, 0.997, 1.007], std**-2.0)
    assert found.p_value < 1e-9 and found.dof == pytest.approx(5.0) and found.spread < 0.01


def test_blocks_that_know_little_do_not_spoil_what_others_agree_on():
    estimates, information = np.r_[np.ones(9), 4.0, -2.0], np.r_[np.full(9, 1e6), 1e3, 1e3]
    found = said(estimates, information)
    assert found.spread < 0.02 and found.t > 100.0


def test_at_least_eight_blocks_have_a_say():
    information = np.r_[np.full(2, 1e6), np.full(10, 1e3)]
    weights = capped(information)
    assert weights.sum() ** 2 / (weights**2).sum() == pytest.approx(8.0, rel=1e-6)
    assert (weights <= information).all()
    lone = said(np.r_[1.0, 1.0, np.tile([5.0, -3.0], 5)], information)
    assert lone.t < 2.0  # the two that know nearly all do not speak for the others


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
    assert found.spread < 0.2 and found.same_sign == found.n >= len(fit.S) - 2
    assert found.estimate.mean() == pytest.approx(1.0, abs=0.1)
    mine = of_effect(fit, "slope")
    assert mine.t == found.t


def test_blocks_do_not_agree_on_what_is_not():
    case = make(51, ["slope"], SHORT)
    more = case.truth.with_effects([effect("yaw_quadratic_drag", 0.0), effect("body_side_force", 0.0)])
    fit = base_fit(more, gather(more, case.logs))
    for name in ("yaw_quadratic_drag", "body_side_force"):
        assert of_effect(fit, name).p_value > 1e-3


def test_what_no_number_scales_is_judged_by_its_gain():
    case = make(52, ["thrust_saturation"], SHORT)
    data = gather(case.model, case.logs)
    less, fit = base_fit(case.model, data), base_fit(case.truth, data)
    with pytest.raises(KeyError):
        of_effect(fit, "thrust_saturation")
    found = agreement(fit, less, "thrust_saturation")
    gain = less.block_costs - fit.block_costs
    root = np.sign(gain) * np.sqrt(np.abs(gain))
    assert found.t == pytest.approx(root.mean() / (root.std(ddof=1) / np.sqrt(gain.size)))
    assert found.estimate.mean() == pytest.approx(1.0) and found.spread == 0.0


def test_a_jump_of_drags_that_differ_from_block_to_block_is_uneven():
    case = make(53, ["parameter_jump"], replace(SHORT, duration=40.0))
    fit = base_fit(case.truth, gather(case.truth, case.logs))
    assert of_effect(fit, "parameter_jump").spread < 0.1
    drags = np.array([name.endswith(("drag", "coulomb")) for name in fit.problem.names])
    sign = np.where(np.arange(len(fit.S)) % 2, 1.0, -1.0)
    rough = 0.2 * sign[:, None] * (fit.S @ np.where(drags, fit.p, 0.0))  # as if each block had its own
    assert of_effect(replace(fit, g=fit.g + rough), "parameter_jump").spread > 1 / 3
