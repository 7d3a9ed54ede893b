"""The scripts of K06's basins and margins leave pictures, tables and findings."""

import numpy as np
import pyarrow.csv
import pytest

from hovercontrol import InputError
from hovercontrol.documents.k06 import (
    delay,
    margins,
    particles,
    reverse_error,
    turn_basins_figure,
    variable_pitch,
)
from hovercontrol.documents.k06.reverse_error import SteadyError
from hovercontrol.documents.k06.variable_pitch import with_variable_pitch
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.trials import run_trial

SMALL = {
    "k06_turn_basins": (turn_basins_figure.main, {"points": 8}),
    "k06_margins": (margins.main, {"points": 4, "instants": 4}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_a_script_leaves_pictures_tables_and_findings(name, tmp_path):
    main, small = SMALL[name]
    told = []
    files = main(tmp_path, told.append, **small)
    assert [f.suffix for f in files].count(".csv") == 3
    assert {f.suffix for f in files} == {".png", ".svg", ".csv", ".txt"}
    assert told[-1] == pytest.approx(1.0)
    for file in files:
        assert file.stem.startswith(name)
        if file.suffix == ".csv":
            assert pyarrow.csv.read_csv(file).num_rows >= 4
    assert "nan" not in (tmp_path / f"{name}.txt").read_text().split()


@pytest.mark.slow
def test_the_delays_script_says_from_when_on_the_other_law_is_unstable(tmp_path):
    files = delay.main(tmp_path, points=9)
    assert {f.suffix for f in files} == {".csv", ".png", ".svg", ".txt"}
    assert "300 ms: the law without the delay is unstable from" in (tmp_path / "k06_delay.txt").read_text()


def test_the_pitch_script_sets_the_propellers_side_by_side(tmp_path, monkeypatch):
    time = np.arange(0.0, 25.0, 0.1)

    def driven(scenario, runs):
        own = scenario.autopilot
        size = 0.1 if own.propeller else 0.2 if own.imperfections.brake else 0.3
        return time, dict.fromkeys(("gap", "heading_error", "x"), np.full((runs, len(time)), size))

    monkeypatch.setattr(variable_pitch, "run_trial", driven)
    variable_pitch.main(tmp_path, trials=("halt", "heading-bangbang-rest"), runs=2)
    said = (tmp_path / "k06_variable_pitch.txt").read_text()
    assert "0.200, 0.300, 0.100 m/s; from 1.1 m/s it stands after 0.20, 0.30, 0.10 m" in said
    assert "11, 17, 6 deg" in said and "1.94 N either way" in said and "0.90 N astern" in said
    rows = pyarrow.csv.read_csv(tmp_path / "k06_variable_pitch.csv").to_pylist()
    assert [row["distance [m]"] for row in rows[:3]] == [0.2, 0.3, 0.1] and len(rows) == 6


def test_the_reverse_scripts_verdict_is_that_of_both_findings(tmp_path, monkeypatch):
    def made(*, navigation, **given):
        zone = 0.08 if navigation == "magnetometer" else 0.02
        return [
            SteadyError(name, (np.array([a, a]), np.array([a, a])), np.array([b, b]), 0.1)
            for name, a, b in (("nothing", 0.01, 0.04), ("zone", zone, 0.0), ("drag", 0.09, -0.1))
        ]

    monkeypatch.setattr(reverse_error, "steady_errors", made)
    reverse_error.main(tmp_path, logged=())
    said = (tmp_path / "k06_reverse_error.txt").read_text()
    assert "With sensors and filters in full, both as K06 saw them: zone." in said
    assert "With K06's noise, both as K06 saw them: none of these." in said
    rows = pyarrow.csv.read_csv(tmp_path / "k06_reverse_error.csv").to_pylist()
    assert [row["mean error, reference -0.5 [m/s]"] for row in rows if row["suspect"] == "zone"] == [
        0.08,
        0.02,
    ]


@pytest.mark.slow
def test_a_variable_pitch_propeller_halts_the_craft_in_less_way():
    trials = [load_scenario(f"k06-real-halt{end}") for end in ("", "-pitch")]
    changed = with_variable_pitch(trials[0])
    assert changed.autopilot == trials[1].autopilot and not trials[0].autopilot.propeller
    way, push = [], []
    for trial in trials:
        _, driven = run_trial(trial, runs=3)
        way.append(driven["x"].max(axis=1).mean())
        push.append(driven["thrust"].min())
    assert way[1] < 0.7 * way[0]
    assert push == pytest.approx([-0.90, -1.94], abs=0.01)
    with pytest.raises(InputError, match="'k06-stop' is no trial of the real loop"):
        with_variable_pitch(load_scenario("k06-stop"))


@pytest.mark.slow
def test_the_particle_script_sets_both_filters_side_by_side(tmp_path):
    files = particles.main(tmp_path, runs=2, seconds=0.5, particles=200)
    assert {f.suffix for f in files} == {".csv", ".png", ".svg", ".txt"}
    table = pyarrow.csv.read_csv(tmp_path / "k06_particles.csv").to_pylist()
    assert len(table) == 8 and {row["filter"] for row in table} == {
        "extended Kalman filter",
        "particle filter",
    }
    said = (tmp_path / "k06_particles.txt").read_text()
    assert "two beacons, start unknown: extended Kalman filter" in said and "200 particles" in said
