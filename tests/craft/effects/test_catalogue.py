"""Every effect against its definition, written out here by hand."""

import math

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects import effect, effect_class, effect_names
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan

MOTION = ("x", "y", "psi", "u", "v", "r")
T, TH = 1.3, -0.4  # thrust and rudder
STATE = np.array([0.3, -0.2, 0.7, 0.9, -0.5, 1.1])
X, Y, PSI, U, V, R = STATE
C = c17_simulation().coefficients()


def dots(model, t=2.0, state=STATE, thrust=T, rudder=TH):
    block = model.plant()
    u = {"thrust": thrust, "rudder": rudder}
    x = [*state, *(s.start for s in block.states[6:])]
    return block.to_numpy().derivatives(t, x, [u[s.name] for s in block.inputs])


def change(*effects, **where):
    """What the effects add to u', v', r' of the paper's craft."""
    nominal = c17_simulation()
    return (dots(nominal.with_effects(effects), **where) - dots(nominal, **where))[3:6]


def forces(thrust, rudder):
    """u', v', r' of commands alone."""
    return np.array(
        [
            C["thrust"] * thrust * math.cos(rudder),
            C["thrust"] * thrust * math.sin(rudder),
            -C["rudder_torque"] * thrust * math.sin(rudder),
        ]
    )


COS, SIN = math.cos(PSI), math.sin(PSI)
WX, WY = 0.4, -0.3
EARTH = np.array([COS * WX + SIN * WY, -SIN * WX + COS * WY, 0.0])
FORCE = {
    "surge_quadratic_drag": (0.2, [-0.2 * abs(U) * U, 0, 0]),
    "sway_quadratic_drag": (0.2, [0, -0.2 * abs(V) * V, 0]),
    "yaw_quadratic_drag": (0.2, [0, 0, -0.2 * abs(R) * R]),
    "surge_cubic_drag": (0.2, [-0.2 * U**3, 0, 0]),
    "sway_cubic_drag": (0.2, [0, -0.2 * V**3, 0]),
    "yaw_cubic_drag": (0.2, [0, 0, -0.2 * R**3]),
    "body_surge_force": (0.3, [0.3, 0, 0]),
    "body_side_force": (-0.3, [0, -0.3, 0]),
    "body_yaw_torque": (-0.3, [0, 0, -0.3]),
    "thrust_yaw_torque": (0.5, [0, 0, 0.5 * T]),
    "thrust_rudder_loss": (0.8, -0.8 * TH**2 * forces(T, TH)),
    "sway_yaw_coupling": (0.6, [0, 0, 0.6 * V]),
    "munk_moment": (0.6, [0, 0, 0.6 * U * V]),
    "added_mass_coriolis": (0.25, [0.25 * V * R, 0, 0]),
    "rudder_damping": (0.25, [0, 0, -0.25 * T * R]),
    "battery_sag": (0.05, -0.05 * 2.0 * forces(T, TH)),
    "rudder_offset": (0.1, forces(T, TH + 0.1) - forces(T, TH)),
}


@pytest.mark.parametrize("name", FORCE)
def test_one_number(name):
    value, expected = FORCE[name]
    np.testing.assert_allclose(change(effect(name, value)), expected, atol=1e-12)


def test_two_components():
    np.testing.assert_allclose(change(effect("slope", x=WX, y=WY)), EARTH, atol=1e-12)
    dragged = c17_simulation().with_coefficients({"surge_linear_drag": 0.4})  # C17's has none along x
    blown = dots(dragged.with_effects([effect("wind", x=WX, y=WY)])) - dots(dragged)
    np.testing.assert_allclose(blown[3:6], np.array([0.4, C["sway_linear_drag"], 0.0]) * EARTH, atol=1e-12)


@pytest.mark.parametrize(("axis", "i"), [("surge", 0), ("sway", 1), ("yaw", 2)])
def test_stribeck(axis, i):
    w = STATE[3 + i]
    found = change(effect(f"{axis}_stribeck", 0.7, speed=0.6, width=1e-3))
    expected = np.zeros(3)
    expected[i] = -0.7 * np.sign(w) * math.exp(-((w / 0.6) ** 2))
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("thrust", [-2.0, -0.1, 0.1, 2.0])
@pytest.mark.parametrize(
    ("e", "law"),
    [
        (effect("thrust_deadzone", 0.3), lambda T: math.copysign(max(0.0, abs(T) - 0.3), T)),
        (effect("thrust_saturation", 0.5), lambda T: math.copysign(min(abs(T), 0.5), T)),
        (effect("reverse_thrust_loss", 0.4), lambda T: T if T > 0 else 0.6 * T),
    ],
)
def test_laws_of_the_thrust_command(e, law, thrust):
    expected = forces(law(thrust), TH) - forces(thrust, TH)
    np.testing.assert_allclose(change(e, thrust=thrust), expected, atol=1e-12)


def test_effects_of_commands_act_in_their_order():
    given = [effect("thrust_saturation", 0.6), effect("thrust_deadzone", 0.3), effect("battery_sag", 0.1)]
    expected = forces(min(T - 0.3, 0.6) * (1 - 0.1 * 2.0), TH) - forces(T, TH)
    np.testing.assert_allclose(change(*given), expected, atol=1e-12)
    np.testing.assert_allclose(change(*given[::-1]), expected, atol=1e-12)


@pytest.mark.parametrize(("name", "i"), [("thrust", 0), ("rudder", 1)])
def test_a_lag_is_of_first_order_from_rest_and_forces_see_its_state(name, i):
    model = c17_simulation().with_effects([effect(f"{name}_lag", seconds=0.2)])
    block = model.plant()
    assert block.states[6].name == f"{name}_lagged" and block.states[6].start == 0.0
    x = np.append(STATE, 0.25)
    found = block.to_numpy().derivatives(0.0, x, [T, TH])
    command = [T, TH]
    assert found[6] == pytest.approx((command[i] - 0.25) / 0.2)
    command[i] = 0.25
    np.testing.assert_allclose(found[3:6], dots(c17_simulation(), thrust=command[0], rudder=command[1])[3:6])


def test_every_fan_lags():
    block = four_fan().with_effects([effect("thrust_lag", seconds=0.2)]).plant()
    assert [s.name for s in block.states[6:]] == [f"{f.name}_lagged" for f in four_fan().fans]


@pytest.mark.parametrize("t", [4.9, 5.1])
def test_all_drags_jump_at_one_time(t):
    found = change(effect("parameter_jump", factor=1.5, seconds=5.0), t=t)
    drag = dots(c17_simulation(), thrust=0.0)[3:6] - [V * R, -U * R, 0.0]
    np.testing.assert_allclose(found, 0.5 * drag if t > 5 else np.zeros(3), atol=1e-12)


def test_air_drag_is_against_the_speed_through_the_air():
    air = effect("wind", x=WX, y=WY), effect("air_drag", 0.2, width=1e-6)
    moving = np.array([U, V, 0.0]) - EARTH
    expected = -0.2 * np.hypot(*moving[:2]) * moving
    np.testing.assert_allclose(change(*air) - change(air[0]), expected, atol=1e-9)


@pytest.mark.parametrize("t", [0.0, 4.0])
def test_all_forces_fade_alike_on_a_craft_that_grows_heavier(t):
    downhill = effect("slope", x=WX, y=WY), effect("added_mass_coriolis", 0.25)
    drift = effect("mass_drift", 0.05)
    coriolis = [V * R, -U * R, 0.0]
    found = dots(c17_simulation().with_effects([drift]), t=t)[3:6] - coriolis
    of_mass = dots(c17_simulation(), t=t)[3:6] - coriolis
    np.testing.assert_allclose(found, of_mass / (1 + 0.05 * t), atol=1e-12)
    beside = change(*downhill, drift, t=t) - change(drift, t=t)
    np.testing.assert_allclose(
        beside, EARTH + np.array([0.25 * V * R, 0, 0]), atol=1e-12
    )  # whatever the mass


def test_another_mass_in_sway_follows_kirchhoff():
    """m11 u' = m22 v r + X, m22 v' = -m11 u r + Y: Fossen, 6.3, with m22 = 1.3 m11."""
    craft = c17_simulation()
    X, Y, N = dots(craft)[3:6] - [V * R, -U * R, 0.0]
    found = dots(craft.with_effects([effect("sway_mass", 0.3)]))[3:6]
    np.testing.assert_allclose(found, [1.3 * V * R + X, (-U * R + Y) / 1.3, N], atol=1e-12)


def test_flow_across_the_hull_drags_in_sway_and_yaw():
    found = change(effect("cross_flow_drag", sway=0.4, yaw=0.7))
    np.testing.assert_allclose(found, [0.0, -0.4 * abs(V) * V, -0.7 * abs(V) * R], atol=1e-12)


def test_air_of_the_cushion_turns_with_the_hull_late():
    block = Model("one", [effect("cushion_swirl", 0.8, seconds=0.5)]).plant()
    found = block.to_numpy().derivatives(0.0, [*STATE, 0.3])
    np.testing.assert_allclose(found[[5, 6]], [-0.8 * (R - 0.3), (R - 0.3) / 0.5])
    times = np.linspace(0.0, 3.0, 301)
    run = block.compile().simulate(times, x0=[0, 0, 0, 0, 0, 1.0, 0.0], rtol=1e-10, atol=1e-12)
    rate = np.asarray(run.outputs)[list(run.output_labels).index("r")]
    # d = r - w falls as exp(-(c + 1/tau) t), and r = 1 - c times the integral of d
    fast = 0.8 + 1 / 0.5
    np.testing.assert_allclose(rate, 1 - 0.8 / fast * (1 - np.exp(-fast * times)), atol=1e-7)


PLACES = {
    "input_delay": "command",
    "fan_signal_lag": "command",
    "fan_lag": "actuator",
    "rudder_offset": "actuator",
    "sway_mass": "force",
    "wind": "force",
    "parameter_jump": "force",
    "gyro_bias": "sensor",
    "time_offset": "clock",
}


@pytest.mark.parametrize("name", PLACES)
def test_the_place_of_an_effect_follows_from_what_it_defines(name):
    assert effect_class(name).place() == PLACES[name]


def measured(*effects):
    block = c17_simulation().with_effects(effects).plant()
    values = dict(
        zip((s.name for s in block.outputs), block.to_numpy().outputs(0, STATE, [T, TH]), strict=True)
    )
    return {name: values[f"{name}_measured"] for name in MOTION if f"{name}_measured" in values}


def test_measurement_effects():
    assert measured(effect("gyro_bias", 0.2)) == {"r": pytest.approx(R + 0.2)}
    assert measured(effect("gyro_scale", 0.2)) == {"r": pytest.approx(1.2 * R)}
    block = c17_simulation().with_effects([effect("gyro_drift", 0.2)]).plant()
    assert block.to_numpy().outputs(3.0, STATE, [T, TH])[-1] == pytest.approx(R + 0.2 * 3.0)
    gyro = effect("gyro_scale", 0.2), effect("gyro_bias", 0.1)
    for both in (gyro, gyro[::-1]):  # the bias is not scaled, whichever stands first
        assert measured(*both) == {"r": pytest.approx(1.2 * R + 0.1)}
    assert measured(effect("sensor_lever_arm", 0.05)) == {"v": pytest.approx(V + 0.05 * R)}
    e, side = 0.1, V + 0.05 * R
    found = measured(effect("velocity_misalignment", e), effect("sensor_lever_arm", 0.05))
    turned = {"u": U * math.cos(e) + side * math.sin(e), "v": -U * math.sin(e) + side * math.cos(e)}
    assert found == pytest.approx(turned)


def test_a_tracked_point_off_the_centre_turns_about_it():
    found = measured(effect("pose_lever_arm", x=0.03, y=-0.02))
    place = {"x": X + 0.03 * COS + 0.02 * SIN, "y": Y + 0.03 * SIN - 0.02 * COS}
    assert found == pytest.approx(place)
    neutral = measured(effect("pose_lever_arm"))
    assert neutral == pytest.approx({"x": X, "y": Y})
    both = measured(effect("pose_lever_arm", x=0.03, y=-0.02), effect("sensor_lever_arm", 0.05))
    assert both == pytest.approx(place | {"v": V + 0.05 * R}), "independent of each other"


def test_measurement_effects_leave_the_motion_alone():
    given = effect("gyro_scale", 0.2), effect("sensor_lever_arm", 0.1), effect("pose_lever_arm", x=0.1)
    np.testing.assert_array_equal(change(*given), 0.0)


@pytest.mark.parametrize("name", effect_names())
def test_each_says_what_it_is_where_it_acts_and_whence_it_comes(name):
    cls = effect_class(name)
    assert cls.kind() in ("force", "input", "measurement")
    assert cls.source and (cls.__doc__ or "").strip().endswith((".", ")"))


@pytest.mark.parametrize("axis", ["surge", "sway", "yaw"])
@pytest.mark.parametrize("law", ["coulomb", "linear_drag", "quadratic_drag", "cubic_drag", "stribeck"])
def test_drag_takes_energy_wherever_its_coefficient_is_allowed(axis, law):
    cls = effect_class(f"{axis}_{law}")
    assert cls.numbers["value"].lower == 0.0
    block = Model("one", [effect(f"{axis}_{law}", 0.7)]).plant()
    functions = block.to_numpy()
    for state in np.random.default_rng(0).normal(size=(50, 6)):
        dx = functions.derivatives(0.0, state)
        assert state[3:] @ dx[3:] <= 1e-12


@pytest.mark.parametrize("name", ["input_delay", "time_offset"])
def test_a_shifted_clock_is_never_left_out_silently(name):
    model = c17_simulation().with_effects([effect(name, seconds=0.1)])
    delay = sp.Symbol(f"plant.{name}_seconds", real=True)
    assert dict(model.plant().delays) == {"thrust": delay, "rudder": delay}
    with pytest.raises(InputError, match="delay"):
        model.plant().to_numpy().derivatives(0.0, np.zeros(6), np.zeros(2))
    assert not model.plant(late=True).delays
    assert model.plant(late=True).states == c17_simulation().plant().states
    assert f"plant.{name}_seconds" in model.timing()
