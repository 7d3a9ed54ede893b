"""The shipped scenarios give what the paper reports, and a wrong scenario file is refused with its key."""

import dataclasses

import numpy as np
import pytest

from hovercontrol.errors import InputError
from hovercontrol.logs import read_log
from hovercontrol.scenarios import load_scenario, run_scenario, scenario_names
from hovercontrol.scenarios.definition import Phase
from hovercontrol.scenarios.runner import loop_parts, phase_grid


@pytest.fixture(scope="module")
def table1():
    return run_scenario(load_scenario("table1"))


@pytest.fixture(scope="module")
def table2():
    return run_scenario(load_scenario("table2"))


def test_table1_reproduces_the_papers_figures(table1):
    assert [m.metric.name for m in table1.metrics() if not m.met] == []
    error = table1.tracking_error()
    assert error[(table1.time > 25) & (table1.time < 30)].mean() == pytest.approx(0.610, abs=0.002)


def test_table1_plant_parameters_change_exactly_at_the_phase(table1):
    truth = table1.truth()["yaw_coulomb"]
    at = np.searchsorted(table1.time, 15.0)
    assert (truth[at - 1], truth[at]) == (0.83, 0.415)
    assert np.diff(table1.time).min() > 0


def test_sway_estimates_converge_slowest_as_the_paper_says(table1):
    """C17 section VIII-A: zeta_3 and zeta_4 are slower, the ellipse has little lateral variety."""
    late = (table1.time > 20) & (table1.time < 29.9)
    error = {
        name: np.abs(table1.estimates()[name] - table1.truth()[name])[late].mean()
        for name in ("sway_coulomb", "yaw_coulomb", "sway_linear_drag", "yaw_linear_drag")
    }
    assert error["sway_coulomb"] > 3 * error["yaw_coulomb"]
    assert error["sway_linear_drag"] > 3 * error["yaw_linear_drag"]


def test_table2_reproduces_the_papers_figures(table2):
    assert [m.metric.name for m in table2.metrics() if not m.met] == []


def test_table2_commands_are_held_between_their_ticks(table2):
    """Commands change only at multiples of 22.5 ms, seen at the 10 ms samples of the log."""
    thrust = table2.columns["thrust"]
    changes = table2.time[1:][np.diff(thrust) != 0]
    ticks = np.ceil(np.arange(0, 100, 0.0225) / 0.01 - 1e-9) * 0.01  # a tick shows at the next sample
    assert np.isin(np.round(changes, 6), np.round(ticks, 6)).all()
    assert np.abs(table2.columns["rudder"]).max() <= np.radians(26) + 1e-12
    assert thrust.min() >= 0 and thrust.max() <= 6.1


def test_table2_velocities_are_backward_differences_of_the_noisy_pose(table2):
    c, k = table2.columns, 1234
    dx, dy = c["x"][k] - c["x"][k - 1], c["y"][k] - c["y"][k - 1]
    surge = (np.cos(c["psi"][k]) * dx + np.sin(c["psi"][k]) * dy) / 0.01
    assert c["u"][k] == pytest.approx(surge, abs=1e-9)


def test_a_sampled_run_repeats_with_its_seed_and_differs_with_another(table2):
    short = dataclasses.replace(load_scenario("table2"), phases=(Phase("short", 1.0),), metrics=())
    other = dataclasses.replace(short, sampling=dataclasses.replace(short.sampling, seed=2))
    a, b, c = (run_scenario(s).columns["x"] for s in (short, short, other))
    assert (a == b).all() and (a != c).any()


def test_without_noise_and_with_fast_ticks_the_sampled_loop_is_the_continuous_one():
    base = load_scenario("table1")
    short = dataclasses.replace(base, phases=(Phase("short", 3.0),), metrics=(), step=0.01)
    sampling = dataclasses.replace(
        load_scenario("table2").sampling,
        measurement=0.001,
        command=0.001,
        position_noise=0.0,
        heading_noise=0.0,
    )
    fast = run_scenario(dataclasses.replace(short, sampling=sampling))
    smooth = run_scenario(short)
    ten = fast.columns["true_x"][::10]
    assert np.abs(ten - smooth.columns["x"]).max() < 5e-3


def test_the_saved_log_reads_back_and_nothing_else_is_left(tmp_path, table2):
    files = table2.save(tmp_path / "out")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(f.name for f in files)
    log = read_log(tmp_path / "out" / "log.csv", inputs=("thrust", "rudder"))
    np.testing.assert_allclose(log["psi"], table2.columns["psi"], atol=1e-9)
    assert {
        "path.png",
        "tracking_error.png",
        "estimates.png",
        "estimation_error.png",
        "velocities.png",
        "thrust.png",
        "rudder.png",
        "metrics.csv",
    } <= {f.name for f in files}


def test_phase_grids_meet_exactly():
    assert phase_grid(0.0, 0.05, 0.02).tolist() == [0.0, 0.02, 0.04, 0.05]
    assert phase_grid(0.05, 0.08, 0.02).tolist() == pytest.approx([0.05, 0.06, 0.08])


def test_every_shipped_scenario_loads_and_wires():
    assert {"table1", "table2", "sample"} <= set(scenario_names())
    for name in scenario_names():
        assert "plant" in loop_parts(load_scenario(name))


GOOD = """
[scenario]
step = 0.01
[plant]
vehicle = "c17_simulation"
[reference]
kind = "circle"
radius = 2.0
[controller]
control_point = 0.2
[[phase]]
until = 0.1
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("step = 0.01", "stop = 0.01", "unknown key in scenario 'stop'; did you mean 'step'?"),
        ("step = 0.01", "step = -1.0", "scenario.step must be positive, found -1.0"),
        ("step = 0.01", 'step = "fast"', "scenario.step must be a number, found 'fast'"),
        ("[plant]", "[plent]", "unknown section 'plent'; did you mean 'plant'?"),
        (
            "c17_simulation",
            "c17_simulatoin",
            "unknown vehicle 'c17_simulatoin'; did you mean 'c17_simulation'?",
        ),
        ('"circle"', '"circel"', "reference.kind: unknown 'circel'; did you mean 'circle'?"),
        ("radius = 2.0", "radios = 2.0", "unknown key in [reference] 'radios'; did you mean 'radius'?"),
        ("radius = 2.0", "", "reference: 'radius' is missing for kind = 'circle'"),
        ("until = 0.1", "until = -0.1", "phase 1: until = -0.1 must be later than 0"),
        (
            "until = 0.1",
            "until = 0.1\nscale = { surge_colomb = 0.5 }",
            "phase 1.scale: unknown coefficient 'surge_colomb'; did you mean 'surge_coulomb'?",
        ),
        ("until = 0.1", "until = 0.1\nadaptation = 2.0", "phase 1: adaptation = 2 is out of [0, 1]"),
        ("[controller]", "[commands]\ntime = [0.0]\n[controller]", "expected either [controller]"),
        ("[[phase]]\nuntil = 0.1", "", "expected one or more [[phase]] sections"),
        (
            "control_point = 0.2",
            "control_point = 0.2\nadapt = ['yaw_coulomb']",
            "controller.adapt needs an [estimator]",
        ),
        ("[plant]", "[plant", "not readable as TOML"),
        ("[plant]", "[plant]\ncoefficients = { yaw_coulomb = -1.0 }", "out of its bounds [0, inf]"),
    ],
)
def test_a_wrong_scenario_file_is_refused_with_file_and_key(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        load_scenario(path)
    assert said in str(refused.value) and "mine.toml" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_good_file_runs(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    assert run_scenario(load_scenario(path)).time[-1] == 0.1


def test_a_control_point_at_the_centre_of_percussion_is_refused():
    scenario = load_scenario("table1")
    bad = dataclasses.replace(
        scenario, controller={**scenario.controller, "control_point": 0.01 / (0.14 * 0.585)}
    )
    with pytest.raises(InputError, match="a dx = J/m"):
        run_scenario(bad)
