"""Calibration on benches whose truth is known, on K06's numbers, and on a real fan's bench."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.actuators import actuators, fan_force, fan_tables, read_fan_table
from hovercontrol.craft.hardware.calibration import (
    fit_inertia,
    fit_reverse_ratio,
    fit_rudder,
    fit_thrust,
    mean_inertia,
    read_fan_bench,
    thrust_table_from_bench,
)
from hovercontrol.logs import BenchTable

_SHARED = Path(__file__).parents[3].parent / "shared" / "data"
DATA = Path(os.environ.get("HOVERCONTROL_DATA", _SHARED)) / "real_hovercraft"

SPEEDS = np.arange(3000.0, 12001.0, 1000.0)
ANGLES = np.linspace(-20.0, 25.0, 12)
RATIO = np.array([9.734e-4, -3.277e-2, 3.833e-1, -1.099])
QUADRATIC = np.array([0.0145, 0.004, -0.02])


def thrust_bench(rng):
    return fit_thrust(
        SPEEDS, np.polyval(QUADRATIC, SPEEDS / 1e3) + rng.normal(0, 0.03, SPEEDS.size)
    ), QUADRATIC


def rudder_bench(rng):
    return fit_rudder(ANGLES, -1.40 * ANGLES + 0.566 + rng.normal(0, 0.5, ANGLES.size)), (-1.40, 0.566)


def ratio_bench(rng):
    n = np.linspace(6000.0, 12000.0, 13)
    return fit_reverse_ratio(n, np.polyval(RATIO, n / 1e3) + rng.normal(0, 0.01, n.size)), RATIO


def release_test(rng):
    t = np.arange(0.0, 1.5, 0.0065536)
    r = 0.02 + 0.32 * 0.28 / 0.096 * t + rng.normal(0, 0.05, t.size)
    return fit_inertia(t, r, side_force=-0.28, arm=0.32), (0.096, 0.02)


BENCHES = [thrust_bench, rudder_bench, ratio_bench, release_test]


@pytest.mark.parametrize("bench", BENCHES)
def test_intervals_hold_the_truth_as_often_as_they_say(bench):
    """Of 400 benches, within four standard deviations of the binomial count."""
    hits = []
    for seed in range(400):
        fit, truth = bench(np.random.default_rng(seed))
        ends = np.array(list(fit.intervals(0.95).values())).T
        hits.append((ends[0] <= truth) & (truth <= ends[1]))
    half = 4 * np.sqrt(0.95 * 0.05 / 400)
    assert np.abs(np.mean(hits, axis=0) - 0.95) == pytest.approx(0.0, abs=half)


def test_the_line_and_its_errors_are_scipys():
    fit, _ = rudder_bench(np.random.default_rng(1))
    line = stats.linregress(fit.x, fit.y)
    assert fit.values == pytest.approx([line.slope, line.intercept], rel=1e-10)
    assert fit.std == pytest.approx([line.stderr, line.intercept_stderr], rel=1e-10)


def test_the_quadratic_and_its_covariance_are_numpys():
    fit, _ = thrust_bench(np.random.default_rng(1))
    values, covariance = np.polyfit(fit.x / 1e3, fit.y, 2, cov=True)
    assert fit.values == pytest.approx(values, rel=1e-9)
    assert fit.covariance == pytest.approx(covariance, rel=1e-8)


@pytest.mark.parametrize(
    ("side", "yaw_acceleration", "inertia"), [(-0.28, 0.9412, 0.0952), (0.31, -1.026, 0.0967)]
)
def test_release_tests_of_table_4_2(side, yaw_acceleration, inertia):
    t = np.linspace(0.0, 2.0, 50)
    rate = yaw_acceleration * np.minimum(t, 1.2)  # friction ends the straight part
    fit = fit_inertia(t, rate, side_force=side, arm=0.32, between=(0.0, 1.2))
    assert fit.coefficients()["inertia"] == pytest.approx(inertia, abs=6e-5)
    late = fit_inertia(t, rate, side_force=side, arm=0.32).coefficients()["inertia"]
    assert late > 1.1 * inertia  # what leaving the straight part in would do


def test_the_mean_of_k06s_trials_is_the_adopted_inertia():
    fit = mean_inertia([0.0952, 0.0967])
    assert round(fit.coefficients()["inertia"], 3) == 0.096
    assert fit.std[0] == pytest.approx(np.std([0.0952, 0.0967], ddof=1) / np.sqrt(2))


# ---- tables -----------------------------------------------------------------------------------------


def fan_bench(noise=0.0, seed=0):
    """The stand-in's fan on a bench like K06's: forward at all angles, in reverse at rudder 0 only."""
    rudder, speed = (a.ravel() for a in np.meshgrid(np.arange(-35.0, 31.0, 5.0), SPEEDS, indexing="ij"))
    rudder, speed = np.append(rudder, np.zeros(7)), np.append(speed, -SPEEDS[3:])
    rng = np.random.default_rng(seed)
    return rudder, speed, fan_force(speed, rudder) + rng.normal(0, noise, speed.size)


def test_a_bench_without_noise_gives_the_tables_it_was_made_of():
    found = thrust_table_from_bench(*fan_bench())
    assert found.ratio.values == pytest.approx(RATIO, rel=1e-6)
    for mine, theirs in zip(found.tables, fan_tables(), strict=True):
        assert mine.shape == theirs.shape
        assert mine.values == pytest.approx(theirs.values, abs=1.0 if mine.over == "force" else 1e-9)


def test_noise_of_the_force_gauge_moves_the_tables_by_no_more_than_itself():
    """Ten quadratics' errors at once stay below two of K06's 0.025 N columns, at a noise of one."""
    truth = fan_tables()[1].values
    for seed in range(5):
        found = thrust_table_from_bench(*fan_bench(0.01, seed)).reverse.values
        assert np.abs(found - truth).max() < 0.05


def test_the_tables_are_written_for_the_blocks_to_read(tmp_path):
    found = thrust_table_from_bench(*fan_bench(0.01))
    tables = tuple(read_fan_table(p) for p in found.to_csv(tmp_path / "tables"))
    for mine, read in zip(found.tables, tables, strict=True):
        assert read.values == pytest.approx(mine.values, rel=1e-9)
    assert actuators(tables=tables).pilot[2].name == "thrust_lookup"


def test_a_bench_is_read_from_its_file(tmp_path):
    file = tmp_path / "bench.csv"
    bench = fan_bench()
    rows = [",".join(map(repr, map(float, row))) for row in zip(*bench, strict=True)]
    file.write_text("\n".join(["rudder_deg,speed_rpm,force_N", *rows]))
    for read, mine in zip(read_fan_bench(file), bench, strict=True):
        assert (read == mine).all()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("rudder_deg,speed,force_N\n0,3000,0.1\n", "no column 'speed_rpm'; did you mean 'speed'"),
        ("rudder_deg,speed_rpm,force_N\n0,3000,\n0,4000,0.2\n", "line 2, column 'force_N'"),
        ("rudder_deg,speed_rpm,force_N\n0,3000,x\n", "line 2.*force_N"),
    ],
)
def test_wrong_columns_and_cells_are_named(tmp_path, content, said):
    file = tmp_path / "bench.csv"
    file.write_text(content)
    with pytest.raises(InputError, match=said) as error:
        read_fan_bench(file)
    assert "bench.csv" in str(error.value) and "\n" not in str(error.value)


def falling_bench():
    rudder, speed, force = fan_bench()
    return rudder, speed, np.where((rudder == 10) & (speed > 0), 2.0 - force, force)


def only(rudder, speed, force, chosen):
    return rudder[chosen], speed[chosen], force[chosen]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: thrust_table_from_bench(*falling_bench()), "bench: rudder 10 deg: expected a thrust that"),
        (
            lambda: thrust_table_from_bench(*only(*fan_bench(), fan_bench()[0] != 0)),
            "bench: expected forward thrust at rudder 0",
        ),
        (
            lambda: thrust_table_from_bench(*only(*fan_bench(), fan_bench()[1] > 0)),
            "reverse thrust: expected 5 or more measurements at 4 or more different speeds, found 0 at 0",
        ),
        (lambda: fit_thrust([3000, 4000, 4000, 4000], [0.1, 0.2, 0.2, 0.2]), "found 4 at 2"),
        (lambda: fit_thrust([3000, 4000], [0.1]), r"columns of one length, found shapes \(2,\), \(1,\)"),
        (
            lambda: fit_rudder([1, 2, np.nan], [1, 2, 3]),
            "column 1, row 3: expected a finite number, found nan",
        ),
        (lambda: mean_inertia([0.096]), "expected 2 or more measurements"),
        (
            lambda: fit_inertia([0, 1, 2], [0, 1, 2], side_force=0.3, arm=0.32),
            "expected a yaw acceleration of",
        ),
        (lambda: fit_inertia([0, 1, 2], [0, 1, 2], side_force=0.0, arm=0.32), "expected a force and an arm"),
        (lambda: fit_rudder(ANGLES, ANGLES**2).intervals(95), "level must be between 0 and 1, found 95"),
    ],
)
def test_a_bench_that_cannot_tell_is_refused_in_one_line(make, said):
    with pytest.raises(InputError, match=said) as error:
        make()
    assert "\n" not in str(error.value)


# ---- pictures ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("bench", BENCHES)
def test_pictures_show_the_data_and_what_is_left_with_units(bench):
    fit, _ = bench(np.random.default_rng(0))
    above, below = fit.plot().axes
    assert above.lines[0].get_ydata() == pytest.approx(fit.y)
    assert below.lines[-1].get_ydata() == pytest.approx(fit.y - fit.fitted)
    assert below.get_xlabel() == str(fit.x_axis)
    assert below.get_ylabel().startswith("residual")
    assert fit.x_axis.unit in below.get_xlabel()


def test_the_picture_of_a_fan_has_a_curve_for_each_rudder_angle():
    above, below = thrust_table_from_bench(*fan_bench(0.01)).plot().axes
    assert len(above.get_legend().get_texts()) == 14
    assert (below.get_xlabel(), below.get_ylabel()) == ("speed [RPM]", "residual [N]")


# ---- a real fan -------------------------------------------------------------------------------------


@pytest.mark.skipif(not DATA.is_dir(), reason=f"measured data not at {DATA}")
def test_the_thrust_of_a_real_fan_is_nearly_quadratic_in_its_command():
    """Trials of the bench differ by about 0.2 gram-force: the quadratic leaves no more than that."""
    bench = BenchTable.from_csv(DATA / "thrust_bench.csv")
    fit = fit_thrust(bench.command, bench.thrust, unit="us")
    assert fit.sigma < 0.2e-3 * 9.80665 / 2
    assert fit.coefficients()["a"] > 5 * fit.std[0]  # it curves upwards, beyond doubt
    assert fit.fitted == pytest.approx(bench.thrust, abs=4 * fit.sigma)
    assert (str(fit.x_axis), str(fit.y_axis)) == ("command [us]", "thrust [N]")
