"""K06's trials as scenarios: what the thesis reports, the field trial's friction, and wrong files."""

import dataclasses
from importlib import resources

import numpy as np
import pytest

from hovercontrol.app.commands.exportable import choose
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.effects import effect
from hovercontrol.documents.scenarios import load_scenario, run_scenario, scenario_names
from hovercontrol.documents.scenarios.definition import Phase
from hovercontrol.documents.scenarios.figures import figures
from hovercontrol.logs import read_log

SCENARIOS = resources.files("hovercontrol.documents.scenarios")
K06 = [
    n
    for n in scenario_names()
    if n[:4] == "k06-" and "[autopilot]" not in (SCENARIOS / f"{n}.toml").read_text()
]
M, J, D = 2.6, 0.096, 0.32


class Runs(dict):
    """Each scenario's run, made when a test first asks for it."""

    def __missing__(self, name):
        self[name] = run_scenario(load_scenario(name))
        return self[name]


@pytest.fixture(scope="module")
def runs():
    return Runs()


@pytest.mark.parametrize("name", K06)
def test_the_run_gives_what_the_thesis_reports(runs, name):
    assert [(m.metric.name, m.value) for m in runs[name].metrics() if not m.met] == []


def test_every_trial_of_the_thesis_is_there():
    trials = "stop forward reverse turn heading-bangbang heading-proportional origin field-turn field-holdout"
    assert {f"k06-{trial}" for trial in trials.split()} == set(K06)


def test_the_ideal_forward_run_converges_without_overshoot(runs):
    u = runs["k06-forward"].columns["u"]
    assert (np.diff(u) > 0).all() and u[-1] < 1.1


def test_the_turn_must_begin_with_a_step_aside(runs):
    c = runs["k06-turn"].columns
    assert c["v"].min() < -0.15 and c["force_y"][0] < 0  # it pushes its stern to starboard


def test_the_bang_bang_heading_has_no_steady_error_and_the_proportional_one_has(runs):
    late = runs["k06-heading-bangbang"].time > 25
    worst = {
        name: np.degrees(np.abs(runs[f"k06-heading-{name}"].columns["heading_error"][late])).max()
        for name in ("bangbang", "proportional")
    }
    assert worst["bangbang"] < 1.02 < 2.0 < worst["proportional"]


def test_the_second_heading_trial_goes_alike():
    """From rest to 1 rad (figure 6.12): both laws get there, the proportional one not all the way."""
    worst = {}
    for name in ("bangbang", "proportional"):
        trial = load_scenario(f"k06-heading-{name}")
        trial = dataclasses.replace(
            trial, start={}, phases=(Phase("turn", 12.0, setpoints={"heading_ref": 1.0}),), metrics=()
        )
        run = run_scenario(trial)
        worst[name] = np.degrees(np.abs(run.columns["heading_error"][run.time > 10])).max()
    assert worst["bangbang"] < 1.1 < 2.0 < worst["proportional"] < 6.0


# ---- the field trial -------------------------------------------------------------------------------


def test_the_field_trials_friction_follows_from_the_steady_turn_at_1_75(runs):
    """u' = v' = r' = 0 at r = 1.75 under (2.39) with table 6.4's gains gives the friction by hand."""
    k1, k2, r, told = 0.5, 3.5, 1.75, 3.0
    side = k2 * D * (r - told) / (1 + k2 * k1 / (M * r) ** 2)  # F_Y, with v = k1 F_Y/(m r)^2
    assert side == pytest.approx(-1.29, abs=0.005)
    assert load_scenario("k06-field-turn").plant.coefficients()["yaw_linear_drag"] == pytest.approx(
        -D * side / J / r, rel=1e-3
    )
    run = runs["k06-field-turn"]
    steady = (run.time > 18) & (run.time < 24)
    assert run.columns["true_r"][steady].mean() == pytest.approx(r, abs=0.02)
    assert run.columns["true_u"][steady].mean() == pytest.approx(side / (M * r), abs=0.02)
    assert run.columns["true_v"][steady].mean() == pytest.approx(k1 * side / (M * r) ** 2, abs=0.005)


def test_dry_friction_of_that_size_would_have_stopped_the_craft_at_the_unwanted_limit_point():
    trial = load_scenario("k06-turn")
    stiff = dataclasses.replace(
        trial, plant=trial.belief.with_effects([effect("yaw_coulomb", 4.3)]), metrics=()
    )
    c = run_scenario(stiff).columns
    assert abs(c["r"][-1]) < 0.05
    assert c["v"][-1] == pytest.approx(-D * 3.0, abs=0.05)


def test_a_phase_without_set_points_stops_the_craft(runs):
    run = runs["k06-field-turn"]
    told = run.columns["yaw_rate_ref"]
    assert set(np.unique(told)) == {-4.0, -3.0, 0.0, 2.0, 3.0}
    assert (told[(run.time >= 24.0) & (run.time < 30.0)] == 0.0).all()
    assert np.abs(run.columns["true_r"][(run.time > 28) & (run.time < 30)]).max() < 0.2


@pytest.mark.slow
def test_the_field_log_is_a_standard_log_with_the_noise_it_states(runs, tmp_path):
    run = runs["k06-field-turn"]
    run.save(tmp_path)
    log = read_log(tmp_path / "log.csv", inputs=("thrust", "rudder"))
    assert log.has("x", "y", "psi", "u", "v", "r", "thrust", "rudder")
    sampling = load_scenario("k06-field-turn").sampling
    for channels, noise in (
        ("xy", sampling.position_noise),
        (("psi",), sampling.heading_noise),
        ("uv", sampling.velocity_noise),
        ("r", sampling.rate_noise),
    ):
        for channel in channels:
            assert np.std(log[channel] - log[f"true_{channel}"]) == pytest.approx(noise, rel=0.06)


def test_the_hold_out_craft_is_the_same_and_its_noise_another():
    trial, other = load_scenario("k06-field-turn"), load_scenario("k06-field-holdout")
    assert (trial.plant, trial.controller) == (other.plant, other.controller)
    assert trial.sampling.seed != other.sampling.seed
    assert [p.setpoints for p in trial.phases] != [p.setpoints for p in other.phases]


# ---- logs, pictures, exports -------------------------------------------------------------------------


def test_rows_are_logged_at_their_own_period(runs):
    run = runs["k06-heading-bangbang"]
    assert run.time == pytest.approx(np.arange(3501) * 0.01)
    assert {"heading_mode", "heading_error", "yaw_rate_ref", "force_x"} <= set(run.columns)


def test_pictures_show_wanted_values_forces_heading_and_modes(runs):
    drawn = figures(runs["k06-origin"])
    assert {"path", "velocities", "forces", "heading", "modes", "thrust", "rudder"} == set(drawn)
    steps, turning = drawn["modes"].axes
    assert [t.get_text() for t in steps.get_yticklabels()] == ["point", "drive", "halt", "orient", "rest"]
    assert [t.get_text() for t in turning.get_yticklabels()] == ["stop", "turn"]
    assert "goal" in [line.get_label() for line in drawn["path"].axes[0].lines]
    assert set(figures(runs["k06-turn"])) == {"path", "velocities", "forces", "thrust", "rudder"}
    yaw = figures(runs["k06-turn"])["velocities"].axes[2]
    assert [t.get_text() for t in yaw.get_legend().get_texts()] == ["wanted", "craft"]


def test_the_whole_loop_can_be_chosen_for_export_and_is_the_same_loop(runs):
    chosen = choose("k06-turn")
    run = simulate(chosen.block, runs["k06-turn"].time)
    assert run.states[5] == pytest.approx(runs["k06-turn"].columns["r"], abs=1e-4)


# ---- wrong files -----------------------------------------------------------------------------------------

GOOD = """
[scenario]
step = 0.01
[plant]
vehicle = "hoverdemon"
[controller]
kind = "turn"
k1 = 0.5
k2 = 3.5
[[phase]]
until = 0.1
set = { yaw_rate_ref = 3.0 }
"""

GUIDED = "[guidance]\nkind = 'heading_bang_bang'\n[sampling]\nmeasurement = 0.01\n[controller]"


def metric(of, more=""):
    lines = f"[[metric]]\nname = 'm'\nof = '{of}'\nfrom = 0.0\nto = 0.1\n{more}"
    return f"until = 0.1\n{lines}[[phase]]\nuntil = 0.2"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"turn"', '"trun"', "controller.kind: unknown 'trun'; did you mean 'turn'?"),
        ("k2 = 3.5", "", "controller: 'k2' is missing"),
        ("k2 = 3.5", "k2 = 3.5\nalpha = 1.0", "unknown key in controller 'alpha'"),
        ("k2 = 3.5", "k2 = 0.0", "controller: k2 must be positive, found 0"),
        (
            "yaw_rate_ref",
            "yaw_rat_ref",
            "unknown set point 'yaw_rat_ref'; did you mean 'yaw_rate_ref'?",
        ),
        ('"turn"', '"reverse"\nalpha = 1.44', "unknown set point 'yaw_rate_ref'; known: surge_ref"),
        ("yaw_rate_ref = 3.0", 'yaw_rate_ref = "fast"', "phase 1.set.yaw_rate_ref must be a number"),
        ("[controller]", "[body]\nmass = 2.6\n[controller]", "body: 'inertia' is missing"),
        ("[controller]", "[body]\nmass = 0.0\ninertia = 1.0\narm = 1.0\n[controller]", "body: mass must be"),
        ("[controller]", "[reference]\nkind = 'circle'\n[controller]", "[reference] is not used by"),
        ("[controller]", "[actuation]\ndead_zone = -0.1\n[controller]", "dead_zone must not be negative"),
        (
            "[controller]",
            "[guidance]\nkind = 'origin'\n[controller]",
            "[guidance] is sampled: expected a [sampling]",
        ),
        ("[controller]", GUIDED.replace("bang_bang", "bangbang"), "did you mean 'heading_bang_bang'?"),
        ("[controller]", GUIDED, "unknown set point 'yaw_rate_ref'; known: heading_ref"),
        ("[plant]", "[plant]\neffects = { yaw_drag = 1.0 }", "unknown effect 'yaw_drag'"),
        ("until = 0.1", metric("yaw"), "metric 'm': unknown quantity 'yaw'"),
        ("until = 0.1", metric("tracking_error"), "tracking_error needs a [controller]"),
        ("until = 0.1", metric("r", "statistic = 'median'\n"), "unknown statistic 'median'"),
        (
            "until = 0.1",
            metric("r", "statistic = 'settled'\n"),
            "'target' is missing for statistic = 'settled'",
        ),
        (
            "[controller]",
            "[sampling]\nmeasurement = 0.02\nlog = 0.03\n[controller]",
            "sampling.log = 0.03 s: expected a multiple of sampling.measurement = 0.02 s",
        ),
        (
            "[controller]",
            "[sampling]\nmeasurement = 0.01\nrate_noise = -1.0\n[controller]",
            "must not be negative",
        ),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        load_scenario(path)
    assert said in str(refused.value) and "mine.toml" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_reverse_law_told_to_go_forward_is_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        GOOD.replace('"turn"', '"reverse"\nalpha = 1.44').replace("yaw_rate_ref = 3.0", "surge_ref = 0.5")
    )
    with pytest.raises(InputError, match=r"set\.surge_ref = 0\.5 m/s is out of its bounds \[-inf, 0\]"):
        load_scenario(path)


def test_guidance_that_drives_astern_wants_a_law_that_does(tmp_path):
    path = tmp_path / "mine.toml"
    guided = "[guidance]\nkind = 'origin'\nreverse_surge = 0.4\n[sampling]\nmeasurement = 0.01\n[controller]"
    path.write_text(
        GOOD.replace("[controller]", guided)
        .replace('"turn"', '"drive"')
        .replace("yaw_rate_ref", "goal_x_ref")
    )
    with pytest.raises(InputError, match=r"may send surge_ref down to -0\.4 m/s, .* both_ways takes both"):
        load_scenario(path)


def test_the_law_that_only_drives_ahead_is_told_so(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace('"turn"', '"drive"').replace("yaw_rate_ref = 3.0", "surge_ref = -0.76"))
    with pytest.raises(InputError, match=r"set\.surge_ref = -0\.76 m/s is out of its bounds \[0, inf\]"):
        load_scenario(path)


def test_a_user_may_state_another_body_and_a_dead_zone(tmp_path):
    path = tmp_path / "mine.toml"
    more = "[body]\nmass = 2.6\ninertia = 0.096\narm = 0.5\n[actuation]\ndead_zone = 0.05\n[controller]"
    path.write_text(GOOD.replace("[controller]", more))
    run = run_scenario(load_scenario(path))
    assert run.columns["force_y"][0] == pytest.approx(-3.5 * 0.5 * 3.0)
