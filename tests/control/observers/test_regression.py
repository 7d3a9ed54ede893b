"""x' = h + G c: derived, never written; refused where it does not hold."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers import regression
from hovercontrol.craft.models.vehicles import VEHICLES, c17_simulation, four_fan, vehicle

V, K, W = (
    Signal("v", "m/s"),
    Signal("k", "m/s^2", start=1.0),
    Signal("w", "m/s", start=0.1, lower=1e-6),
)


@pytest.mark.parametrize("name", [n for n in VEHICLES if n != "four_fan"])
def test_by_default_all_coefficients_are_chosen_and_no_shape(name):
    assert regression(vehicle(name).plant()).names == vehicle(name).linear_coefficients()


def test_h_plus_g_c_is_the_derivative(rng):
    plant = c17_simulation().plant()
    for chosen in (None, ["thrust"], ["yaw_coulomb", "surge_linear_drag"]):
        r = regression(plant, chosen)
        whole = sp.Matrix(r.h) + r.G * sp.Matrix([c.symbol for c in r.coefficients])
        for state, row in zip(r.states, whole, strict=True):
            assert sp.expand(row - plant.derivatives[state.name]) == 0


def test_the_fan_crafts_regressors_are_its_fans_sums():
    r = regression(four_fan().plant(), ["fan_force"])
    assert str(r.G) == "Matrix([[-front_left - front_right + rear_left + rear_right]])"


def test_a_width_is_no_coefficient_and_the_refusal_says_where():
    with pytest.raises(InputError, match=r"not linear in 'plant.yaw_coulomb_width': in r' its factor is"):
        regression(c17_simulation().plant(), ["yaw_coulomb_width"])


def test_a_product_of_two_coefficients_is_refused_together_but_not_apart():
    a, b = Signal("a", "1/s", start=1.0), Signal("b", "1", start=1.0)
    plant = Block("plant", [V], [], [V], [a, b], {"v": -a.symbol * b.symbol * V.symbol})
    with pytest.raises(InputError, match=r"not linear in 'a': in v'.*depends on b"):
        regression(plant, ["a", "b"])
    assert regression(plant, ["b"]).names == ("b",)
    assert regression(plant).names == ("a",)


def test_a_coefficient_behind_a_definition_is_found():
    drag = sp.Symbol("drag", real=True)
    plant = Block(
        "plant",
        [V],
        [],
        [V],
        [K, W],
        {"v": -drag},
        definitions={"drag": K.symbol * V.symbol / W.symbol},
    )
    assert regression(plant, ["k"]).G[0] == -V.symbol / W.symbol


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["yaw_colomb"], "did you mean 'yaw_coulomb'"),
        (["thrust", "plant.thrust"], "given twice"),
    ],
)
def test_wrong_names_are_refused(names, message):
    with pytest.raises(InputError, match=message):
        regression(c17_simulation().plant(), names)


def test_what_acts_nowhere_cannot_be_estimated():
    idle = Signal("idle", "1", start=1.0)
    with pytest.raises(InputError, match="acts in no derivative"):
        regression(Block("b", [V], [], [V], [K, idle], {"v": K.symbol}), ["idle"])
    with pytest.raises(InputError, match="linear in none"):
        regression(Block("b", [V], [], [V], [], {"v": sp.S.Zero}))


def test_the_default_choice_leaves_every_craft_with_a_sound_regression(rng):
    for name in VEHICLES:
        r = regression(vehicle(name).plant())
        assert r.G.shape == (len(r.states), len(r.names))
        assert not r.G.free_symbols & {c.symbol for c in r.coefficients}
        assert np.isfinite(len(r.h))
