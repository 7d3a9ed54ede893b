"""K06's trials over many seeds: what the table says is what single runs of the scenarios say."""

import dataclasses
from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.documents.k06 import trial_bands
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.trials import run_trial, trial_metrics


@pytest.mark.slow
def test_a_trial_as_picture_table_and_words(tmp_path):
    told = []
    files = trial_bands.main(tmp_path, told.append, trial="k06-forward", runs=4)
    assert {f.name for f in files} == {f"k06_trials.{end}" for end in ("png", "svg", "csv", "txt")}
    assert told[-1] == 1.0
    table = pyarrow.csv.read_csv(tmp_path / "k06_trials.csv").to_pydict()
    assert table["figure"] == ["first at 1.1 m/s", "off 1.1 m/s from 8 s on"]
    for low, median, high in zip(table["least"], table["median"], table["largest"], strict=True):
        assert 0 < low < median < high
    assert {4 * share % 1 for share in table["share inside"]} == {0.0}
    assert "4 seeds" in (tmp_path / "k06_trials.txt").read_text()


@pytest.mark.slow
def test_its_values_are_those_of_single_runs():
    scenario = load_scenario("k06-real-turn")
    many = trial_metrics(scenario, runs=2)
    second = dataclasses.replace(scenario, autopilot=dataclasses.replace(scenario.autopilot, seed=2))
    for found in run_scenario(second).metrics():
        assert many[found.metric.name][1] == pytest.approx(found.value, rel=0.01)
        assert many[found.metric.name][0] != many[found.metric.name][1]


def test_every_figure_is_measured_by_metrics_of_its_scenario():
    for trial, figures in trial_bands.ASKED.items():
        known = {m.name for m in load_scenario(f"k06-real-{trial}").metrics}
        assert all(set(asked.metrics) <= known for asked in figures)


def test_of_several_metrics_the_worst_counts():
    asked = trial_bands.Asked(("a", "b"), 8.0, 12.0, "s", "at rest")
    assert trial_bands.Row("stop", asked, np.array([7.0, 9.0, np.inf, 12.0])).met == 0.5


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: trial_bands.main(Path("x"), trial="k06-forwad"),
            "unknown trial 'k06-forwad'; did you mean 'forward'",
        ),
        (lambda: run_trial(load_scenario("k06-turn")), "'k06-turn' is no trial of the real loop"),
        (lambda: run_trial(load_scenario("k06-real-turn"), runs=0), "runs must be at least 1, found 0"),
    ],
)
def test_wrong_input_is_one_line(call, said):
    with pytest.raises(InputError, match=said):
        call()
