"""Dry friction is found in the equations, and only where a velocity is held by it."""

import pytest
import sympy as sp

from hovercontrol import (
    Block,
    InputError,
    Signal,
    interconnect,
    kalman_bucy,
    sgn,
    tracking_controller,
    vehicle,
)
from hovercontrol.blocks.friction import dry_frictions, with_modes
from hovercontrol.control.controllers.references import circle

v, w, F = Signal("v", "m/s"), Signal("w", "m/s", start=0.01), Signal("F", "m/s^2")
c = Signal("c", "m/s^2", start=0.3)


def test_each_axis_of_the_c17_craft_has_one():
    found = dry_frictions(vehicle("c17_experiment").plant())
    assert [(f.state, str(f.b)) for f in found] == [
        ("u", "-plant.surge_coulomb"),
        ("v", "-plant.sway_coulomb"),
        ("r", "-plant.yaw_coulomb"),
    ]
    assert not any(f.a.has(sgn) for f in found)


def test_a_craft_without_dry_friction_has_none():
    assert dry_frictions(vehicle("hoverdemon").plant()) == ()


def test_a_controller_and_an_estimator_have_none_but_their_loop_has_the_plants():
    craft = vehicle("c17_simulation")
    parts = [craft.plant(), tracking_controller(craft, adapt=["yaw_coulomb"]), kalman_bucy(craft.plant())]
    assert dry_frictions(parts[1]) == dry_frictions(parts[2]) == ()
    loop = interconnect([*parts, circle(2.0)], "loop")
    assert [f.state for f in dry_frictions(loop)] == ["plant.u", "plant.v", "plant.r"]


def test_the_moded_block_is_the_block_with_s_in_place_of_sgn():
    cart = Block("cart", (v,), (F,), (v,), (c, w), {"v": F.symbol - c.symbol * sgn(v.symbol, w.symbol)})
    (friction,) = dry_frictions(cart)
    moded = with_modes(cart, (friction,))
    assert sp.simplify(moded.derivatives["v"] - (F.symbol - c.symbol * friction.symbol)) == 0


def test_two_frictions_on_one_velocity_are_one():
    e = F.symbol - c.symbol * sgn(v.symbol, w.symbol) - 2 * c.symbol * sgn(v.symbol, 2 * w.symbol)
    (friction,) = dry_frictions(Block("cart", (v,), (F,), (v,), (c, w), {"v": e}))
    assert friction.b == -3 * c.symbol


def test_friction_that_enters_squared_is_refused():
    e = F.symbol - c.symbol * sgn(v.symbol, w.symbol) ** 2
    with pytest.raises(InputError, match=r"v' is not linear in sgn\(v\)"):
        dry_frictions(Block("cart", (v,), (F,), (v,), (c, w), {"v": e}))
