"""A signal is a name with a unit, a start and bounds."""

import math

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import dimension


@pytest.mark.parametrize("name", ["", "2u", "surge speed", "u.", ".u", "u-v", "P[0", "P[a]", None, 3, "u\n"])
def test_what_is_no_identifier_is_no_signal_name(name):
    with pytest.raises(InputError, match=r"signal name|name: expected a text"):
        Signal(name, "m/s")


@pytest.mark.parametrize(
    "name", ["u", "yaw_coulomb", "plant.u", "xhat[3]", "P[0,1]", "loop.estimator.P[0,1]"]
)
def test_dotted_and_indexed_names_are_signal_names(name):
    assert Signal(name).symbol.name == name


def test_t_is_taken_by_time():
    with pytest.raises(InputError, match="time"):
        Signal("t", "s")


@pytest.mark.parametrize("unit", ["deg", "km/h", "rpm", "ms"])
def test_inside_there_are_si_units_only(unit):
    with pytest.raises(InputError, match=r"rudder.*SI"):
        Signal("rudder", unit)


def test_a_start_outside_the_bounds_is_refused_with_value_unit_and_bounds():
    with pytest.raises(InputError, match=r"yaw_coulomb = -0\.1 rad/s\^2 .*\[0, inf\]"):
        Signal("yaw_coulomb", "rad/s^2", start=-0.1, lower=0.0)


@pytest.mark.parametrize(
    "change",
    [
        {"start": math.nan},
        {"lower": 1.0},
        {"upper": -1.0},
        {"nominal": 0.0},
        {"nominal": math.inf},
        {"start": "fast"},
        {"upper": None},
    ],
)
def test_numbers_that_make_no_sense_are_refused(change):
    with pytest.raises(InputError, match=r"^u|(start|upper): expected a number"):
        Signal("u", "m/s", **change)


def test_a_changed_copy_leaves_the_original_alone():
    u = Signal("u", "m/s")
    assert u.replace(start=2).start == 2.0
    assert u.start == 0.0
    assert u.dimension == dimension("m/s")
    with pytest.raises(AttributeError):
        u.start = 1.0  # type: ignore[misc]
