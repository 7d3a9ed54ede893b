"""What candidates score: their columns are a fit's own, near standstill, too."""

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.candidates import CANDIDATES, Candidate, candidates
from hovercontrol.identification.diagnose.search.columns import Along, columns
from hovercontrol.identification.diagnose.search.score import Scores, likeliest_onset
from hovercontrol.identification.engine.data import gather

from .generator import Conditions, make

SHORT = Conditions(duration=20.0, logs=1)


def fitted(case):
    return base_fit(case.model, gather(case.model, case.logs))


@pytest.fixture(scope="module")
def sticking():
    """A craft that dry friction holds in one row of two."""
    return fitted(make(61, ["surge_stribeck"], SHORT))


@pytest.mark.parametrize("drag", ["surge_coulomb", "sway_coulomb", "yaw_coulomb", "surge_linear_drag"])
def test_a_column_is_the_fits_own(sticking, drag):
    problem, own = sticking.problem, sticking.model.effect(drag)
    j = problem.names.index(drag)
    more = 0.01
    changed = type(own)(**{**own.values, "value": own.values["value"] + more})
    ((drive, _),), _ = columns(sticking, [Candidate(drag, changed, ())])
    fits = sticking.linear.B[..., j] / problem.slope(sticking.p)[j]
    error = drive[..., 0] / more - fits
    stuck = np.abs(np.diagonal(sticking.linear.A, axis1=-2, axis2=-1)).min(axis=-1) < 0.5
    assert stuck.sum() > 300
    for rows in (stuck, ~stuck):
        assert np.sqrt(np.mean(error[rows] ** 2)) < 0.02 * np.sqrt(np.mean(fits[rows] ** 2))


def test_what_a_candidate_adds_is_the_difference_of_two_models(sticking, monkeypatch):
    """It is computed without what is in both of them, unless commands arrive otherwise."""
    tried = candidates(sticking)
    (short, _), _ = columns(sticking, tried)[0]
    monkeypatch.setattr(Along, "_difference", lambda self, model, values: None)
    (whole, _), _ = columns(sticking, tried)[0]
    scale = np.abs(whole).max(axis=(0, 1, 2))
    np.testing.assert_allclose(
        short / np.maximum(scale, 1e-300), whole / np.maximum(scale, 1e-300), atol=1e-9
    )
    assert (scale > 0).sum() > 30


def test_a_linear_effect_scores_the_same_at_any_trial(sticking):
    names = ["slope", "surge_quadratic_drag"]
    for s in Scores(sticking, candidates(sticking, names)).best():
        trial, amplitudes = s.candidate.trial, s.candidate.amplitudes
        larger = type(trial)(**{k: 10.0 * CANDIDATES.trial for k in amplitudes})
        again = Scores(sticking, [Candidate(s.candidate.name, larger, amplitudes)]).of(0)
        assert again.gain == pytest.approx(s.gain, rel=1e-4)
        assert 10.0 * again.parts == pytest.approx(s.parts, rel=1e-3)


@pytest.mark.parametrize(("seed", "name"), [(19, "input_delay"), (20, "input_delay"), (25, "time_offset")])
def test_a_delay_is_where_it_scores_best(seed, name):
    """Noise of the model without it takes up to four fifths of what it does."""
    case = make(seed, [name], SHORT)
    fit = fitted(case)
    (coarse,) = Scores(fit, candidates(fit, [name])).best()
    found = likeliest_onset(fit, coarse).effect.values["seconds"]
    assert found == pytest.approx(case.truth.effect(name).values["seconds"], rel=0.04)


def test_a_delay_promises_what_it_gains_whole():
    """Behind a lag, a push of which half is late and half is not would gain more."""
    fit = fitted(make(18, ["thrust_lag"], SHORT))
    (delay,) = Scores(fit, candidates(fit, ["input_delay"])).best()
    found = likeliest_onset(fit, delay)
    whole = Scores(fit, [found.candidate]).of(0)
    part = whole.parts[0]
    assert 0.5 < part < 0.9
    assert found.gain == pytest.approx(whole.gain * (2.0 * part - 1.0) / part**2)


@pytest.mark.slow
def test_a_jump_is_where_it_scores_best():
    case = make(18, ["parameter_jump"])
    fit = fitted(case)
    (coarse,) = Scores(fit, candidates(fit, ["parameter_jump"])).best()
    fine = likeliest_onset(fit, coarse)
    truth = case.truth.effect("parameter_jump").values["seconds"]
    assert fine.gain > coarse.gain
    assert fine.effect.values["seconds"] == pytest.approx(truth, abs=0.1)


def test_a_linear_answer_is_believed_only_nearby():
    lag = Candidate("thrust_lag", effect("thrust_lag", 0.1), ("seconds",))
    assert lag.at([0.5]).values["seconds"] == pytest.approx(0.05)
    assert lag.at([9.0]).values["seconds"] == pytest.approx(0.1 * CANDIDATES.believed[1])
    assert lag.at([-9.0]).values["seconds"] == pytest.approx(0.1 * CANDIDATES.believed[0])
    jump = Candidate("parameter_jump", effect("parameter_jump", factor=1.1, seconds=5.0), ("factor",))
    assert jump.at([-4.0]).values == pytest.approx({"factor": 0.6, "seconds": 5.0})  # to either side of one
