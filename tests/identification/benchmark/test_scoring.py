"""Answers made by hand, and how they count."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.identification.benchmark import Answer, Term, benchmark_case, score_answer

LAW = "ship.law_r_abs_v_r.usual.0"  # r' lacks - c abs(v) r


def scored(name, verdict, *terms):
    return score_answer(benchmark_case(name), Answer(verdict, terms))


def test_a_law_is_right_up_to_its_coefficient_however_it_is_written():
    for text in ("Abs(v)*r", "-2*r*sqrt(v**2)", "r*Max(v, -v)"):
        assert scored(LAW, "missing", Term("r", text)).form, text


@pytest.mark.parametrize("text", ["v*r", "Abs(r)*r", "Abs(v)*r + 0.1*r", "Abs(v)*v"])
def test_another_form_is_a_false_name(text):
    score = scored(LAW, "missing", Term("r", text))
    assert (score.form, score.equation, score.false_names) == (False, True, 1)


def test_the_right_form_in_the_wrong_equation_is_false():
    score = scored(LAW, "missing", Term("v", "Abs(v)*r"))
    assert (score.form, score.equation, score.false_names) == (False, False, 1)


def test_a_coefficient_is_judged_by_two_of_its_errors_in_the_sign_of_its_form():
    c = benchmark_case(LAW).truth.coefficient
    assert scored(LAW, "missing", Term("r", "Abs(v)*r", -c - 0.019, 0.01)).coefficient
    assert scored(LAW, "missing", Term("r", "-2*Abs(v)*r", c / 2, 1e-6)).coefficient
    assert scored(LAW, "missing", Term("r", "Abs(v)*r", -c - 0.021, 0.01)).coefficient is False
    assert scored(LAW, "missing", Term("r", "Abs(v)*r", c, 0.01)).coefficient is False  # the other sign
    assert scored(LAW, "missing", Term("r", "Abs(v)*r", -c)).coefficient is None


def test_an_effect_is_right_by_name_and_by_its_expression():
    name = "ship.r_quadratic_drag.usual.0"
    c = benchmark_case(name).truth.coefficient
    assert scored(name, "missing", Term("", "r_quadratic_drag", c, 0.01)).coefficient
    by_form = scored(name, "missing", Term("r", "Abs(r)*r", -c, 0.01))
    assert by_form.form and by_form.equation and by_form.coefficient
    assert not scored(name, "missing", Term("", "r_linear_drag")).form


def test_a_slope_is_right_by_name_or_by_both_of_its_equations():
    name = "fans.fan_lag.usual.0"  # a lag has no expression of states and inputs
    assert scored(name, "missing", Term("", "fan_lag")).form
    assert not scored(name, "missing", Term("r", "r")).form


def test_unsure_terms_are_readings_and_neither_names_nor_false():
    score = scored(LAW, "missing", Term("r", "Abs(v)*r", sure=False), Term("r", "v*r", sure=False))
    assert (score.form, score.reading, score.false_names, score.detected) == (False, True, 0, True)


def test_verdicts():
    assert scored("ship.nothing.usual.0", "none").detected
    assert scored("ship.nothing.usual.0", "missing", Term("r", "r**3")).false_names == 1
    assert not scored("ship.nothing.usual.0", "unknown").detected
    assert not scored(LAW, "none").detected
    with pytest.raises(InputError, match="expected the verdict none, missing or unknown, found 'maybe'"):
        Answer("maybe")
    with pytest.raises(InputError, match="expected an expression of psi, v, r, rudder, found 'w'"):
        scored(LAW, "missing", Term("r", "w"))


def test_the_true_model_predicts_what_the_given_one_does_not():
    case = benchmark_case("motor.speed_offset.usual.0")
    truth = case.model.with_effects([case.model.effect_class("speed_offset")(case.truth.coefficient)])
    better = score_answer(case, Answer("missing", (), truth)).reduction
    same = score_answer(case, Answer("missing", (), case.model)).reduction
    assert same == pytest.approx({"0.2": 0.0, "1": 0.0}, abs=1e-12)
    assert 0.0 < better["1"] < 1.0 and np.isfinite(better["0.2"])
