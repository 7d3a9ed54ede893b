"""The source documents' craft carry the source documents' numbers (FACTS 1, 3)."""

import math

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import (
    VEHICLES,
    c17_experiment,
    c17_simulation,
    four_fan,
    hoverdemon,
    vehicle,
)


def test_the_c17_simulation_has_the_experiments_drag_and_its_own_rudder_torque():
    c = c17_simulation().coefficients()
    assert [c[f"{a}_{k}"] for a in ("surge", "sway", "yaw") for k in ("coulomb", "linear_drag")] == [
        1.35,
        0.0,
        0.0,
        1.20,
        0.83,
        0.48,
    ]
    assert c["thrust"] == 0.75
    assert c["rudder_torque"] == pytest.approx(0.14 * 0.75 * 0.585 / 0.01)


def test_the_simulations_control_point_lies_beyond_the_centre_of_percussion():
    c = c17_simulation().coefficients()
    assert c["rudder_torque"] * 0.2 / c["thrust"] == pytest.approx(
        0.028 / (0.01 / 0.585)
    )  # a dx m/J = 1.64 > 1


def test_the_experiments_commands_are_bounded_as_built():
    craft = c17_experiment()
    assert (craft.thrust.unit, craft.thrust.lower, craft.thrust.upper) == ("A", 0.0, 6.1)
    assert math.degrees(craft.rudder.upper) == pytest.approx(26)
    assert craft.coefficients()["rudder_torque"] == 3.66


def test_hoverdemon_weighs_2_6_kg_and_not_the_1_6_that_table_4_1_prints():
    craft = hoverdemon()
    assert craft.coefficients() == pytest.approx({"thrust": 1 / 2.6, "rudder_torque": 0.32 / 0.096})
    # tables 6.2-6.3: P_X = 2.8 kg m/s at 1.1 m/s, to the printed digits
    mass = 1 / craft.coefficients()["thrust"]
    assert mass * 1.1 == pytest.approx(2.8, abs=0.1)
    assert pytest.approx(2.8, abs=0.1) != 1.6 * 1.1


def test_the_four_fan_crafts_left_fans_turn_it_to_the_left_when_they_push_forward():
    arms = {p.name: p.start for p in four_fan().plant().parameters if p.name.endswith("_arm")}
    assert arms == pytest.approx(
        {
            "plant.rear_left_arm": 0.0425,
            "plant.rear_right_arm": -0.0425,
            "plant.front_left_arm": -0.0425,
            "plant.front_right_arm": 0.0425,
        }
    )


def test_every_craft_is_found_by_name_and_a_misspelt_one_is_not():
    for name in VEHICLES:
        assert vehicle(name).name == name
    with pytest.raises(InputError, match="did you mean 'hoverdemon'"):
        vehicle("hoverdaemon")
