"""A wrong name is answered with the nearest right one."""

import pytest

from hovercontrol.base.errors import InputError, did_you_mean


def test_the_nearest_name_is_offered():
    assert did_you_mean("sway_culomb", ["sway_coulomb", "yaw_coulomb"]) == "; did you mean 'sway_coulomb'?"


def test_a_word_of_a_longer_name_is_near():
    assert did_you_mean("gains", ["c17_gain_region", "k06_margins"]) == "; did you mean 'c17_gain_region'?"


def test_without_a_near_name_all_known_names_are_listed():
    assert did_you_mean("rocket", ["thrust", "fan"]) == "; known: fan, thrust"


def test_without_any_name_the_reader_is_told_so():
    assert did_you_mean("rocket", []) == "; there are none"


def test_scripts_catch_wrong_input_as_a_value_error():
    with pytest.raises(ValueError):
        raise InputError("yaw_coulomb must be positive")
