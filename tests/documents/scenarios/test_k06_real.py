"""K06's real loop beside the ideal one: the thesis' figures over many seeds, logs, pictures, wrong files."""

import dataclasses
import importlib.util
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest

from hovercontrol.app.commands.simulate import _show_clipped
from hovercontrol.base.errors import InputError
from hovercontrol.control.autopilot import SWITCHES, Imperfections, seeds
from hovercontrol.craft.hardware.actuators import fan_force, fan_tables
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.budget import Budget, Cost, budget
from hovercontrol.documents.scenarios.figures import figures
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.real import real_loop
from hovercontrol.documents.scenarios.real_figures import comparison
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log, read_log

SEEDS = 15
SCRIPT = Path(__file__).parents[3] / "analyses" / "k06_budget.py"


@cache
def flown(trial):
    """Run a trial with many seeds: the times, and true outputs of shape (seeds, times)."""
    scenario = load_scenario(f"k06-real-{trial}")
    block = real_loop(scenario, loop_parts(scenario))
    told = phase_parameters(scenario, scenario.phases[0])
    times = np.arange(round(scenario.end / 0.02) + 1) * 0.02
    every = []
    for seed in range(1, SEEDS + 1):
        params = told | {f"ideal.{k}": v for k, v in told.items()} | dict.fromkeys(seeds(block, 1), seed)
        run = block.compile().simulate(times, params=params, method="rk4", step=0.02)
        every.append(np.asarray(run.outputs))
    return times, dict(zip(run.output_labels, np.swapaxes(every, 0, 1), strict=True))


def first(times, met):
    return np.where(met.any(axis=1), times[np.argmax(met, axis=1)], np.inf)


def settled(times, met):
    """From when on it is so for good."""
    late = met.shape[1] - np.argmin(met[:, ::-1], axis=1)
    return np.where(met.all(axis=1), 0.0, np.append(times, np.inf)[late])


@pytest.mark.slow
def test_the_real_loop_brings_the_craft_to_rest_some_seconds_later_than_the_ideal_one():
    t, c = flown("stop")
    real, ideal = (settled(t, np.abs(c[name]) < 0.3) for name in ("r", "ideal_r"))
    assert 6.0 < np.median(real) < 12.0  # K06 about 10 s, with more noise: figure 6.7
    assert 2.0 < np.median(real - ideal) < 6.5  # "only 5 seconds longer"
    assert np.abs(c["u"]).max() > 2 * np.abs(c["ideal_u"]).max()  # "large overshoot"


@pytest.mark.slow
def test_forward_flight_reaches_its_speed_in_about_5_s_and_swings_about_it():
    t, c = flown("forward")
    assert 4.0 < np.median(first(t, c["u"] >= 1.0)) < 6.0
    late = t > 8.0
    assert np.median(np.abs(c["u"][:, late] - 1.1).max(axis=1)) < 0.2
    assert np.abs(c["v"][:, late].mean()) < 0.02 and np.abs(c["r"][:, late].mean()) < 0.02
    assert 0.05 < np.median(np.abs(c["v"][:, late]).max(axis=1)) < 0.25  # the axes of figure 6.8
    assert 0.1 < np.median(np.abs(c["r"][:, late]).max(axis=1)) < 0.5
    assert (np.diff(c["ideal_u"]) > 0).all()


@pytest.mark.slow
def test_reverse_flight_reaches_its_speed_in_about_5_s():
    t, c = flown("reverse")
    assert 4.0 < np.median(first(t, c["u"] <= -0.71)) < 6.0
    assert c["u"][:, t > 8.0].mean() == pytest.approx(-0.76, abs=0.05)
    assert np.abs(c["r"][:, t > 8.0]).max() < 0.5


@pytest.mark.slow
def test_the_turn_holds_3_rad_s_in_the_mean():
    t, c = flown("turn")
    late = t > 8.0
    assert np.abs(c["r"][:, late].mean(axis=1) - 3.0).max() < 0.12
    assert np.median(c["r"][:, late].mean(axis=1)) == pytest.approx(3.0, abs=0.05)
    assert np.ptp(c["r"][:, late], axis=1).min() > 0.1 > np.ptp(c["ideal_r"][:, t > 18.0], axis=1).max()


# ---- one run ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def heading():
    return run_scenario(load_scenario("k06-real-heading-bangbang"))


@pytest.mark.slow
def test_the_heading_trial_meets_its_figures(heading):
    assert [(m.metric.name, m.value) for m in heading.metrics() if not m.met] == []


@pytest.mark.slow
@pytest.mark.parametrize("law", ["bangbang", "proportional"])
def test_from_rest_both_laws_come_within_the_pointing_tolerance(law):
    found = run_scenario(load_scenario(f"k06-real-heading-{law}-rest")).metrics()
    assert len(found) == 3 and [(m.metric.name, m.value) for m in found if not m.met] == []


@pytest.mark.slow
def test_the_log_is_that_of_the_navigation(heading, tmp_path):
    heading.save(tmp_path)
    log = read_log(tmp_path / "log.csv", inputs=("thrust", "rudder"))
    assert log.has("x", "y", "psi", "u", "v", "r", "thrust", "rudder")
    for name in "uvr":
        assert 1e-3 < np.std(log[name] - log[f"true_{name}"]) < 0.2
    assert (tmp_path / "comparison.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_picture_shows_reference_real_and_ideal(heading):
    drawn = figures(heading)["comparison"]
    assert [axes.get_ylabel().split()[-1] for axes in drawn.axes] == ["[m/s]", "[m/s]", "[rad/s]", "[deg]"]
    labels = [line.get_label() for line in drawn.axes[-1].lines]
    assert labels == ["real, by its INS", "real", "ideal", "reference"]
    turned = drawn.axes[-1].lines[1].get_ydata()
    assert np.nanmin(turned) >= 0.0 and np.nanmax(turned) < 360.0


def test_the_picture_of_a_field_trial_shows_the_simulation_in_place_of_the_ideal_loop(heading):
    later = dataclasses.replace(
        heading, columns=heading.columns | {"true_u": heading.columns["true_u"] + 1.0}
    )
    lines = comparison(heading, later).axes[0].lines
    assert [line.get_label() for line in lines] == ["real, by its INS", "real", "simulated"]
    assert lines[2].get_ydata() - lines[1].get_ydata() == pytest.approx(1.0)


# ---- the budget ----------------------------------------------------------------------------


@pytest.mark.slow
def test_ins_noise_dominates_in_forward_flight_and_the_actuators_in_the_turn():
    forward = budget(load_scenario("k06-real-forward"), runs=8)
    assert forward.ranking()[0] == "ins_noise"
    assert forward.share("INS errors") > 0.8 > forward.share("actuators") > forward.share("delays")
    assert forward.none.mean < 0.001 < forward.whole.mean
    assert set(forward.alone) - set(forward.without) == {"gyro_dynamics"}


@pytest.mark.slow
def test_the_budget_of_one_trial_as_picture_table_and_words(tmp_path):
    spec = importlib.util.spec_from_file_location("k06_budget", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    files = module.main(tmp_path, trial="k06-turn", runs=2)
    assert {f.name for f in files} == {f"k06_budget.{end}" for end in ("png", "svg", "csv", "txt")}
    table = pyarrow.csv.read_csv(tmp_path / "k06_budget.csv")
    assert set(SWITCHES) < set(table["imperfection"].to_pylist())
    assert "without actuators" in (tmp_path / "k06_budget.txt").read_text()
    with pytest.raises(InputError, match="unknown trial 'k06-trun'; did you mean 'turn'"):
        module.main(tmp_path, trial="k06-trun")


def test_shares_are_of_the_mean_square():
    all_, half = Cost(np.array([2.0, 2.0])), Cost(np.array([1.0, 1.0]))
    found = Budget("trial", all_, half, {"brake": half, "tables": all_}, {"brake": half})
    assert found.share("brake") == pytest.approx(0.75)
    assert found.ranking() == ["tables", "brake"]


def test_a_budget_wants_a_trial_of_the_real_loop():
    with pytest.raises(InputError, match="'k06-turn' is no trial of the real loop"):
        budget(load_scenario("k06-turn"))


# ---- files ----------------------------------------------------------------------------


@pytest.mark.parametrize("trial", ["stop", "forward", "reverse", "turn"])
def test_a_real_trial_is_that_of_its_ideal_one(trial):
    real, ideal = load_scenario(f"k06-real-{trial}"), load_scenario(f"k06-{trial}")
    assert (real.plant, real.start, real.controller, real.phases) == (
        ideal.plant, ideal.start, ideal.controller, ideal.phases,
    )  # fmt: skip


@pytest.mark.parametrize("trial", ["real-turn", "reverse", "lateral"])
def test_the_crafts_of_a_field_trial_and_its_hold_out_are_one(trial):
    one, other = (load_scenario(f"k06-field-{trial}{end}") for end in ("", "-holdout"))
    assert (one.plant, one.controller) == (other.plant, other.controller)
    assert one.plant != one.belief
    assert one.autopilot.seed != other.autopilot.seed


@pytest.mark.slow
def test_with_yaw_friction_the_real_loop_turns_as_the_thesis_craft_did():
    found = run_scenario(load_scenario("k06-field-real-turn")).metrics()
    assert len(found) == 3 and [(m.metric.name, m.value) for m in found if not m.met] == []


@pytest.fixture(scope="module")
def astern():
    return run_scenario(load_scenario("k06-field-reverse"))


@pytest.mark.slow
@pytest.mark.parametrize("trial", ["reverse", "lateral"])
def test_a_field_trial_flies_ahead_astern_and_round_as_told_and_stops_between(trial, request):
    run = (
        request.getfixturevalue("astern")
        if trial == "reverse"
        else run_scenario(load_scenario("k06-field-lateral"))
    )
    assert [(m.metric.name, m.value) for m in run.metrics() if not m.met] == []
    u, begin = run.columns["true_u"], 0.0
    for phase in run.scenario.phases:
        inside = (run.time >= begin) & (run.time < phase.until)
        for told in ("surge_ref", "yaw_rate_ref"):  # nothing said: nothing wanted, whatever came before
            assert (run.columns[told][inside] == phase.setpoints.get(told, 0.0)).all()
        if not phase.setpoints and abs(u[inside][0]) > 0.3:
            assert abs(u[inside][-1]) < 0.5 * abs(u[inside][0])
        begin = phase.until


@pytest.mark.slow
@pytest.mark.parametrize("trial", ["stop", "forward", "heading-bangbang", "heading-proportional"])
def test_the_yaw_friction_of_figure_6_24_gives_what_the_other_field_trials_showed(trial):
    field = load_scenario(f"k06-field-{trial}")
    assert field.plant == load_scenario("k06-field-real-turn").plant
    run = run_scenario(field)
    assert [(m.metric.name, m.value) for m in run.metrics() if not m.met] == []
    if trial == "stop":  # "faster than predicted by the simulation"
        t, c = flown("stop")
        assert run.metrics()[0].value < settled(t, np.abs(c["r"]) < 0.3).min()


@pytest.mark.slow
def test_diagnose_names_the_loss_of_reverse_thrust_in_the_log_of_the_crafts_navigation(astern):
    scenario, early = astern.scenario, astern.time < 15.0
    log = Log("astern", astern.time[early], {key: column[early] for key, column in astern.columns.items()})
    found = diagnose(scenario.belief, [log])
    # ambiguous is whether the 3 ms of the last sample's age are a delay or a lag, not the loss
    assert found.verdict in ("effect", "partial", "ambiguous")
    loss = found.effects[0]
    assert {e.effect for e in found.effects} - {"input_delay", "time_offset", "thrust_lag"} == {
        "reverse_thrust_loss"
    }
    assert loss.value == pytest.approx(scenario.plant.effect("reverse_thrust_loss").values["value"], rel=0.1)
    for late in found.effects[1:]:  # a row holds the last sample of an IMU of 6.5536 ms
        assert 0.001 < late.value < 0.0066


TURN = "set = { yaw_rate_ref = 3.0 }\n"
GOOD = """
[scenario]
step = 0.02
[plant]
vehicle = "hoverdemon"
[controller]
kind = "turn"
k1 = 0.5
k2 = 3.5
[autopilot]
brake = false
[[phase]]
until = 0.1
"""


CRICKET = 'navigation = "cricket"\n'


def test_a_user_switches_imperfections_off_in_the_file(tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD)
    found = load_scenario(tmp_path / "mine.toml").autopilot
    assert found.imperfections == Imperfections().without("brake")


@pytest.mark.slow
def test_a_users_tables_and_beacons_come_from_files_beside_the_scenario(tmp_path):
    weak = fan_tables(lambda speed, rudder: 0.5 * fan_force(speed, rudder))
    weak[1].to_csv(tmp_path / "fan.csv")
    (tmp_path / "servo.csv").write_text("pulse_ms,angle_deg\n1.0,-10\n2.0,10\n")
    own = 'fan_table = "fan.csv"\nservo_table = "servo.csv"\ntables = true\n'
    (tmp_path / "mine.toml").write_text(GOOD.replace("brake = false", own).replace("0.1", "1.0") + TURN)
    run = run_scenario(load_scenario(tmp_path / "mine.toml"))
    assert 0.5 < np.abs(run.columns["thrust"]).max() < 0.55 * fan_force(12000.0)
    assert np.abs(run.columns["rudder"]).max() == pytest.approx(np.radians(10.566 / 1.4), abs=1e-6)
    assert run.clipped()["rudder_clipped"] > 100
    run.save(tmp_path / "out")
    assert read_log(tmp_path / "out" / "log.csv")["rudder_clipped"][-1] == run.clipped()["rudder_clipped"]
    navigation = 'navigation = "cricket"\nbeacons = [[-1, -1, 2.0], [3, -1, 2.0], [1, 3, 2.5]]'
    (tmp_path / "mine.toml").write_text(GOOD.replace("brake = false", navigation))
    beacons = load_scenario(tmp_path / "mine.toml").autopilot.beacons
    assert beacons.positions[1] == (3.0, -1.0) and beacons.heights == (2.0, 2.0, 2.5)


@pytest.mark.slow
def test_simulate_says_how_often_commands_were_clipped(tmp_path, capsys):
    calm = GOOD.replace('kind = "turn"', 'kind = "stop"').replace("brake", "ins_noise = false\nbrake")
    for name, text, said in (("turn", GOOD + TURN, True), ("calm", calm, False)):
        (tmp_path / f"{name}.toml").write_text(text)
        scenario = load_scenario(tmp_path / f"{name}.toml")
        run = run_scenario(scenario)
        assert any(run.clipped().values()) == said
        _show_clipped(run)
        told = capsys.readouterr().out
        assert ("of 101 ticks" in told and "rudder_clipped at " in told) == said
        assert len(told.splitlines()) == said


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("brake = false", 'tables = "mine.csv"', "autopilot.tables must be a bool, found 'mine.csv'"),
        ("brake = false", 'fan_table = "no.csv"', "no.csv: not readable as CSV"),
        ("brake = false", "fan_table = 3", "autopilot.fan_table must be the name of a file, or of two"),
        ("brake = false", 'servo_table = "no.csv"', "no.csv: not readable as CSV"),
        (
            "brake = false",
            "beacons = [[0, 0, 2], [1, 0, 2]]",
            "belong to navigation 'cricket', found 'magneto",
        ),
        (
            "brake = false",
            CRICKET + "beacons = [[0, 0]]",
            "autopilot.beacons must be a list of [x, y, height]",
        ),
        ("brake = false", CRICKET + "beacons = [[0, 0, 'a']]", "autopilot.beacons 1 must be a number"),
        (
            "brake = false",
            CRICKET + "beacons = [[0, 0, 2], [1, 0, 2], [2, 0, 2]]",
            "autopilot.beacons: beacons: expected positions that are not in a line",
        ),
        ("brake = false", "brakes = false", "unknown key in autopilot 'brakes'; did you mean 'brake'?"),
        ("brake = false", "brake = 0.1", "autopilot.brake must be a bool, found 0.1"),
        ("brake = false", 'navigation = "criket"', "did you mean 'cricket'?"),
        ("brake = false", "seed = -1", "autopilot.seed must be between 0 and"),
        (
            "brake = false",
            'propeller = "variable pitch"',
            "unknown 'variable pitch'; did you mean 'variable_pitch'",
        ),
        ("brake = false", "rudder_loss = 1.5", "autopilot.rudder_loss must be at least 0 and less than 1"),
        ("[autopilot]", "[sampling]\nmeasurement = 0.02\n[autopilot]", "[sampling] and [autopilot] exclude"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        load_scenario(path)
    assert said in str(refused.value) and "mine.toml" in str(refused.value)
    assert "\n" not in str(refused.value)
