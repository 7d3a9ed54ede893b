"""References: where to be, with exact velocity and acceleration."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import UnitError
from hovercontrol.control.controllers.references import (
    REFERENCES,
    circle,
    ellipse,
    figure_eight,
    from_position,
    line,
    waypoints,
)

CORNERS = [[0.0, 0.0], [2.0, 0.5], [1.0, 2.0], [-1.0, 1.0], [0.0, -1.0]]
TIMES = [0.5, 2.0, 3.0, 5.5, 7.0]
PATHS = {
    "ellipse": ellipse(1.5, 2.5, rate=-1, phase=np.pi / 2),
    "circle": circle(1.2, 0.7, 0.3),
    "line": line((0.3, -0.4), (1.0, 2.0)),
    "figure_eight": figure_eight(3.0, 1.0, 0.8),
    "waypoints": waypoints(CORNERS, TIMES),
}


def at(block, t):
    return block.to_numpy().outputs(np.asarray(t, dtype=float), ())


def slope(block, rows, t, h=1e-3):
    """Sixth-order central difference of some outputs."""
    weights = {-3: -1, -2: 9, -1: -45, 1: 45, 2: -9, 3: 1}
    return sum(w * at(block, t + k * h)[rows] for k, w in weights.items()) / (60 * h)


def test_all_references_are_here():
    assert set(PATHS) == set(REFERENCES)


@pytest.mark.parametrize("name", PATHS)
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(name):
    t = np.linspace(0.03, 7.5, 97)
    t = t[np.abs(t[:, None] - np.array(TIMES)).min(axis=1) > 0.01]  # differences do not see across a knot
    path = PATHS[name]
    assert np.allclose(at(path, t)[2:4], slope(path, slice(0, 2), t), rtol=1e-9, atol=1e-9)
    assert np.allclose(at(path, t)[4:6], slope(path, slice(2, 4), t), rtol=1e-9, atol=1e-9)


def test_the_c17_simulations_ellipse_is_1_5_sin_t_2_5_cos_t():
    t = np.linspace(0, 10, 50)
    assert np.allclose(at(PATHS["ellipse"], t)[:2], [1.5 * np.sin(t), 2.5 * np.cos(t)], atol=1e-12)


def test_the_c17_experiments_ellipse_is_1_15_cos_07t_2_sin_07t():
    t = np.linspace(0, 10, 50)
    assert np.allclose(
        at(ellipse(1.15, 2.0, 0.7), t)[:2],
        [1.15 * np.cos(0.7 * t), 2 * np.sin(0.7 * t)],
        atol=1e-12,
    )


def test_a_circle_is_run_at_constant_speed_and_pulled_to_its_centre():
    x, y, vx, vy, ax, ay = at(PATHS["circle"], np.linspace(0, 9, 30))
    assert np.allclose(np.hypot(x, y), 1.2)
    assert np.allclose(np.hypot(vx, vy), 1.2 * 0.7)
    assert np.allclose([ax, ay], -(0.7**2) * np.array([x, y]))


def test_a_line_has_no_acceleration_and_its_speed():
    out = at(PATHS["line"], np.linspace(0, 9, 10))
    assert np.allclose(out[2:], np.array([[0.3], [-0.4], [0], [0]]))
    assert np.allclose(out[:2, 0], [1.0, 2.0])


def test_the_figure_eight_fills_its_length_and_width_and_crosses_itself():
    t = np.linspace(0, 2 * np.pi / 0.8, 4001)
    x, y = at(PATHS["figure_eight"], t)[:2]
    assert (np.ptp(x), np.ptp(y)) == pytest.approx((3.0, 1.0), abs=1e-5)
    assert at(PATHS["figure_eight"], np.pi / 0.8)[:2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_path_passes_through_its_points_at_their_times():
    assert np.allclose(at(PATHS["waypoints"], TIMES)[:2].T, CORNERS, atol=1e-12)


def test_the_path_is_at_rest_at_both_ends_and_held_beyond():
    before, start, end, after = (at(PATHS["waypoints"], t) for t in (-3.0, TIMES[0], TIMES[-1], 100.0))
    for found, corner in (
        (before, CORNERS[0]),
        (start, CORNERS[0]),
        (end, CORNERS[-1]),
        (after, CORNERS[-1]),
    ):
        assert found == pytest.approx([*corner, 0, 0, 0, 0], abs=1e-9)


def test_nothing_jumps_at_a_waypoint():
    for t in TIMES:
        before, after = at(PATHS["waypoints"], t - 1e-9), at(PATHS["waypoints"], t + 1e-9)
        assert np.allclose(before, after, atol=1e-6)


@settings(max_examples=3)
@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=6),
    st.lists(st.floats(0.5, 3), min_size=6, max_size=6),
    st.floats(-10, 1000),
)
def test_any_waypoints_are_passed(points, gaps, start):
    times = start + np.cumsum(gaps[: len(points)])
    assume((np.diff(times) > 0).all())
    found = at(waypoints(points, times), times)[:2].T
    assert np.allclose(found, points, atol=1e-9)


def test_two_points_make_the_smoothest_step():
    s = np.linspace(0, 1, 11)
    assert np.allclose(
        at(waypoints([[0, 0], [1, -2]], [0, 1]), s)[0], 10 * s**3 - 15 * s**4 + 6 * s**5, atol=1e-12
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: ellipse(0.0, 1.0),
        lambda: ellipse(1.0, -1.0),
        lambda: ellipse(1.0, 1.0, rate=0.0),
        lambda: circle(-1.0),
        lambda: circle(np.inf),
        lambda: circle(1.0, rate=np.nan),
        lambda: circle(1.0, phase=np.nan),
        lambda: line((0.0, 0.0)),
        lambda: line((np.inf, 0.0)),
        lambda: figure_eight(1.0, 0.0),
        lambda: waypoints([[0, 0]], [0]),
        lambda: waypoints([[0, 0], [1, 1]], [0, 0]),
        lambda: waypoints([[0, 0], [1, 1]], [1, 0]),
        lambda: waypoints([[0, 0], [1, 1]], [0, 1e-320]),
        lambda: waypoints([[0, 0], [1, 1], [2, 0]], [0, 1e-320, 2]),
        lambda: waypoints([[0, 0, 0], [1, 1, 1]], [0, 1]),
        lambda: waypoints([[0, 0], [1, np.nan]], [0, 1]),
        lambda: waypoints([[0, 0], [1, 1]], [0, 1, 2]),
        lambda: line((1.0, 0.0), (np.inf, 0.0)),
    ],
)
def test_paths_that_are_none_are_refused(make):
    with pytest.raises(InputError):
        make()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ellipse("a", 1.0), "semi_x: expected a number, found 'a'"),
        (lambda: ellipse(1.0, [1]), r"semi_y: expected a number, found \[1\]"),
        (lambda: ellipse(1.0, 1.0, rate="fast"), "rate: expected a number, found 'fast'"),
        (lambda: ellipse(1.0, 1.0, phase="a"), "phase: expected a number, found 'a'"),
        (lambda: circle(True), "radius: expected a number, found True"),
        (lambda: circle("2.0"), "radius: expected a number, found '2.0'"),
        (lambda: circle(10**400), "radius: expected a number, found a number of 401 digits"),
        (lambda: circle(1.0, phase=None), "phase: expected a number, found None"),
        (lambda: figure_eight({}, 1.0), "length: expected a number, found {}"),
        (lambda: line(3), "velocity: expected 2 values, each a number, found 3"),
        (lambda: line("ab"), "velocity: expected 2 values, each a number, found 'ab'"),
        (lambda: line((1.0,)), r"velocity: expected 2 values, each a number, found \(1.0,\)"),
        (lambda: line((1.0, 2.0, 3.0)), "velocity: expected 2 values, each a number"),
        (lambda: line((1.0, "a")), r"velocity\[1\]: expected a number, found 'a'"),
        (lambda: line([[1], [1, 2]]), r"velocity\[0\]: expected a number, found \[1\]"),
        (lambda: line((1.0, 0.0), 5), "start: expected 2 values, each a number, found 5"),
        (lambda: line((1.0, 0.0), (0.0, 0.0, 0.0)), "start: expected 2 values, each a number"),
        (lambda: waypoints("a", [0, 1]), "points: expected numbers, found 'a'"),
        (lambda: waypoints([["0", "0"], ["1", "1"]], [0, 1]), "points: expected numbers"),
        (lambda: waypoints([[0, 0], [1]], [0, 1]), "points: expected numbers"),
        (lambda: waypoints([[0, 0], [1, {}]], [0, 1]), "points: expected numbers"),
        (lambda: waypoints([[0, 0], [1, 1]], ["a", "b"]), "times: expected numbers"),
        (lambda: waypoints([[False, True], [True, True]], [0, 1]), "points must be numbers"),
    ],
)
def test_what_is_no_number_is_refused_by_name(make, said):
    with pytest.raises(InputError, match=said) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_numbers_of_numpy_and_sympy_and_pairs_of_any_kind_will_do():
    assert np.allclose(at(circle(np.float64(1.2), sp.Rational(7, 10), np.int64(0)), 0.0)[:2], [1.2, 0.0])
    for pair in ([0.3, -0.4], (0.3, -0.4), np.array([0.3, -0.4])):
        assert np.allclose(at(line(pair), 10.0)[:2], [3.0, -4.0])


def test_a_path_of_ones_own_is_differentiated_and_its_unit_checked():
    a, w = Signal("a", "m", start=2.0), Signal("w", "1/s", start=1.0)
    spiral = from_position(a.symbol * time * w.symbol, a.symbol * sp.sin(w.symbol * time), [a, w])
    assert at(spiral, 0.5) == pytest.approx(
        [1.0, 2 * np.sin(0.5), 2.0, 2 * np.cos(0.5), 0.0, -2 * np.sin(0.5)]
    )
    with pytest.raises(UnitError, match="x_ref"):
        from_position(time, a.symbol, [a])


def test_numbers_of_a_path_are_parameters():
    assert (
        PATHS["circle"].to_numpy().outputs(0.0, (), (), {"reference.radius": 2.0, "reference.phase": 0.0})[0]
        == 2.0
    )
