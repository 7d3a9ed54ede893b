"""Laws that act in one regime: each curve and table by its closed form, and in a model file."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects.law import law_class
from hovercontrol.craft.models.modelfile import load_model, save_model

UNITS = {"u": "m/s", "r": "rad/s", "rudder": "rad"}
A = np.linspace(-3.0, 3.0, 41)


def term(name, **numbers):
    """Return what a law adds, over A of its signal."""
    e = law_class(name, UNITS)(**numbers)
    symbols = {n: sp.Symbol(n, real=True) for n in UNITS}
    values = {s: e.values[k] for k, s in vars(e.symbols("plant")).items()}
    (found,) = e.terms(e.symbols("plant"), type("S", (), symbols)).values()
    return sp.lambdify(list(symbols.values()), found.xreplace(values), "numpy")(A, A, A)


@pytest.mark.parametrize(
    ("name", "numbers", "wanted"),
    [
        ("law_r__over_r", {"at": 0.7}, np.where(A > 0.7, A - 0.7, 0.0)),
        ("law_r__under_r", {"at": -0.7}, np.where(A < -0.7, A + 0.7, 0.0)),
        ("law_r__beyond_r", {"at": 0.7}, np.sign(A) * np.clip(np.abs(A) - 0.7, 0.0, None)),
        ("law_r__saturating_r", {"at": 0.7}, A / (0.7 + np.abs(A))),
        ("law_r__decaying_r", {"at": 0.7}, np.exp(-np.abs(A) / 0.7)),
        ("law_r__logistic_r", {"at": 0.7, "wide": 0.2}, 1.0 / (1.0 + np.exp((0.7 - A) / 0.2))),
        ("law_r__bell_r", {"at": -0.7, "wide": 0.4}, np.exp(-(((A + 0.7) / 0.4) ** 2))),
    ],
)
def test_a_curve_is_its_closed_form(name, numbers, wanted):
    assert term(name, value=-2.0, **numbers) == pytest.approx(-2.0 * wanted)


Y = {"y1": 0.1, "y2": 0.5, "y3": -0.2, "y4": 0.3, "y5": 0.4}


@pytest.mark.parametrize(
    ("name", "at", "values"),
    [
        ("law_u__hump_u", np.linspace(-1.0, 2.0, 7), [0.0, *Y.values(), 0.0]),
        ("law_u__rise_u", np.linspace(-1.0, 2.0, 6), [0.0, *Y.values()]),
        ("law_u__fall_u", np.linspace(-1.0, 2.0, 6), [*Y.values(), 0.0]),
    ],
)
def test_a_table_is_numpys_interpolation(name, at, values):
    assert term(name, low=-1.0, high=2.0, **Y) == pytest.approx(np.interp(A, at, values))


@pytest.mark.parametrize(
    ("name", "numbers", "values"),
    [
        ("law_r__above_r", {"low": 0.4, "high": 0.5}, [0.0, 1.0]),
        ("law_r__below_r", {"low": 0.4, "high": 0.5}, [1.0, 0.0]),
        ("law_r__between_r", {"low": -1.0, "rises": -0.9, "falls": 1.4, "high": 1.7}, [0.0, 1.0, 1.0, 0.0]),
    ],
)
def test_a_range_is_numpys_interpolation(name, numbers, values):
    wanted = np.interp(A, list(numbers.values()), values)
    assert term(name, value=-2.0, **numbers) == pytest.approx(-2.0 * wanted)


def test_a_model_file_holds_a_function_of_a_size(tmp_path):
    craft = hc.vehicle("c17_simulation")
    law = craft.effect_class("law_r__r__rise_abs_r")(low=0.2, high=1.0, **Y)
    save_model(craft.with_effects([law]), tmp_path / "model.toml")
    plant = load_model(tmp_path / "model.toml").plant()
    x, u = np.array([0.0, 0.0, 0.0, 0.5, 0.1, 0.6]), [2.0, 0.1]
    added = 0.6 * np.interp(0.6, np.linspace(0.2, 1.0, 6), [0.0, *Y.values()])
    ours, given = (block.to_numpy().derivatives(0.0, x, u) for block in (plant, craft.plant()))
    assert ours[5] - given[5] == pytest.approx(added)


def test_two_curves_in_one_law_are_refused():
    with pytest.raises(InputError, match="two factors with numbers of their own"):
        law_class("law_r__over_r__hump_u", UNITS)
