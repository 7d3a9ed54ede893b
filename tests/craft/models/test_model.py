"""The composed plant against the papers' equations, each written by hand as one function."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.blocks.units import UnitError, dimension
from hovercontrol.craft.effects import effect, effect_names
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.craft.models.motion import RUDDER, THRUST
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, four_fan, hoverdemon

POINTS = 200
C17 = (
    "surge_coulomb",
    "surge_linear_drag",
    "sway_coulomb",
    "sway_linear_drag",
    "yaw_coulomb",
    "yaw_linear_drag",
    "thrust",
    "rudder_torque",
)


def c17_plant(state, command, c, width=0.01):
    """C17 (8), (11), with sgn regularised."""
    _x, _y, psi, u, v, r = state
    T, theta = command
    c1, c2, c3, c4, c5, c6, c7, c8 = c
    sgn_u, sgn_v, sgn_r = np.tanh(u / width), np.tanh(v / width), np.tanh(r / width)
    return np.array(
        [
            u * np.cos(psi) - v * np.sin(psi),
            u * np.sin(psi) + v * np.cos(psi),
            r,
            -c1 * sgn_u - c2 * u + c7 * T * np.cos(theta) + v * r,
            -c3 * sgn_v - c4 * v + c7 * T * np.sin(theta) - u * r,
            -c5 * sgn_r - c6 * r - c8 * T * np.sin(theta),
        ]
    )


def k06_momenta(momenta, command, m, J, d):
    """K06 (2.9): P_X, P_Y, Pi; the thrust command is the propeller's force."""
    P_X, P_Y, Pi = momenta
    force, theta = command
    F_X, F_Y = force * np.cos(theta), force * np.sin(theta)
    return np.array([P_Y * Pi / J + F_X, -P_X * Pi / J + F_Y, -d * F_Y])


def four_fans(velocities, forces, m, J, arm, drag):
    """Newton and Euler for two fans pushing forward, two backward, at +-arm from the centre line."""
    u, v, r = velocities
    rear_left, rear_right, front_left, front_right = forces
    push = rear_left + rear_right - front_left - front_right
    torque = arm * (rear_left - rear_right - front_left + front_right)
    return np.array([push / m - drag * u + v * r, -drag * v - u * r, torque / J - drag * r])


def relative(found, expected):
    """Largest error of any component against the size of the whole vector."""
    return np.max(np.abs(found - expected) / np.maximum(np.max(np.abs(expected), axis=0), 1e-3))


def random_motion(rng, n=POINTS):
    return np.vstack([rng.uniform(-5, 5, (2, n)), rng.uniform(-7, 7, (1, n)), rng.normal(0, 1.0, (3, n))])


def test_the_c17_plant_is_equation_11_for_every_state_command_and_coefficient(rng):
    f = c17_simulation().plant().to_numpy()
    x = random_motion(rng)
    u = np.array([rng.uniform(0, 6, POINTS), rng.uniform(-3, 3, POINTS)])
    c = rng.uniform(0, 8, (8, POINTS))
    for k in range(POINTS):
        params = {f"plant.{name}": value for name, value in zip(C17, c[:, k], strict=True)}
        assert (
            relative(f.derivatives(0.0, x[:, k], u[:, k], params), c17_plant(x[:, k], u[:, k], c[:, k]))
            < 1e-12
        )


def test_the_vectorised_plant_is_equation_11_too(rng):
    model = c17_simulation()
    c = [model.coefficients()[name] for name in C17]
    x, u = random_motion(rng), rng.uniform(-1, 6, (2, POINTS))
    assert relative(model.plant().to_numpy().derivatives(0.0, x, u), c17_plant(x, u, c)) < 1e-12


@pytest.mark.parametrize("width", [1e-3, 0.1])
def test_the_width_of_friction_is_a_parameter(rng, width):
    model = c17_simulation()
    widths = {f"plant.{axis}_coulomb_width": width for axis in ("surge", "sway", "yaw")}
    c = [model.coefficients()[name] for name in C17]
    x, u = random_motion(rng) * 0.05, rng.uniform(-1, 6, (2, POINTS))
    assert (
        relative(model.plant().to_numpy().derivatives(0.0, x, u, widths), c17_plant(x, u, c, width)) < 1e-12
    )


def test_hoverdemon_is_k06_in_momenta(rng):
    m, J, d = 2.6, 0.096, 0.32
    x, u = random_motion(rng), rng.uniform(-2, 2, (2, POINTS))
    momenta = np.array([m * x[3], m * x[4], J * x[5]])
    found = hoverdemon().plant().to_numpy().derivatives(0.0, x, u)[3:] * np.array([[m], [m], [J]])
    assert relative(found, k06_momenta(momenta, u, m, J, d)) < 1e-12


def test_a_c17_craft_without_drag_is_k06s(rng):
    m, J, d = 2.6, 0.096, 0.32
    no_drag = dict.fromkeys(C17[:6], 0.0)
    craft = c17_simulation().with_coefficients({**no_drag, "thrust": 1 / m, "rudder_torque": d / J})
    x, u = random_motion(rng), rng.uniform(-2, 2, (2, POINTS))
    ours = craft.plant().to_numpy().derivatives(0.0, x, u)
    assert relative(ours, hoverdemon().plant().to_numpy().derivatives(0.0, x, u)) < 1e-12


def test_the_four_fan_craft_pushes_and_turns_as_its_fans_stand(rng):
    x, fans = random_motion(rng), rng.uniform(0, 0.3, (4, POINTS))
    axes = ("surge", "sway", "yaw")
    craft = four_fan().with_coefficients({f"{a}_linear_drag": 0.2 for a in axes} | {"fan_torque": 5000.0})
    found = craft.plant().to_numpy().derivatives(0.0, x, fans)[3:]
    assert relative(found, four_fans(x[3:], fans, 0.1763, 2.0e-4, 0.0425, 0.2)) < 1e-12


@example(0.0, 0.0, 2.0**-10)  # its cosine is 5e-7 below 1
@example(0.3, 0.2, 1.570796)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-4, 4))
def test_a_fan_pushes_along_its_direction_and_turns_by_the_cross_product(x, y, direction):
    craft = Model(
        "one",
        [effect("fan_force", 2.0), effect("fan_torque", 3.0)],
        fans=[Fan("f", x, y, direction)],
    )
    u, v, r = craft.plant().to_numpy().derivatives(0.0, np.zeros(6), [0.5])[3:]
    fx, fy = 0.5 * math.cos(direction), 0.5 * math.sin(direction)
    axis = round(direction / (math.pi / 2)) * math.pi / 2  # a file gives six digits
    along = axis if abs(direction - axis) < 1e-6 else direction
    assert (u, v) == pytest.approx((math.cos(along), math.sin(along)), abs=1e-11)
    assert r == pytest.approx(3 * (x * fy - y * fx), abs=1e-12)


@pytest.mark.parametrize("craft", [c17_simulation, c17_experiment, hoverdemon, four_fan])
def test_effects_one_at_a_time_sum_to_all_of_them(craft, rng):
    model = craft()
    whole = model.plant()
    x, commands = random_motion(rng), rng.uniform(-1, 1, (len(whole.inputs), POINTS))
    bare = Model("bare").plant().to_numpy().derivatives(0.0, x)
    total = bare.copy()
    for one in model.effects:
        plant = Model("one", [one], model.thrust, model.rudder, model.fans).plant()
        used = [[s.name for s in whole.inputs].index(s.name) for s in plant.inputs]
        total += plant.to_numpy().derivatives(0.0, x, commands[used]) - bare
    assert relative(whole.to_numpy().derivatives(0.0, x, commands), total) < 1e-12


def test_a_craft_without_effects_glides_on_in_a_straight_line_while_it_turns():
    plant = Model("puck").plant()
    assert plant.inputs == ()
    end = simulate(plant, [0, 3.0], x0={"u": 0.4, "v": -0.3, "r": 2.0}, rtol=1e-10, atol=1e-12).states[:, -1]
    assert end[:3] == pytest.approx([1.2, -0.9, 6.0], abs=1e-8)


def test_which_inputs_a_plant_has_follows_from_its_effects():
    def names(m):
        return [s.name for s in m.plant().inputs]

    assert names(Model("puck", [effect("surge_coulomb", 1.0)])) == []
    assert names(hoverdemon()) == ["thrust", "rudder"]
    assert names(four_fan()) == ["rear_left", "rear_right", "front_left", "front_right"]


nonnegative = st.floats(0, 10, allow_subnormal=False)


@given(
    st.lists(nonnegative, min_size=6, max_size=6),
    st.lists(st.floats(-5, 5), min_size=3, max_size=3),
    st.floats(0.01, 100),
    st.floats(0.001, 10),
)
def test_kinetic_energy_never_grows_without_input(c, velocity, m, J):
    craft = c17_simulation().with_coefficients(dict(zip(C17[:6], c, strict=True)))
    du, dv, dr = craft.plant().to_numpy().derivatives(0.0, [0, 0, 0.3, *velocity], [0.0, 0.0])[3:]
    u, v, r = velocity
    power = m * (u * du + v * dv) + J * r * dr
    assert power <= 1e-9 * (m + J) * (1 + sum(abs(w) for w in velocity)) ** 3


def test_kinetic_energy_only_falls_while_a_craft_coasts():
    response = simulate(
        c17_simulation().plant(),
        np.linspace(0, 2, 200),
        x0={"u": 1.0, "v": -0.5, "r": 4.0},
        rtol=1e-8,
        atol=1e-10,
    )
    u, v, r = response.states[3:]
    energy = (0.585 * (u**2 + v**2) + 0.01 * r**2) / 2
    assert (np.diff(energy) <= 1e-9).all()
    assert energy[-1] < 0.2 * energy[0]


def test_a_craft_moves_the_same_wherever_it_is_and_wherever_it_heads(rng):
    f = c17_simulation().plant().to_numpy()
    x, u = random_motion(rng), rng.uniform(-1, 6, (2, POINTS))
    elsewhere = x + np.array([[3.0], [-2.0], [1.1], [0], [0], [0]])
    here, there = f.derivatives(0.0, x, u), f.derivatives(0.0, elsewhere, u)
    assert np.array_equal(here[3:], there[3:])
    c, s = np.cos(1.1), np.sin(1.1)
    assert np.allclose(np.array([[c, -s], [s, c]]) @ here[:2], there[:2], atol=1e-13)


def test_a_mirrored_craft_makes_the_mirrored_motion(rng):
    f = c17_simulation().plant().to_numpy()
    x, u = random_motion(rng), rng.uniform(-1, 6, (2, POINTS))
    flip = np.array([[1], [-1], [-1], [1], [-1], [-1]])
    mirrored = f.derivatives(0.0, flip * x, np.array([[1], [-1]]) * u)
    assert np.allclose(mirrored, flip * f.derivatives(0.0, x, u), atol=1e-13)


# ---- what a model refuses ------------------------------------------------------------------------


def test_an_effect_stands_once():
    with pytest.raises(InputError, match="'thrust' is listed twice"):
        Model("puck", [effect("thrust", 1.0), effect("thrust", 2.0)])


@pytest.mark.parametrize("name", ["fan_force", "fan_torque"])
def test_fan_effects_need_fans(name):
    with pytest.raises(InputError, match="needs fans"):
        Model("puck", [effect(name, 1.0)])


@pytest.mark.parametrize("taken", ["left", "thrust", "x", "r"])
def test_a_fan_has_a_name_of_its_own(taken):
    with pytest.raises(InputError, match=f"'{taken}' is taken"):
        Model("puck", fans=[Fan("left", 0, 0, 0), Fan(taken, 0, 0, 0)])


def test_the_rudder_is_an_angle():
    with pytest.raises(InputError, match="rudder"):
        Model("puck", rudder=RUDDER.replace(unit="m"))


def test_a_missing_effect_and_a_misspelt_coefficient_are_answered_with_the_nearest():
    craft = c17_simulation()
    with pytest.raises(InputError, match="did you mean 'yaw_coulomb'"):
        craft.effect("yaw_colomb")
    with pytest.raises(InputError, match="did you mean 'surge_coulomb_width'"):
        craft.with_coefficients({"surge_coulomb_widht": 0.1})
    with pytest.raises(InputError, match="out of its bounds"):
        craft.with_coefficients({"yaw_coulomb": -0.1})


def test_the_units_of_an_effect_are_checked_against_the_equation_it_acts_in():
    from hovercontrol.craft.effects import Coefficient, Effect

    class Wrong(Effect):  # no name: it stays out of the list of known effects
        value = Coefficient("m/s")

        def terms(self, c: SimpleNamespace, s: SimpleNamespace):
            return {"r": c.value * s.r}

    Wrong.name = "wrong"
    with pytest.raises(
        UnitError, match=r"block 'plant': r' must be in 1/s\^2, but 'plant.wrong\*r' is in m/s\^2"
    ):
        Model("puck", [Wrong(1.0)]).plant()


def test_thrust_in_newton_changes_the_unit_of_its_coefficients():
    units = {p.name: p.unit for p in hoverdemon().plant().parameters}
    assert dimension(units["plant.thrust"]) == dimension("1/kg")
    compound = Model("puck", [effect("thrust", 1.0)], thrust=THRUST.replace(unit="kg*m/s^2"))
    assert compound.plant().parameters[0].dimension == dimension("1/kg")


# ---- changing a model ----------------------------------------------------------------------------


def test_replacing_an_effect_keeps_its_place_and_adding_one_appends_it():
    craft = c17_simulation()
    same_place = craft.with_effects([effect("yaw_coulomb", 0.1)])
    assert [e.name for e in same_place.effects] == [e.name for e in craft.effects]
    assert same_place.effect("yaw_coulomb").values["value"] == 0.1
    longer = Model("puck", [effect("thrust", 1.0)]).with_effects([effect("yaw_coulomb", 0.1)])
    assert [e.name for e in longer.effects] == ["thrust", "yaw_coulomb"]


def test_coefficients_are_what_an_estimator_may_estimate_and_widths_are_not():
    craft = c17_simulation()
    assert craft.linear_coefficients() == C17
    assert set(craft.coefficients()) - set(C17) == {f"{a}_coulomb_width" for a in ("surge", "sway", "yaw")}


def test_a_plant_under_another_name_has_other_parameter_keys_and_the_same_dynamics(rng):
    ours, other = c17_simulation().plant(), c17_simulation().plant("rival")
    assert "rival.yaw_coulomb" in other.default_parameters
    x, u = random_motion(rng), rng.uniform(-1, 6, (2, POINTS))
    assert np.array_equal(ours.to_numpy().derivatives(0, x, u), other.to_numpy().derivatives(0, x, u))
    assert ours.named("rival") == other


def test_every_known_effect_makes_a_plant():
    fans = [Fan("left", 0.0, -0.1, 0.0)]
    for name in effect_names():
        from hovercontrol.craft.effects import effect_class

        numbers = {
            key: n.default if n.default is not None else min(max(0.5, n.lower), n.upper)
            for key, n in effect_class(name).numbers.items()
        }
        plant = Model("one", [effect(name, **numbers)], fans=fans).plant(late=True)
        assert len(plant.states) >= 6, name
