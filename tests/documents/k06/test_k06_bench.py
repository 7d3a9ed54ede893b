"""K06's rotating bench (section 6.2.1): tables 6.5 to 6.7 and figure 6.20, as its scripts find them."""

import math

import numpy as np
import pyarrow.csv
import pytest
import scipy.signal
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.autopilot.turntable import bench_command, turntable
from hovercontrol.documents import printed
from hovercontrol.documents.k06 import bench, gyro
from hovercontrol.documents.k06.bench.aids import aided, aided_settings
from hovercontrol.documents.k06.bench.blocks import UNITS
from hovercontrol.documents.k06.bench.instruments import encoder, sample_delay
from hovercontrol.documents.k06.bench.runs import COLUMNS, CRICKET_AGE, GUESSED, STATED, errors
from hovercontrol.documents.k06.bench.square_wave import square_wave
from hovercontrol.documents.k06.bench.units import PLACES, second_unit, unit_headings

TICK = 0.0065536
FREQUENCY, GAIN, PHASE, GAIN_AFTER, PHASE_AFTER, GAINED = gyro.TABLE_6_5.T


# ---- the platform -----------------------------------------------------------------------------------


def acceleration_of_the_sensors():
    """Second derivative of the path of a point on the beam, turned into its axes: x tangential, y inward."""
    t, R = sp.symbols("t R")
    psi = sp.Function("psi")(t)
    path = R * sp.Matrix([sp.sin(psi), -sp.cos(psi)])
    felt = sp.rot_ccw_axis3(psi)[:2, :2].T * path.diff(t, 2)
    p, w, dw = sp.symbols("p w dw")
    return sp.lambdify([p, w, dw, R], felt.subs({psi.diff(t, 2): dw}).subs({psi.diff(t): w}).subs({psi: p}))


FELT = acceleration_of_the_sensors()
PLATE = turntable(lag=0.25).to_numpy()


@given(st.floats(-6, 6), st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 1))
def test_the_sensors_feel_the_second_derivative_of_their_path(psi, r, command, arm):
    params = {"turntable.arm": arm}
    turning = PLATE.derivatives(0.0, [psi, r], [command], params)[1]
    told = PLATE.outputs(0.0, [psi, r], [command], params)
    assert turning == pytest.approx((command - r) / 0.25)
    np.testing.assert_allclose(told[6:8], FELT(psi, r, turning, arm).ravel(), atol=1e-9)
    assert math.hypot(told[0], told[1]) == pytest.approx(arm, abs=1e-12)
    assert told[3] == pytest.approx(arm * r)


@given(st.floats(-6, 6), st.floats(-0.3, 0.3))
def test_a_leaning_axis_adds_a_constant_in_the_earths_axes(psi, tilt):
    told = PLATE.outputs(0.0, [psi, 0.0], [0.0], {"turntable.tilt": tilt})[6:8]
    turn = np.array([[math.cos(psi), -math.sin(psi)], [math.sin(psi), math.cos(psi)]])
    np.testing.assert_allclose(turn @ told, [9.80665 * math.sin(tilt), 0.0], atol=1e-12)


def test_the_square_wave_spins_rests_and_spins_back():
    told = bench_command("square", rate=4.0, half_period=3.0, rest=0.5).to_numpy()
    seen = [float(told.outputs(t, (), ())[0]) for t in (0.1, 2.9, 3.1, 3.6, 6.4, 6.6, 7.1)]
    assert seen == [4.0, 4.0, 0.0, -4.0, -4.0, 0.0, 4.0]
    sine = bench_command("sine", rate=2.0, frequency=5.0).to_numpy()
    assert float(sine.outputs(0.05, (), ())[0]) == pytest.approx(2.0)  # a quarter of a period


@given(st.lists(st.floats(-20, 20), min_size=1, max_size=20))
def test_the_encoder_is_within_half_a_step_and_fixes_lie_on_the_circle(headings):
    ticking = Ticking(encoder())
    for psi in headings:
        told = ticking.tick(0.0, {"psi": psi})
        assert abs(told["encoder_psi"] - psi) <= math.pi / 4096 + 1e-12
        place = math.hypot(told["encoder_x"] - 1.22, told["encoder_y"] - 1.22)
        assert place == pytest.approx(12 * 0.0254)


def test_the_encoder_fixes_once_a_second():
    ticking = Ticking(encoder())
    fresh = [ticking.tick(0.0, {"psi": 0.0})["encoder_valid"] for _ in range(600)]
    assert np.diff(np.flatnonzero(fresh)).tolist() == [round(1 / TICK)] * 3


@given(st.integers(0, 4), st.lists(st.floats(-1, 1), min_size=6, max_size=9))
def test_a_sample_delay_tells_what_was_so_many_ticks_ago(samples, values):
    late = Ticking(sample_delay([Signal("a")], "late", most=4, samples=samples, name="line"))
    told = [late.tick(0.0, {"a": a})["a_late"] for a in values]
    assert told == [0.0] * samples + values[: len(values) - samples]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: bench_command("squre"), "motion must be one of constant, square, sine, found 'squre'"),
        (lambda: bench_command(rest=-1.0), "rest must not be negative"),
        (lambda: bench_command(frequency=0.0), "frequency must be positive"),
        (lambda: turntable(arm=-0.1), "arm must not be negative"),
        (lambda: turntable(lag=0.0), "lag must be positive"),
        (lambda: turntable(centre=(1.0,)), "centre must be two numbers"),
        (lambda: sample_delay([Signal("a")], "late", most=0, name="line"), "line: most must be a positive"),
    ],
)
def test_wrong_numbers_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


# ---- table 6.5 --------------------------------------------------------------------------------------


def test_every_dt_of_table_6_5_is_that_of_the_gyros_inverse():
    gained = gyro.gyro_transfer(FREQUENCY)[2]
    np.testing.assert_allclose(gained, GAINED, atol=0.02)
    exact = gyro.gyro_transfer(FREQUENCY, digits=None)[2]
    rounding = 5 / (2 * math.pi * FREQUENCY)  # half a digit of a phase [ms]
    assert np.all(abs(exact - GAINED) <= rounding + 0.005)


def test_a_bench_run_with_sines_measures_the_gyro_and_its_compensation():
    """Against (6.2) by scipy; K06's gains, compensated over uncompensated, are those of the inverse too."""
    raw, compensated = gyro.gyro_sines(FREQUENCY)
    w = 2 * math.pi * FREQUENCY * TICK
    two = np.exp(-2j * w)
    response = scipy.signal.freqz([0.3236], [1, -0.9805, 0.2898], worN=w)[1]
    np.testing.assert_allclose(compensated, two, atol=1e-3)
    np.testing.assert_allclose(raw, response * two, atol=5e-3)
    np.testing.assert_allclose(abs(compensated / raw), GAIN_AFTER / GAIN, rtol=0.02)
    np.testing.assert_allclose(np.angle(compensated / raw), PHASE_AFTER - PHASE, atol=0.02)


# ---- table 6.6 --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_compensation_helps_in_the_square_wave_as_in_table_6_6():
    found, table = square_wave(seeds=4), printed("k06", "table 6.6")
    assert list(found) == list(table)
    for name in ("rate", "heading"):
        both = [f"{name}, {kind}" for kind in ("compensated", "uncompensated")]
        asked = table[both[0]].value / table[both[1]].value
        assert found[both[0]].mean / found[both[1]].mean == pytest.approx(asked, rel=0.3)
        for entry in both:
            assert found[entry].ratio == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
def test_with_q1_as_printed_the_heading_knows_no_gyro():
    found = {entry: r.mean for entry, r in square_wave({}, seeds=4).items()}
    assert found["heading, compensated"] == pytest.approx(found["heading, uncompensated"], rel=0.05)
    assert found["rate, compensated"] < 0.75 * found["rate, uncompensated"]


# ---- table 6.7 --------------------------------------------------------------------------------------


@pytest.mark.slow("cricket", GUESSED)
@pytest.mark.parametrize("aid", ["magnetometer", "cricket"])
@pytest.mark.parametrize("column", ["bench errors", GUESSED])
def test_with_a_leaning_axis_and_a_noisy_tachometer_table_6_7_is_met(aid, column):
    found = aided(aid, COLUMNS[column], seeds=8)
    assert len(found) == 4
    for entry, r in found.items():
        assert r.ratio == pytest.approx(1.0, abs=0.3), entry


def test_with_k06s_own_numbers_the_magnetometers_row_is_too_good_and_crickets_motion_is_met():
    found = {aid: aided(aid, COLUMNS["stated"], seeds=8) for aid in ("magnetometer", "cricket")}
    ratio = {entry: r.ratio for row in found.values() for entry, r in row.items()}
    assert ratio["magnetometer: heading"] == pytest.approx(1.0, abs=0.3)
    assert all(ratio[f"magnetometer: {q}"] < 0.7 for q in ("rate", "velocity", "position"))
    moved = ("heading", "velocity", "position")
    assert all(ratio[f"cricket: {q}"] == pytest.approx(1.0, abs=0.3) for q in moved)


@pytest.mark.parametrize("rate", [-57, -115, -230])
def test_crickets_heading_lags_by_the_age_of_its_fixes(rate):
    """13 ticks late; the filter's noise adds in square."""
    settings = {**STATED, **CRICKET_AGE, **aided_settings("cricket", inline=True)}
    settings["command.rate"] = math.radians(rate)
    found = np.degrees(errors(settings, 8, 30.0, 5.0)["heading_error"].mean())
    assert found == pytest.approx(abs(rate) * 13 * TICK, abs=0.6)


# ---- figure 6.20 ------------------------------------------------------------------------------------


def test_the_ins_helps_the_two_units_heading_as_in_figure_6_20():
    raw, helped = unit_headings(COLUMNS[GUESSED], seeds=8)
    assert raw.ratio == pytest.approx(1.0, abs=0.3)
    assert helped.ratio == pytest.approx(1.0, abs=0.3)
    assert raw.mean - helped.mean == pytest.approx(15.0, abs=3.0)  # "approximately 15 deg more accurate"


@pytest.mark.parametrize("place", [UNITS[1], *PLACES.values()])
def test_the_raw_heading_is_off_by_the_geometry_of_the_units(place):
    """Fixes without noise: the first unit 100 ms before the second, told a slot and up to a tick late."""
    w = math.radians(-115.0)
    quiet = {"cricket_ranges.noise": 0.0, "cricket_ranges.cone_limit": 0.0}
    found = unit_headings({**quiet, **second_unit(place)}, seeds=2)[0].mean

    def at(unit, psi):
        turn = np.array([[math.cos(psi), -math.sin(psi)], [math.sin(psi), math.cos(psi)]])
        return turn @ (np.array([0.0, -0.3048]) + unit)

    line = at((0.0, 0.0), -w * 0.1) - at(place, 0.0)
    before = at((0.0, 0.0), 0.0) - at(place, 0.0)
    turned = math.atan2(*reversed(line)) - math.atan2(*reversed(before))
    off = math.degrees(turned - w * (0.1 + TICK / 2))
    assert found == pytest.approx(abs(off), abs=0.6)


# ---- scripts ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "main", "small", "tables"),
    [("k06_gyro", gyro.main, {"points": 20}, 1), ("k06_bench", bench.main, {"seeds": 2, "walks": 3}, 4)],
)
def test_a_script_leaves_pictures_tables_and_findings(name, main, small, tables, tmp_path):
    told = []
    files = main(tmp_path, told.append, **small)
    assert told[-1] == pytest.approx(1.0)
    assert {f.suffix for f in files} == {".png", ".svg", ".csv", ".txt"}
    assert [f.suffix for f in files].count(".csv") == tables
    for file in files:
        assert file.stem.startswith(name) and file.stat().st_size > 50
        if file.suffix == ".csv":
            assert pyarrow.csv.read_csv(file).num_rows >= 3
        if file.suffix == ".txt":
            assert "nan" not in file.read_text().lower().split()
