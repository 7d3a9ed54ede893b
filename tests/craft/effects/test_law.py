"""Laws: names, units, terms, and the way through model files and backends."""

import math

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.effects.law import law_class
from hovercontrol.craft.effects.law_causes import cause

UNITS = {"u": "m/s", "v": "m/s", "r": "rad/s", "psi": "rad", "rudder": "rad", "time": "s"}


@pytest.mark.parametrize(
    ("name", "text", "unit"),
    [
        ("law_r__abs_v__r", "abs(v) r", "1/m"),
        ("law_v__abs_v__v", "abs(v) v", "1/m"),
        ("law_v__cub_v", "v^3", "s/m^2"),
        ("law_u__sqr_r", "r^2", "m"),
        ("law_u__sin2_psi", "sin(2 psi)", "m/s^2"),
        ("law_u__time__u", "time u", "1/s^2"),
    ],
)
def test_a_laws_name_says_its_form_and_its_unit(name, text, unit):
    cls = law_class(name, UNITS)
    assert cls.text() == text
    assert cls.numbers["value"].unit == unit


def test_the_plant_has_the_term_that_the_name_says():
    craft = hc.vehicle("c17_experiment")
    law = craft.effect_class("law_r__abs_v__r")(-0.6)
    state, command = [0.1, 0.2, 0.3, 0.4, -0.5, 0.7], [1.0, 0.1]
    before = craft.plant().to_numpy().derivatives(0.0, state, command)
    with_law = craft.with_effects([law]).plant()
    after = with_law.to_numpy().derivatives(0.0, state, command)
    assert after - before == pytest.approx([0, 0, 0, 0, 0, -0.6 * 0.5 * 0.7], abs=1e-12)
    compiled = with_law.compile().derivatives(0.0, state, command)
    assert compiled == pytest.approx(after, rel=1e-13)


def test_a_model_file_holds_a_law(tmp_path):
    craft = hc.vehicle("c17_experiment")
    amended = craft.with_effects([craft.effect_class("law_u__sin2_psi")(0.2)])
    file = hc.save_model(amended, tmp_path / "craft.toml")
    assert "law_u__sin2_psi = 0.2" in file.read_text()
    assert hc.load_model(file) == amended


def test_a_fan_craft_may_have_a_law_of_its_wrench():
    fan = hc.Fan("rear", -0.1, 0.0, 0.0)
    craft = hc.Model("puck", [hc.effect("fan_force", 1.0)], fans=[fan])
    law = craft.effect_class("law_u__fan_x__u")(-0.3)
    with_, without = (
        m.plant().to_numpy().derivatives(0.0, [0, 0, 0, 2.0, 0, 0], [0.5])
        for m in (craft.with_effects([law]), craft)
    )
    assert (with_ - without)[3] == pytest.approx(-0.3 * 0.5 * 2.0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("law_w__abs_v__r", "no equation of 'w'"),
        ("law_r__absolute_v", "unknown factor 'absolute_v'"),
        ("law_r__abs_vv", "did you mean 'abs_v'"),
        ("law_r__sin_v", "sin(v) needs an angle, and v is in m/s"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(name, said):
    with pytest.raises(hc.InputError) as caught:
        law_class(name, UNITS)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_block_takes_laws_of_its_own_signals():
    q, w, a = hc.Signal("q", "rad"), hc.Signal("w", "rad/s"), hc.Signal("a", "A")
    k = hc.Signal("k", "rad/s^2/A", start=2.0)
    model = hc.BlockModel(hc.Block("drive", [q, w], [a], [q], [k], {"q": w.symbol, "w": k.symbol * a.symbol}))
    law = model.effect_class("law_w__cos_q__w")(0.4)
    slopes = model.with_effects([law]).plant().to_numpy().derivatives(0.0, [0.3, 1.5], [0.2])
    assert slopes.tolist() == pytest.approx([1.5, 2.0 * 0.2 + 0.4 * math.cos(0.3) * 1.5])


def test_causes_are_told_for_forms_that_physics_knows():
    assert cause("r", ["r", "abs_v"]).startswith("cross-flow drag")
    assert cause("u", ["time", "thrust"], ["thrust"]).startswith("something that drifts")
    assert cause("w", ["w", "v"]) == ""


def test_laws_are_pickled():
    import pickle

    law = law_class("law_r__abs_v__r", UNITS)(-0.5)
    assert pickle.loads(pickle.dumps(law)) == law
    assert np.isfinite(law.values["value"])
