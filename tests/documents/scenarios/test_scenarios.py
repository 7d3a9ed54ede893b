"""The shipped scenarios give what the paper reports, and a wrong scenario file is refused with its key."""

import dataclasses

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.documents.scenarios import load_scenario, run_scenario, scenario_names
from hovercontrol.documents.scenarios.definition import Phase
from hovercontrol.documents.scenarios.figures import figures
from hovercontrol.documents.scenarios.runner import loop_parts, phase_grid
from hovercontrol.logs import read_log


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


@pytest.mark.slow
def test_which_estimates_are_slowest_hangs_on_what_else_is_estimated(table1):
    """C17 section VIII-A: zeta_3 and zeta_4 are slower. So they are where zeta_7 and zeta_8 are known."""
    base = load_scenario("table1")
    drag = base.controller["adapt"]
    first, second, _ = base.phases
    given = {**base.estimator, "estimate": drag, "Q": base.estimator["Q"][:9]}
    phases = (first, dataclasses.replace(second, until=25.0))
    known = run_scenario(dataclasses.replace(base, estimator=given, phases=phases, metrics=()))

    def errors(run):
        row = np.searchsorted(run.time, 25.0 - 1e-9)
        return {name: abs(run.estimates()[name][row] - run.truth()[name][row]) for name in drag}

    six, eight = errors(known), errors(table1)
    slow = ("sway_coulomb", "sway_linear_drag")
    assert min(six[n] for n in slow) > 10 * max(six[n] for n in drag if n not in slow)
    assert max(eight, key=eight.get) == "surge_coulomb" and eight["surge_coulomb"] > 2 * eight["sway_coulomb"]


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


@pytest.mark.slow
def test_a_sampled_run_repeats_with_its_seed_and_differs_with_another(table2):
    short = dataclasses.replace(load_scenario("table2"), phases=(Phase("short", 1.0),), metrics=())
    other = dataclasses.replace(short, sampling=dataclasses.replace(short.sampling, seed=2))
    a, b, c = (run_scenario(s).columns["x"] for s in (short, short, other))
    assert (a == b).all() and (a != c).any()


@pytest.mark.slow
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
    assert sorted(p.name for p in (tmp_path / "out").glob("[!.]*")) == sorted(f.name for f in files)
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

CIRCLE = 'kind = "circle"\nradius = 2.0'
PHASE = "[[phase]]\nuntil = 0.1"
DRIVEN = GOOD[GOOD.index("vehicle") : GOOD.index("[[phase]]")]
PLAYED = (
    "vehicle = 'c17_experiment'\n[commands]\ntime = [0.0, 0.05]\nthrust = [1.0, 0.0]\nrudder = [0.0, 0.1]\n"
)


def estimator(controller, content="R = 1e-5"):
    """More lines of [controller], then an [estimator]."""
    return f"{controller}\n[estimator]\n{content}\n[[phase]]"


def sampling(content):
    return f"[sampling]\nmeasurement = 0.01\n{content}\n[[phase]]"


def metric(start, end, of="tracking_error"):
    return f"{PHASE}\n[[metric]]\nname = 'm'\nof = '{of}'\nfrom = {start}\nto = {end}\n"


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
        ("radius = 2.0", 'radius = "a"', "circle: radius: expected a number, found 'a'"),
        ("radius = 2.0", "radius = [1]", "circle: radius: expected a number, found [1]"),
        ("radius = 2.0", "radius = -1", "reference: radius must be positive, found -1"),
        ('"circle"', '["a"]', "reference.kind must be text, found ['a']"),
        (CIRCLE, 'kind = "line"\nvelocity = 3', "line: velocity: expected 2 values, each a number, found 3"),
        (CIRCLE, 'kind = "waypoints"\npoints = "a"\ntimes = [0, 1]', "points: expected numbers, found 'a'"),
        ("[[phase]]", estimator("adapt = [1]"), "controller.adapt must be a list of text, found [1]"),
        (
            "[[phase]]",
            estimator("adapt = 'thrust'"),
            "controller.adapt must be a list of text, found 'thrust'",
        ),
        ("[[phase]]", estimator("", "estimate = 'thrust'"), "estimator.estimate must be a list of text"),
        (
            "[[phase]]",
            estimator("", "estimate = [2]"),
            "estimator.estimate must be a list of text, found [2]",
        ),
        (
            "[[phase]]",
            estimator("adapt = ['yaw_coulomb']", "estimate = ['sway_coulomb']"),
            "controller.adapt: 'yaw_coulomb' is not in estimator.estimate",
        ),
        (
            "[[phase]]",
            estimator("", "Q = 'a'"),
            "estimator.Q must be a number or a list of numbers, found 'a'",
        ),
        (
            "[[phase]]",
            estimator("", "R = [[1, 2], [3]]"),
            "estimator.R must be a number or a list of numbers",
        ),
        ("[[phase]]", estimator("", "P0 = [true]"), "estimator.P0 must be a number or a list of numbers"),
        ("[[phase]]", sampling("seed = -7"), "sampling.seed must not be negative, found -7"),
        ("[[phase]]", sampling("seed = 1.5"), "sampling.seed must be a int, found 1.5"),
        ("[scenario]", "metric = [1]\n[scenario]", "metric 1 must be a table, found 1"),
        ("step = 0.01", "step = 1e-9", "scenario.step = 1e-09 s gives 1e+08 rows in 0.1 s, expected at most"),
        ("until = 0.1", "until = 1e300", "scenario.step = 0.01 s gives 1e+302 rows"),
        (
            "[[phase]]",
            "[sampling]\nmeasurement = 1e-9\n[[phase]]",
            "sampling.measurement = 1e-09 s gives 1e+08",
        ),
        ("[[phase]]", sampling("command = 1e-9"), "sampling.command = 1e-09 s gives 1e+08 rows"),
        (PHASE, metric(0, 0.2), "metric 'm': to = 0.2 is beyond the scenario's end at 0.1 s"),
        (PHASE, metric(0.08, 0.05), "metric 'm': from = 0.08 is later than to = 0.05"),
        (PHASE, metric(-1, 0.05), "metric 'm': from = -1 must not be negative"),
        (
            PHASE,
            metric(0.012, 0.018),
            "no sample between from = 0.012 and to = 0.018; there is one every 0.01 s",
        ),
        (
            PHASE,
            "[sampling]\nmeasurement = 0.06\n" + metric(0.09, 0.1),
            "no sample between from = 0.09 and to = 0.1; there is one every 0.06 s",
        ),
        (
            PHASE,
            metric(0, 0.1, "estimation_error"),
            "estimation_error needs an [estimator] and controller.adapt",
        ),
        (
            PHASE,
            estimator("", "").removesuffix("[[phase]]") + metric(0, 0.1, "estimation_error"),
            "estimation_error needs an [estimator] and controller.adapt",
        ),
        (DRIVEN + PHASE, PLAYED + metric(0, 0.1), "metric 'm': tracking_error needs a [controller]"),
        (
            DRIVEN,
            PLAYED.replace("0.1]", "9.0]"),
            "commands.rudder: expected values in [-0.4538, 0.4538] rad, found 9 at 0.05 s; in degrees?",
        ),
        (DRIVEN, PLAYED.replace("0.1]", "-0.5]"), "in [-0.4538, 0.4538] rad, found -0.5 at 0.05 s"),
        (DRIVEN, PLAYED.replace("0.0]", "inf]", 1), "commands.thrust: expected values in"),
        (DRIVEN, PLAYED.replace("rudder", "ruder"), "unknown command 'ruder'; did you mean 'rudder'?"),
        (DRIVEN, PLAYED.replace("time = [0.0, 0.05]", "time = 0.0"), "expected 1 values as in commands.time"),
        (DRIVEN, PLAYED.replace("time = [0.0, 0.05]", "time = []"), "expected 0 values as in commands.time"),
        (DRIVEN, PLAYED.split("time")[0] + "time = []\n", "commands.time must begin with 0 and increase"),
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


@pytest.mark.parametrize(
    "change", [(DRIVEN, PLAYED), (PHASE, metric(0.0996, 0.1)), (PHASE, metric(0.03, 0.03))]
)
def test_what_fits_together_is_not_refused(tmp_path, change):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(*change))
    run = run_scenario(load_scenario(path))
    assert run.time[-1] == 0.1 and all(np.isfinite(m.value) for m in run.metrics())


def test_a_metric_at_a_phases_end_between_two_steps_has_its_sample(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(PHASE, metric(0.105, 0.105).replace("until = 0.1", "until = 0.105")))
    (measured,) = run_scenario(load_scenario(path)).metrics()
    assert measured.value > 0


@pytest.mark.parametrize("name", ["my run1", "2nd1", "a-b.c", "plant", "größe"])
def test_a_scenario_file_may_have_any_name(tmp_path, name):
    path = tmp_path / f"{name}.toml"
    path.write_text(GOOD)
    run = run_scenario(load_scenario(path))
    assert run.scenario.name == name and run.log()["x"].shape == run.time.shape


@pytest.mark.parametrize("more", ["", "[sampling]\nmeasurement = 0.01\n"])
def test_an_error_while_running_names_the_file(tmp_path, more):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace("control_point = 0.2", "control_point = 0.2\nk1 = -1.0\n" + more))
    with pytest.raises(InputError) as refused:
        run_scenario(load_scenario(path))
    assert str(refused.value).startswith(f"{path}: controller: k1 must be positive, found -1")


def test_an_error_while_simulating_names_the_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace("[reference]", "[plant.start]\ny = 1e300\n[reference]"))
    with pytest.raises(InputError, match=r"mine\.toml: block 'loop': the simulation stops at t = 0 s"):
        run_scenario(load_scenario(path))


def test_a_scenario_changed_in_python_is_checked_and_named():
    short = dataclasses.replace(load_scenario("table1"), phases=(Phase("short", 1.0),))
    with pytest.raises(
        InputError, match=r"table1: metric 'error before .* is beyond the scenario's end at 1 s"
    ):
        run_scenario(short)


def test_the_reference_is_drawn_for_one_lap_and_both_starts_are_named(table1):
    (axes,) = figures(table1)["path"].axes
    lines = {line.get_label(): line for line in axes.lines}
    assert {"start of the reference", "start of the craft (control point)"} <= set(lines)
    x, y = lines["reference"].get_data()
    assert len(x) == pytest.approx(2 * np.pi / 0.01, abs=1.5)
    assert np.hypot(x[-1] - x[0], y[-1] - y[0]) < 0.02
    assert lines["start of the reference"].get_xydata()[0] == pytest.approx([0.0, 2.5])
    assert lines["start of the craft (control point)"].get_xydata()[0] == pytest.approx([0.2, 1.5])


def test_a_reference_that_does_not_close_is_drawn_whole(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(CIRCLE, 'kind = "line"\nvelocity = [0.3, 0.0]'))
    run = run_scenario(load_scenario(path))
    (axes,) = figures(run)["path"].axes
    (reference,) = [line for line in axes.lines if line.get_label() == "reference"]
    assert len(reference.get_xdata()) == len(run.time)


def test_pictures_say_in_words_what_they_show(table1):
    drawn = figures(table1)
    titles = {name: figure.get_suptitle() for name, figure in drawn.items()}
    assert titles["path"] == "C17 Table I: simulated loop with estimator - path"
    assert titles["tracking_error"].endswith(
        "\ntracking error (distance of the control point from the reference)"
    )
    assert all(title.count(":") == 1 for title in titles.values())
    for name, word in (("estimates", "estimate"), ("estimation_error", "error")):
        labels = [t.get_text() for a in drawn[name].axes for t in a.get_legend().get_texts()]
        assert {"thrust coefficient", "rudder_torque coefficient", "yaw_coulomb"} <= set(labels)
        assert [a.get_ylabel() for a in drawn[name].axes] == [
            f"{word} [{unit}]" for unit in ("m/s^2", "1/s", "rad/s^2", "m/s^2", "rad/s^2")
        ]  # drag by unit, then each actuator's own


def test_a_control_point_at_the_centre_of_percussion_is_refused():
    scenario = load_scenario("table1")
    bad = dataclasses.replace(
        scenario, controller={**scenario.controller, "control_point": 0.01 / (0.14 * 0.585)}
    )
    with pytest.raises(InputError, match="a dx = J/m"):
        run_scenario(bad)
