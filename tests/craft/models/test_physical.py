"""A craft given by its mass, its inertia, and its forces in newtons."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.modelfile import model_from_table, model_text
from hovercontrol.identification.diagnose.diagnosis import Found
from hovercontrol.identification.diagnose.report.formatting import number_of

MASS, INERTIA = 3.2, 0.05

BOAT = {
    "plant": {"name": "boat", "mass": MASS, "inertia": INERTIA},
    "inputs": {"thrust": {"unit": "N"}},
    "effects": {
        "surge_linear_drag": {"value": 1.6, "unit": "N*s/m"},
        "sway_quadratic_drag": {"value": 2.4, "unit": "kg/m"},
        "yaw_coulomb": {"value": 2.0, "unit": "N*cm", "width": 0.02},
        "thrust": {"value": 1.0, "unit": "1"},
        "rudder_torque": {"value": 20.0, "unit": "cm"},
    },
}


def test_forces_are_divided_by_the_mass_and_torques_by_the_inertia():
    expected = {
        "surge_linear_drag": 1.6 / MASS,
        "sway_quadratic_drag": 2.4 / MASS,
        "yaw_coulomb": 0.02 / INERTIA,
        "yaw_coulomb_width": 0.02,
        "thrust": 1.0 / MASS,
        "rudder_torque": 0.2 / INERTIA,
    }
    assert model_from_table(BOAT).coefficients() == pytest.approx(expected, rel=1e-12)


def test_a_model_file_keeps_mass_and_inertia():
    craft = model_from_table(BOAT)
    assert craft.forces()["yaw_coulomb"] == (pytest.approx(0.02), "N*m")
    assert "mass = 3.2\ninertia = 0.05\n" in model_text(craft)


def test_fans_in_newtons_push_a_craft_of_known_mass():
    fans = {"bow": {"x": 0.1, "y": 0.0, "direction": np.pi / 2, "curve": [0.3]}}
    craft = model_from_table({"plant": BOAT["plant"], "fans": fans})
    run = hc.simulate(craft.plant(), np.linspace(0.0, 0.1, 11), {"bow": np.ones(11)})
    v, r = (run.states[run.state_labels.index(name)][-1] for name in "vr")
    assert (v, r) == (
        pytest.approx(0.3 / MASS * 0.1, rel=1e-3),
        pytest.approx(0.03 / INERTIA * 0.1, rel=1e-3),
    )


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"effects": {"sway_coulomb": {"value": 1, "unit": "N"}}}, "needs the craft's mass"),
        ({"effects": {"yaw_coulomb": {"value": 1, "unit": "N*m"}}}, "needs the craft's inertia"),
        ({**BOAT, "effects": {"sway_coulomb": {"value": 1, "unit": "J"}}}, "like 'm/s^2' or 'N', found 'J'"),
        ({"effects": {"gyro_bias": {"value": 1, "unit": "N"}}}, "must be like 'rad/s', found 'N'"),
        ({"effects": {"mass": 3.2}}, "mass is a key of [plant]"),
        ({"plant": {"inertia": 0}}, "plant.inertia must be positive"),
    ],
)  # fmt: skip
def test_what_cannot_be_converted_is_refused_in_one_line(table, said):
    with pytest.raises(InputError) as refused:
        model_from_table(table)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def identified(command_unit):
    """Return what identify says of a trolley of 2 kg with 0.6 N s/m, its mass given as 2.5 kg."""
    t, drag = np.arange(0.0, 6.0, 0.02), 0.3
    force = np.repeat([1.0, -0.5, 2.0], 100)
    u = np.zeros(t.size)
    for k, f in enumerate(force[:-1]):  # exact for steps
        u[k + 1] = f / 0.6 + (u[k] - f / 0.6) * np.exp(-drag * 0.02)
    rng = np.random.default_rng(3)
    channels = {"u": u, "v": 0 * u, "r": 0 * u}
    noisy = {name: values + 0.002 * rng.normal(size=t.size) for name, values in channels.items()}
    guess = [hc.effect("thrust", 0.4), hc.effect("surge_linear_drag", 0.2)]
    craft = hc.Model("trolley", guess, thrust=hc.Signal("thrust", command_unit), mass=2.5)
    return hc.identify(craft, [hc.Log("run", t, {**noisy, "thrust": force, "rudder": 0 * u})])


def test_forces_that_are_known_tell_the_mass():
    found = identified("N")
    (mass,) = found.bodies()
    assert abs(mass.value - 2.0) < 4 * mass.std < 0.05
    assert "the logs determine mass 2 ± " in str(found) or "the logs determine mass 1.99" in str(found)


def test_without_known_forces_a_log_tells_them_up_to_a_common_factor():
    found = identified("A")
    assert found.bodies() == () and "up to a common factor" in str(found)
    drag = {f.name: f for f in found.forces()}["surge_linear_drag"]
    assert abs(drag.value - 2.5 * 0.3) < 4 * drag.std and drag.unit == "N*s/m"


def test_a_named_effect_is_told_as_an_acceleration_and_as_a_force():
    found = Found("sway_coulomb", "sway_coulomb", "v'", 0.5, 0.01, "m/s^2", body=3.2, force_unit="N")
    assert number_of(found) == "0.500 ± 0.010 m/s² (1.600 ± 0.032 N)"
