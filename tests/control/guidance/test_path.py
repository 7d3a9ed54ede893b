"""K06's laws switched along a path: a square by the ideal craft, and its loop in every backend."""

import math
from itertools import pairwise

import control
import fmpy
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control.controllers.k06 import drive, force_to_command
from hovercontrol.control.guidance import path_tracker

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]]
MODES = ("point", "drive", "halt", "orient", "rest")


def square_loop(points=SQUARE, **options):
    craft = hc.vehicle("hoverdemon")
    law = drive(k1=8.0, k2=4.0)
    return hc.interconnect(
        [craft.plant(), path_tracker(points, **options), law, force_to_command()], "tracked"
    )


def run(loop, end, step=0.05):
    t = np.arange(0.0, end, step)
    response = loop.compile().simulate(t)
    return t, dict(zip(response.output_labels, np.asarray(response.outputs), strict=True))


def test_the_ideal_craft_flies_a_square_and_rests_at_its_end():
    _, seen = run(square_loop(), 70.0)
    assert seen["leg"][-1] == 3
    assert MODES[round(seen["mode"][-1])] == "rest"
    assert np.hypot(seen["x"][-1], seen["y"][-1]) < 0.25
    assert np.cos(seen["psi"][-1] + math.pi / 2) > math.cos(math.radians(6.0))
    assert np.abs(seen["cross_track"]).max() < 0.15
    assert np.all(np.diff(seen["leg"]) >= 0)
    speed = np.hypot(seen["u"], seen["v"])
    assert speed.max() < 0.42


def test_modes_follow_each_other_as_k06_has_them():
    _, seen = run(square_loop(), 40.0, step=0.01)  # every tick of the tracker
    present = seen["mode"].round().astype(int)
    changes = {(MODES[a], MODES[b]) for a, b in pairwise(present) if a != b}
    allowed = {
        ("point", "drive"), ("point", "halt"), ("drive", "halt"), ("halt", "point"), ("halt", "orient"),
        ("orient", "rest"), ("orient", "point"), ("rest", "halt"), ("rest", "point"), ("rest", "orient"),
    }  # fmt: skip
    assert changes <= allowed


def test_cross_track_is_the_distance_from_the_line_of_the_leg():
    _, seen = run(square_loop(), 30.0)
    second = seen["leg"] == 1  # from (4, 0) to (4, 4): left of it is where x is smaller
    assert seen["cross_track"][second] == pytest.approx(4.0 - seen["x"][second])
    assert seen["along_track"][second] == pytest.approx(seen["y"][second])


def test_long_legs_are_divided():
    tracker = path_tracker([[0.0, 0.0], [3.0, 4.0]], longest=2.0)
    corners = [tracker.parameter(f"x_{k}").start for k in range(4)]
    assert corners == pytest.approx([0.0, 1.0, 2.0, 3.0])


def test_the_end_heading_is_reached():
    _, seen = run(square_loop([[0.0, 0.0], [2.0, 0.0]], end_heading=1.0), 40.0)
    assert seen["psi"][-1] == pytest.approx(1.0, abs=math.radians(6.0))


def test_python_and_python_control_fly_as_compiled_code_does():
    loop = square_loop()
    t = np.arange(0.0, 3.0, 0.05)
    compiled = loop.compile().simulate(t, rtol=1e-8, atol=1e-10).outputs
    assert hc.simulate(loop, t, rtol=1e-8, atol=1e-10).outputs == pytest.approx(compiled, abs=1e-5)
    system = loop.to_control(step=0.05)
    stepped = control.input_output_response(system, t, 0.0, [s.start for s in loop.states]).outputs
    assert stepped == pytest.approx(compiled, abs=1e-4)


@pytest.mark.slow
def test_the_tracked_craft_flies_as_an_fmu(tmp_path):
    loop = square_loop([[0.0, 0.0], [1.5, 0.0], [1.5, 1.5]])
    t = np.arange(0.0, 20.05, 0.1)
    expected = loop.compile().simulate(t)
    path = loop.to_fmu(tmp_path / "tracked.fmu", stop=20.0, step=0.1)
    names = ["x", "y", "leg", "cross_track"]
    found = fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", output=names, stop_time=20.0)
    for name in names:
        own = expected.outputs[list(expected.output_labels).index(name)]
        assert np.interp(t[:-1], found["time"], found[name]) == pytest.approx(own[:-1], abs=2e-3)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: path_tracker([[0.0, 0.0]]), "n >= 2"),
        (lambda: path_tracker(SQUARE, longest=0.0), "longest"),
        (lambda: path_tracker(SQUARE, surge=-1.0), "surge"),
        (lambda: path_tracker(SQUARE, period=0.0), "period"),
    ],
)
def test_wrong_numbers_are_refused_in_one_line(make, said):
    with pytest.raises(InputError, match=said) as error:
        make()
    assert "\n" not in str(error.value)
