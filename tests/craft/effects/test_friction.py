"""Friction in proportion to the thrust, and LuGre friction, against their equations."""

import math

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.effects import effect, effect_class
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation

AXES = {"surge": ("u", 3), "sway": ("v", 4), "yaw": ("r", 5)}
NUMBERS = {"stiffness": 400.0, "damping": 8.0, "coulomb": 0.5, "static": 0.8, "speed": 0.05}


@pytest.mark.parametrize("thrust", [-2.0, 1.3])
def test_friction_of_the_load_is_against_the_planar_velocity_and_grows_with_thrust(thrust):
    state, commands = [0, 0, 0.4, 0.3, -0.4, 1.0], [thrust, 0.2]
    with_it = c17_simulation().with_effects([effect("load_friction", 0.2, width=1e-6)]).plant()
    added = with_it.to_numpy().derivatives(
        0.0, state, commands
    ) - c17_simulation().plant().to_numpy().derivatives(0.0, state, commands)
    expected = [0, 0, 0, -0.2 * abs(thrust) * 0.6, 0.2 * abs(thrust) * 0.8, 0]
    np.testing.assert_allclose(added, expected, atol=1e-9)


def test_friction_of_the_load_sees_the_thrust_behind_its_lag():
    model = c17_simulation().with_effects([effect("load_friction", 0.2), effect("thrust_lag", seconds=0.1)])
    still = model.plant().to_numpy().derivatives(0.0, [0, 0, 0, 1.0, 0, 0, 0.0], [2.0, 0.0])
    free = model.with_coefficients({"load_friction": 0.0}).plant()
    np.testing.assert_allclose(still, free.to_numpy().derivatives(0.0, [0, 0, 0, 1.0, 0, 0, 0.0], [2.0, 0.0]))


@pytest.mark.parametrize("axis", AXES)
def test_lugre_is_the_papers_equations(axis, rng):
    name, i = AXES[axis]
    plant = Model("one", [effect(f"lugre_{axis}", **NUMBERS)]).plant()
    assert plant.states[6].name == f"lugre_{name}"
    sigma0, sigma1, Fc, Fs, vs = NUMBERS.values()
    bare = Model("none").plant().to_numpy()
    for _ in range(50):
        x = rng.normal(size=6)
        z = 1e-3 * rng.normal()
        v = x[i] = 0.1 * rng.normal()
        g = Fc + (Fs - Fc) * math.exp(-((v / vs) ** 2))
        dz = v - sigma0 * abs(v) * z / g
        expected = np.append(bare.derivatives(0.0, x), dz)
        expected[i] -= sigma0 * z + sigma1 * dz
        np.testing.assert_allclose(plant.to_numpy().derivatives(0.0, [*x, z]), expected, atol=1e-12)


@pytest.mark.parametrize("axis", AXES)
def test_lugre_without_bristles_is_no_friction(axis):
    numbers = NUMBERS | {"stiffness": 0.0, "damping": 0.0}
    plant = Model("one", [effect(f"lugre_{axis}", **numbers)]).plant()
    x = [0.1, 0.2, 0.3, 0.4, -0.5, 0.6]
    found = plant.to_numpy().derivatives(0.0, [*x, 0.01])
    np.testing.assert_array_equal(found[:6], Model("none").plant().to_numpy().derivatives(0.0, x))


def test_while_it_slides_lugre_is_coulomb_friction():
    plant = Model("one", [effect("lugre_surge", **NUMBERS)]).plant()
    response = simulate(plant, np.linspace(0, 1, 101), x0={"u": 2.0}, rtol=1e-8)
    slope = np.diff(response.states[3]) / 0.01
    np.testing.assert_allclose(slope[10:], -0.5, rtol=1e-3)


@pytest.mark.parametrize(("push", "slides"), [(0.7, False), (0.9, True)])
def test_a_craft_sticks_until_the_static_level_is_passed(push, slides):
    ramp = Model("one", [effect("lugre_surge", **NUMBERS), effect("thrust", 1.0)]).plant()
    t = np.linspace(0, 4, 401)
    force = push * np.minimum(1.0, t / 3)
    given = np.stack([force, 0 * t])[: len(ramp.inputs)]
    moved = simulate(ramp, t, inputs=given, rtol=1e-7).states[3, -1]
    assert bool(moved > 0.05) is slides


def test_bristles_follow_no_faster_than_they_are_allowed_to(rng):
    """Who steps them coarsely says how fast: slower motion is as it was, and where they end stays."""
    model = Model("one", [effect("lugre_surge", **NUMBERS)])
    exact, limited = model.plant().to_numpy(), model.plant(fastest=1000.0).to_numpy()
    for _ in range(50):
        x, z = [*rng.normal(size=3), 0.02 * rng.normal(), *rng.normal(size=2)], 1e-3 * rng.normal()
        near = exact.derivatives(0.0, [*x, z])
        np.testing.assert_allclose(limited.derivatives(0.0, [*x, z]), near, rtol=1e-4, atol=1e-6)
    fast = [0, 0, 0, 50.0, 0, 0]
    ends = NUMBERS["coulomb"] / NUMBERS["stiffness"]
    assert limited.derivatives(0.0, [*fast, ends])[-1] == pytest.approx(0.0, abs=1e-9)
    off = 1e-4
    rate = -limited.derivatives(0.0, [*fast, ends + off])[-1] / off
    assert rate == pytest.approx(1000.0, rel=1e-3)
    assert "plant.fastest" not in model.plant().default_parameters
    with pytest.raises(InputError, match="fastest: expected a positive rate in 1/s, found 0"):
        model.plant(fastest=0.0)


def test_states_of_an_effect_may_follow_from_the_motion():
    signal = effect("lugre_yaw", **NUMBERS).bristles()
    assert signal == Signal("lugre_r", "rad", "bristles of friction against r")
    assert effect_class("lugre_yaw").axis == "r"
    assert effect_class("lugre_yaw").kind() == "force"
