"""Where an effect acts is told by its equations: a lag on one command is not on all."""

import pytest

from hovercontrol import effect, vehicle
from hovercontrol.identification.diagnose.places import commands_of, place_of
from hovercontrol.identification.engine.subject import structure

CASES = [
    ("c17_experiment", "rudder_lag", {"seconds": 0.1}, "command rudder"),
    ("c17_experiment", "thrust_lag", {"seconds": 0.1}, "command thrust"),
    ("c17_experiment", "rudder_backlash", {"width": 0.1}, "command rudder"),
    ("c17_experiment", "thrust_rate_limit", {"limit": 1.0}, "command thrust"),
    ("c17_experiment", "input_delay", {"seconds": 0.1}, "all commands"),
    ("four_fan", "fan_lag", {"seconds": 0.1}, "all commands"),
]


@pytest.mark.parametrize(("craft", "name", "numbers", "said"), CASES)
def test_an_effect_acts_on_the_commands_that_pass_through_it(craft, name, numbers, said):
    model = vehicle(craft).with_effects([effect(name, **numbers)])
    block, added = structure(model), model.effect(name)
    assert commands_of(block, {block.parameter(added.parameter(key)).symbol for key in added.numbers}) == said


def test_a_lag_behind_a_lag_acts_on_the_same_command():
    more = [effect("rudder_lag", seconds=0.1), effect("rudder_rate_limit", limit=2.0)]
    model = vehicle("c17_experiment").with_effects(more)
    block, last = structure(model), model.effect("rudder_rate_limit")
    assert commands_of(block, {block.parameter(last.parameter("limit")).symbol}) == "command rudder"


SAID = [
    ("c17_experiment", "rudder_offset", {"value": 0.1}, "actuator of rudder"),
    ("c17_experiment", "thrust_deadzone", {"width": 0.1}, "actuator of thrust"),
    ("four_fan", "front_left_curve", {"value": 0.1}, "actuator of front_left"),
    ("four_fan", "fan_crosstalk", {"value": 0.1}, "actuator of all inputs"),
    ("c17_experiment", "sway_mass", {"value": 0.1}, "force in u' v'"),
]


@pytest.mark.parametrize(("craft", "name", "numbers", "said"), SAID)
def test_a_place_names_the_input_that_an_effect_changes(craft, name, numbers, said):
    model = vehicle(craft)
    assert place_of(model, model.effect_class(name)(**numbers)) == said
