"""Line of sight along waypoints: cross-track errors by hand, and a craft that goes round them."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control.guidance import command_filter, course_control, line_of_sight, steering_law

CORNERS = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]

#: A craft with linear drag on all axes; dry friction is that of other tests.
CRAFT = hc.vehicle("hoverdemon").with_effects(
    [
        hc.effect("surge_linear_drag", 0.3),
        hc.effect("sway_linear_drag", 0.8),
        hc.effect("yaw_linear_drag", 2.459),
    ]
)


def told(guidance, positions):
    """Return what guidance tells tick by tick at given positions."""
    t = guidance.period * np.arange(len(positions))
    response = hc.simulate(guidance.in_continuous_time, t, np.transpose(positions))
    return dict(zip(response.output_labels, np.asarray(response.outputs), strict=True))


def test_the_errors_and_the_course_of_an_oblique_leg_are_fossens():
    start, end, here = np.array([1.0, 2.0]), np.array([5.0, 5.0]), np.array([2.0, 4.5])
    seen = told(line_of_sight([start, end], lookahead=2.0, acceptance=0.5), [here, here])
    chi = np.arctan2(3.0, 4.0)
    turned = np.array([[np.cos(chi), np.sin(chi)], [-np.sin(chi), np.cos(chi)]]) @ (here - start)
    assert seen["along_track"][-1] == pytest.approx(turned[0])
    assert seen["cross_track"][-1] == pytest.approx(turned[1])
    assert seen["course_ref"][-1] == pytest.approx(chi - np.arctan(turned[1] / 2.0))
    assert seen["to_go"][-1] == pytest.approx(np.hypot(*(end - here)))


def test_legs_change_in_the_circle_of_acceptance_and_where_a_waypoint_is_passed():
    path = [[0.0, 0.0], [8.5, 0.0], [9.5, 0.0], [10.5, 3.0], [10.5, 9.5]]
    seen = told(line_of_sight(CORNERS, acceptance=1.0), path)
    assert seen["leg"].tolist() == [0, 0, 1, 1, 2]
    beside = told(line_of_sight(CORNERS, acceptance=1.0), [[9.9, 3.0], [10.1, 3.0]])
    assert beside["leg"].tolist() == [0, 1]


@pytest.mark.slow
def test_after_the_last_waypoint_it_stops_and_a_closed_path_goes_on():
    path = [[9.5, 0.0], [10.0, 9.5], [0.5, 10.0], [0.0, 9.0], [0.0, 0.5]]
    open_path = told(line_of_sight(CORNERS), path)
    assert open_path["leg"].tolist() == [1, 2, 3, 3, 3]
    assert open_path["surge_ref"].tolist() == [0.5, 0.5, 0.0, 0.0, 0.0]
    assert told(line_of_sight(CORNERS, closed=True), path)["leg"].tolist() == [1, 2, 3, 3, 0]


def test_the_course_takes_the_shorter_turn_through_pi():
    seen = told(
        line_of_sight([[0, 0], [-10, 1], [-20, -1]], acceptance=1.0), [[0, 0], [-5, 0.5], [-9.8, 1.0]] * 1
    )
    assert np.abs(np.diff(seen["course_ref"])).max() < 0.6


def test_an_ideal_point_converges_as_the_law_says():
    """A point that goes where it is told: e' = -U e/sqrt(lookahead^2 + e^2) (Fossen 2011, section 10.3)."""
    U, lookahead = 0.5, 2.0
    law = line_of_sight([[0.0, 0.0], [50.0, 0.0]], lookahead=lookahead)
    guidance, rest = law.to_numpy(), np.zeros(len(law.states))
    t = np.linspace(0.0, 12.0, 61)
    exact = solve_ivp(
        lambda _, e: -U * e / np.hypot(lookahead, e), (0.0, 12.0), [1.5], t_eval=t, rtol=1e-9
    ).y[0]

    def slope(_, p):
        course = guidance.outputs(0.0, rest, p)[0]
        return [U * np.cos(course), U * np.sin(course)]

    flown = solve_ivp(slope, (0.0, 12.0), [0.0, 1.5], t_eval=t, rtol=1e-9).y[1]
    assert flown == pytest.approx(exact, abs=1e-6)


def course_loop(path=CORNERS, craft=CRAFT, **options):
    guidance = line_of_sight(path, acceptance=2.0, **options)
    parts = [craft.plant(), guidance, course_control(), command_filter(lag=0.3), steering_law(CRAFT)]
    return hc.interconnect(parts)


def run(loop, end, x0=None, params=None):
    t = np.arange(0.0, end, 0.05)
    response = loop.compile().simulate(t, x0=x0, params=params)
    return t, dict(zip(response.output_labels, np.asarray(response.outputs), strict=True))


def test_a_craft_goes_round_four_waypoints():
    t, seen = run(course_loop(), 70.0, {"plant.y": 1.0})
    assert seen["leg"][-1] == 3
    assert abs(seen["u"][-1]) < 1e-3
    for leg in range(3):
        there = seen["leg"] == leg
        error = seen["cross_track"][there]
        assert error.min() > -0.5  # overshoot at a corner of 90 degrees, 2 m before the waypoint
        assert np.abs(error[-20:]).max() < 0.25
    assert np.abs(seen["cross_track"][(t > 12) & (seen["leg"] == 0)]).max() < 0.11


def test_integral_line_of_sight_takes_away_what_a_side_force_leaves():
    pushed = CRAFT.with_effects([hc.effect("body_side_force", 0.05)])
    leg = [[0.0, 0.0], [60.0, 0.0]]
    _, plain = run(course_loop(leg, pushed), 100.0)
    _, integral = run(course_loop(leg, pushed, integral=0.1), 100.0)
    sideslip = plain["v"][-1] / plain["u"][-1]
    assert plain["cross_track"][-1] == pytest.approx(3.0 * sideslip, rel=0.1)  # course_ref = -sideslip
    assert abs(plain["cross_track"][-1]) > 0.2
    assert abs(integral["cross_track"][-1]) < 0.02


def test_the_loop_is_the_same_in_python_and_python_control():
    loop = course_loop()
    t = np.arange(0.0, 6.0, 0.02)
    python = hc.simulate(loop, t, rtol=1e-8, atol=1e-10).outputs
    compiled = loop.compile().simulate(t, rtol=1e-8, atol=1e-10).outputs
    assert compiled == pytest.approx(python, abs=1e-5)
    system = loop.to_control(step=0.02)
    stepped = control.input_output_response(system, t, 0.0, [s.start for s in loop.states]).outputs
    assert stepped == pytest.approx(python, abs=1e-4)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: line_of_sight([[0.0, 0.0]]), "n >= 2"),
        (lambda: line_of_sight([[0.0, 0.0], [0.0, 0.0]]), "coincide"),
        (lambda: line_of_sight([[0.0, 0.0], [np.nan, 0.0]]), "finite"),
        (lambda: line_of_sight(CORNERS, lookahead=0.0), "lookahead"),
        (lambda: line_of_sight(CORNERS, integral=-1.0), "integral"),
        (lambda: course_control(gain=0.0), "gain"),
    ],
)
def test_wrong_numbers_are_refused_in_one_line(make, said):
    with pytest.raises(InputError, match=said) as error:
        make()
    assert "\n" not in str(error.value)
