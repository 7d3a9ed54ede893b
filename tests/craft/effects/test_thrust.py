"""What the actuators do."""

import math

import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.craft.models.vehicles import hoverdemon


def test_a_rudder_to_the_left_pushes_the_stern_left_and_turns_the_bow_right():
    u, v, r = hoverdemon().plant().to_numpy().derivatives(0.0, [0.0] * 6, [1.0, 0.3])[3:]
    assert u > 0
    assert v > 0
    assert r < 0


def test_the_rudders_torque_is_its_side_force_times_its_arm():
    m, J, arm = 2.6, 0.096, 0.32
    _, v, r = hoverdemon().plant().to_numpy().derivatives(0.0, [0.0] * 6, [1.5, 0.4])[3:]
    assert J * r == pytest.approx(-arm * m * v)


def test_without_thrust_the_rudder_does_nothing():
    assert not hoverdemon().plant().to_numpy().derivatives(0.0, [0.0] * 6, [0.0, 0.4]).any()


def test_a_fan_at_right_angles_makes_no_surge_at_all():
    craft = Model("side", [effect("fan_force", 1.0)], fans=[Fan("f", 0.0, 0.0, math.pi / 2)])
    assert craft.plant().equations().splitlines()[3] == "u' = r*v"
