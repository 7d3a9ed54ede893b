"""Ranges and positions: the cone angle against table 5.2, Bancroft's method against geometry and scipy."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq, least_squares

from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.sensors import (
    Beacons,
    cone_correction,
    corrected_range,
    k06_beacons,
    locate,
    range_solver,
    speed_of_sound,
)

HEIGHT = 2.7048
TABLE_5_2 = {
    0: (2.7048, 2.7048),
    10: (2.7465, 2.7483),
    20: (2.8784, 2.8883),
    30: (3.1232, 3.1507),
    35: (3.3020, 3.3425),
}
NO_CONE = (0.0, 0.0)
place = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


def error_ratio(angle):
    return -0.038 * angle**2 + 0.0032 * angle + 1  # (5.7) as printed


# ---- the cone angle ---------------------------------------------------------------------------------


def test_correction_brings_table_5_2_to_the_true_ranges_within_half_a_millimetre():
    true, measured = np.transpose(list(TABLE_5_2.values()))
    assert np.abs(measured - true).max() > 0.04
    assert np.abs(corrected_range(measured, HEIGHT) - true).max() < 5e-4


@given(st.floats(0.01, math.radians(45)), st.floats(1.0, 4.0))
def test_five_steps_of_newton_solve_5_9_to_a_microradian(angle, height):
    true = height / math.cos(angle)
    measured = true / error_ratio(angle)
    # Below 0.003 rad the left side of (5.9) rises: its other root there is not meant.
    theirs = brentq(lambda a: error_ratio(a) * math.cos(a) - height / measured, 0.003, 1.2, xtol=1e-14)
    corrected, found = cone_correction().to_numpy().outputs(0.0, (), [measured, height])
    assert found == pytest.approx(theirs, abs=1e-6)
    assert corrected == pytest.approx(true, abs=1e-9)


@given(st.floats(0.9, 1.0))
def test_a_range_that_noise_made_shorter_than_the_height_is_left_alone(part):
    assert corrected_range(part * HEIGHT, HEIGHT) == pytest.approx(part * HEIGHT, rel=3e-5)


def test_without_a_cone_error_there_is_no_correction(rng):
    measured = rng.uniform(2.0, 6.0, 50)
    found = cone_correction(cone=NO_CONE).to_numpy().outputs(0.0, (), [measured, np.full(50, HEIGHT)])
    np.testing.assert_array_equal(found[0], measured)


SOLVER = range_solver(Beacons([(0, 0), (1, 0), (0, 1)], 2.0), cone=NO_CONE).to_numpy()

# ---- positions --------------------------------------------------------------------------------------


def ranges_to(beacons, x, y, bias=0.0):
    px, py = np.transpose(beacons.positions)
    return np.sqrt((x - px) ** 2 + (y - py) ** 2 + np.array(beacons.heights) ** 2) + bias


@given(st.lists(place, min_size=3, max_size=3), place, st.lists(st.floats(1, 4), min_size=3, max_size=3))
def test_three_exact_ranges_give_the_exact_place(positions, at, heights):
    spread = np.linalg.svd(np.array(positions) - np.mean(positions, axis=0), compute_uv=False)
    assume(spread[1] > 0.1 * spread[0] > 0.1)
    beacons = Beacons(positions, heights)
    params = {f"range_solver.{s.name}": s.start for beacon in beacons.signals() for s in beacon}
    x, y, b, solved = SOLVER.outputs(0.0, (), [*ranges_to(beacons, *at), 1, 1, 1], params)
    assert (x, y, b) == pytest.approx((*at, 0.0), abs=1e-9)
    assert solved == 1


@given(st.lists(st.tuples(place, place), min_size=1, max_size=20), st.floats(-0.1, 0.1))
def test_more_than_three_exact_ranges_give_place_and_bias(pairs, bias):
    beacons = Beacons([(-2, -2), (2.5, -2), (2, 2), (-2, 1.5), (0.5, 0)], [2.7, 2.7, 2.5, 2.7, 2.6])
    at = np.transpose([p for p, _ in pairs])
    rho = np.transpose([ranges_to(beacons, x, y, bias) for x, y in at.T])
    found = locate(rho, beacons, cone=NO_CONE)
    assert np.abs(found - [*at, np.full(len(pairs), bias)]).max() < 1e-9


def test_with_noise_it_is_as_good_as_nonlinear_least_squares_on_5_6(rng):
    beacons = k06_beacons()
    ours, theirs = [], []
    for _ in range(60):
        at = rng.uniform(0.4, 2.0, 2)
        rho = ranges_to(beacons, *at) + rng.normal(0, 0.003, 4)
        best = least_squares(lambda s, r=rho: ranges_to(beacons, *s) - r, [1.2, 1.2, 0.0])
        ours.append(locate(rho, beacons, cone=NO_CONE)[:2] - at)
        theirs.append(best.x[:2] - at)
    assert np.std(ours) < 1.1 * np.std(theirs)
    assert np.abs(np.array(ours) - theirs).max() < 0.005


def test_cone_error_and_its_correction_leave_nothing(rng):
    beacons = k06_beacons()
    at = rng.uniform(0.2, 2.2, (2, 100))
    true = np.transpose([ranges_to(beacons, *p) for p in at.T])
    measured = true / error_ratio(np.arccos(HEIGHT / true))
    assert np.abs(locate(measured, beacons)[:2] - at).max() < 1e-6
    assert np.abs(locate(measured, beacons, cone=NO_CONE)[:2] - at).max() > 0.01  # what K06 saves


def test_two_ranges_or_beacons_in_a_line_give_no_place():
    row = Beacons([(0, 0), (1, 0), (2, 0), (0, 2)], 2.5)
    rho = ranges_to(row, 0.7, 0.4)
    for deaf in ([0, 1], [3]):
        heard = np.where(np.isin(np.arange(4), deaf), np.nan, rho)
        assert np.isnan(locate(heard, row, cone=NO_CONE)).all()
        told = (
            range_solver(row, cone=NO_CONE)
            .to_numpy()
            .outputs(0.0, (), [*np.nan_to_num(heard), *~np.isnan(heard)])
        )
        assert np.isfinite(told).all() and told[-1] == 0
    heard = np.where(np.arange(4) == 1, np.nan, rho)
    assert locate(heard, row, cone=NO_CONE) == pytest.approx([0.7, 0.4, 0.0], abs=1e-9)


# ---- two ranges of more beacons ----------------------------------------------------------------------


@pytest.mark.slow
def test_of_two_ranges_the_place_nearer_to_the_previous_one_is_taken(rng):
    square = Beacons([(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0)], [2.5, 2.6, 2.7, 2.4])
    at = rng.uniform(0.2, 2.8, (2, 400))
    places, heights = np.array(square.positions), np.array(square.heights)
    rho = np.sqrt(((at[:, None] - places.T[:, :, None]) ** 2).sum(axis=0) + heights[:, None] ** 2)
    deaf = rng.permuted(np.tile([True, True, False, False], (400, 1)), axis=1).T
    before = at + rng.normal(0.0, 0.03, at.shape)
    x, y, b = locate(np.where(deaf, np.nan, rho), square, cone=NO_CONE, previous=before)
    a, c = (places[np.argmax(~deaf, axis=0)], places[3 - np.argmax(~deaf[::-1], axis=0)])
    beside = (c[:, 0] - a[:, 0]) * (at[1] - a[:, 1]) - (c[:, 1] - a[:, 1]) * (at[0] - a[:, 0])
    plain = abs(beside) / np.hypot(*(c - a).T) > 0.15  # farther from the line than the last fix is old
    assert plain.mean() > 0.8
    assert np.abs([x - at[0], y - at[1]])[:, plain].max() < 1e-6
    assert (b == 0.0).all()
    assert np.isnan(locate(np.where(deaf, np.nan, rho), square, cone=NO_CONE)).all()
    assert np.isnan(locate(np.where(deaf, np.nan, rho), square, cone=NO_CONE, previous=[np.nan, 1.0])).all()


def test_with_three_ranges_the_previous_place_counts_for_nothing(rng):
    square = k06_beacons()
    rho = rng.uniform(2.4, 3.2, (len(square.positions), 50))
    plain, with_one = locate(rho, square), locate(rho, square, previous=[0.3, 0.2])
    np.testing.assert_allclose(plain, with_one, rtol=1e-12)


# ---- two beacons ------------------------------------------------------------------------------------


def side_of(beacons, x, y):
    """By the sign of the triangle's area: 1 left of the line from the first beacon to the second."""
    (x1, y1), (x2, y2) = beacons.positions
    return np.sign((x2 - x1) * (y - y1) - (y2 - y1) * (x - x1))


@pytest.fixture
def pairs_of_beacons(rng):
    """Two beacons each, at different heights, and places at least 1 cm beside their line."""
    found = []
    while len(found) < 6:
        positions, heights = rng.uniform(-4, 4, (2, 2)), rng.uniform(1.5, 4.0, 2)
        apart = math.dist(*positions)
        if apart > 0.3:
            (dx, dy), at = positions[1] - positions[0], rng.uniform(-5, 5, (2, 500))
            beside = (dx * (at[1] - positions[0, 1]) - dy * (at[0] - positions[0, 0])) / apart
            found.append((Beacons(positions, heights), at[:, abs(beside) > 0.01]))
    return found


def test_two_exact_ranges_give_the_exact_place_on_the_side_that_is_told(pairs_of_beacons):
    for beacons, at in pairs_of_beacons:
        rho = np.transpose([ranges_to(beacons, *p) for p in at.T])
        side = side_of(beacons, *at)
        assert set(side) == {-1, 1}
        for told in (1, -1):
            x, y, b = locate(rho, beacons, cone=NO_CONE, side=told)
            right = side == told
            assert np.hypot(x - at[0], y - at[1])[right].max() < 1e-9
            assert (b == 0).all()
            # On the other side it is the mirror image: as far from both beacons, but elsewhere.
            assert (side_of(beacons, x, y) == told).all()
            mirrored = np.transpose([ranges_to(beacons, *p) for p in np.transpose([x, y])])
            np.testing.assert_allclose(mirrored, rho, atol=1e-9)
            assert np.hypot(x - at[0], y - at[1])[~right].min() > 0.015


def test_the_side_is_a_parameter_of_a_solver_of_two_beacons_only():
    two = range_solver(Beacons([(0, 0), (2, 0)], 2.0), cone=NO_CONE)
    rho = ranges_to(Beacons([(0, 0), (2, 0)], 2.0), 0.5, -0.7)
    for side in (1.0, -1.0):
        told = two.to_numpy().outputs(0.0, (), [*rho, 1, 1], {"range_solver.side": side})
        assert told == pytest.approx([0.5, 0.7 * side, 0.0, 1.0], abs=1e-9)
    with pytest.raises(InputError, match="expected no `previous` with two beacons"):
        range_solver(Beacons([(0, 0), (2, 0)], 2.0), previous=True)
    more = range_solver(k06_beacons(), side=-1)
    assert "side" not in [s.name for s in more.parameters]
    assert more.output_expressions == range_solver(k06_beacons()).output_expressions


def test_ranges_that_cannot_meet_give_no_place():
    beacons = Beacons([(0, 0), (3, 0)], 2.0)
    on_floor = np.array([(1.0, 1.0), (0.5, 4.0), (1.6, 1.6), (1.5, 1.5), (1.0, 4.0)]).T  # circles' radii [m]
    x, y, b = locate(np.hypot(on_floor, 2.0), beacons, cone=NO_CONE)
    # Apart, one within the other, crossing, touching outside, touching inside.
    assert np.isnan(x[:2]).all() and np.isnan(y[:2]).all() and np.isnan(b[:2]).all()
    np.testing.assert_allclose(x[2:], [1.5, 1.5, -1.0], atol=1e-9)
    np.testing.assert_allclose(y[2:], [math.sqrt(1.6**2 - 1.5**2), 0.0, 0.0], atol=1e-6)
    told = range_solver(beacons, cone=NO_CONE).to_numpy().outputs(0.0, (), [*np.hypot([1, 1], 2), 1, 1])
    assert np.isfinite(told).all() and told[-1] == 0


def test_of_two_beacons_both_must_be_heard_and_hang_apart():
    beacons = Beacons([(0, 0), (3, 0)], 2.0)
    rho = ranges_to(beacons, 1.0, 1.0)
    assert np.isnan(locate([rho[0], math.nan], beacons, cone=NO_CONE)).all()
    solver = range_solver(beacons, cone=NO_CONE).to_numpy()
    for inputs, params in (
        ([*rho, 1, 0], {}),
        ([*rho, 0, 0], {}),
        ([*rho, 1, 1], {"range_solver.beacon_2_x": 0.0}),
    ):
        told = solver.outputs(0.0, (), inputs, params)
        assert np.isfinite(told).all() and told[-1] == 0


def test_two_beacons_with_cone_error_and_its_correction_leave_nothing(rng):
    beacons = Beacons([(0.0, 0.0), (2.44, 0.0)], HEIGHT)
    at = rng.uniform(0.2, 2.2, (2, 100))
    true = np.transpose([ranges_to(beacons, *p) for p in at.T])
    measured = true / error_ratio(np.arccos(HEIGHT / true))
    assert np.abs(locate(measured, beacons)[:2] - at).max() < 1e-6
    assert np.abs(locate(measured, beacons, cone=NO_CONE)[:2] - at).max() > 0.01


def test_a_survey_error_moves_the_place():
    """Performance is most limited by how well beacon places are known (section 5.5.5)."""
    beacons = k06_beacons()
    solver = range_solver(beacons, cone=NO_CONE)
    inputs = [*ranges_to(beacons, 1.0, 1.4), 1, 1, 1, 1]
    wrong = {"range_solver.beacon_1_x": 0.05}
    found = solver.to_numpy().outputs(0.0, (), inputs, wrong)[:2]
    assert 0.005 < math.dist(found, (1.0, 1.4)) < 0.05


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Beacons(5, 2.0), "positions: expected a sequence, .*found 5"),
        (lambda: Beacons([], 2.0), "at least two, found 0"),
        (lambda: Beacons([(0, 0)], 2.0), "at least two, found 1"),
        (
            lambda: Beacons([(1, 1), (1, 1)], 2.0),
            r"two different positions, found \(\(1.0, 1.0\), \(1.0, 1.0\)\)",
        ),
        (lambda: Beacons([(1, 1), (1, 1.001)], 2.0), "two different positions"),
        (lambda: range_solver(k06_beacons(), side=0), "side must be 1 or -1, found 0"),
        (lambda: locate([2.0, 2.0], Beacons([(0, 0), (1, 0)], 1.0), side=2), "side must be 1 or -1, found 2"),
        (lambda: Beacons([(0, 0), (1, 1), (2, 2)], 2.0), "not in a line"),
        (lambda: Beacons([(1, 1)] * 3, 2.0), "not in a line"),
        (lambda: Beacons([(0, 0), (1, 0), (0, 1)], 0.0), "beacon 1: height must be positive"),
        (lambda: Beacons([(0, 0), (1, 0), (0, 1)], [2.0, 2.0]), "expected 3 heights, found 2"),
        (lambda: Beacons([(0, 0), (1, 0), (0,)], 2.0), "beacon 3: position: expected two numbers"),
        (lambda: locate([2.0, 2.0], k06_beacons()), "expected 4 ranges"),
        (lambda: corrected_range(2.0, 0.0), "heights must be positive"),
        (lambda: corrected_range(math.nan, 2.0), "found nan"),
        (lambda: cone_correction(cone=(0.0, 1.0)), "out of its bounds"),
    ],
)
def test_what_gives_no_place_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


# ---- the speed of sound -------------------------------------------------------------------------------


def test_the_speed_of_sound_is_cramers():
    """Cramer's tables: dry air of 0 and 20 degrees; then as the square root of the temperature."""
    dry = speed_of_sound([0.0, 20.0, 30.0], humidity=0.0, carbon_dioxide=3.14e-4)
    assert dry[:2] == pytest.approx([331.46, 343.37], abs=0.03)
    assert dry[2] / dry[1] == pytest.approx(math.sqrt(303.15 / 293.15), rel=3e-4)
    assert speed_of_sound(20.0, humidity=1.0) > speed_of_sound(20.0, humidity=0.0)
    with pytest.raises(InputError, match="temperature: expected 0 to 30, found 45"):
        speed_of_sound(45.0)


def test_a_wrong_temperature_goes_into_the_bias_rather_than_the_place():
    """5 degrees make 2.6 cm at 3 m: Bancroft's b takes most of it, as K06 says of b."""
    cold, true = speed_of_sound([20.0, 25.0])
    square, at = k06_beacons(), np.array([0.9, 1.4])
    places = np.array(square.positions)
    rho = np.hypot(np.hypot(*(at - places).T), square.heights) * cold / true
    x, y, b = locate(rho, square, cone=NO_CONE)
    assert abs(rho * (true / cold - 1)).mean() > 0.02
    assert math.hypot(x - at[0], y - at[1]) < 0.005
    assert b == pytest.approx(-0.025, abs=0.01)
