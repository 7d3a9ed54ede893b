"""The whole of ``hovercontrol identify``: on the sample log, and on real logs where they are at hand."""

import os
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.identify.study import Study
from hovercontrol.logs import BenchTable, Condition, gather, read_log
from hovercontrol.modelfile import load_model
from hovercontrol.samples import COLUMNS, make_sample, sample_path
from hovercontrol.scenarios import load_scenario
from hovercontrol.vehicles import vehicle

SHARED = Path(__file__).parents[3] / "shared" / "data"
DATA = Path(os.environ.get("HOVERCONTROL_DATA", SHARED)) / "real_hovercraft"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"real logs are not at {DATA}")


@pytest.fixture(scope="module")
def sample_study():
    log = read_log(sample_path(), inputs=("thrust", "rudder"))
    return Study.make(vehicle("c17_experiment"), [log.between(0, 28)], [log.between(28.02, 40)])


def test_the_sample_log_is_what_its_scenario_gives():
    shipped, made = read_log(sample_path(), inputs=COLUMNS[3:]), make_sample()
    for name in COLUMNS:
        np.testing.assert_allclose(shipped[name], made[name], atol=2e-6)


def test_the_sample_logs_coefficients_are_found_within_their_errors(sample_study):
    truth = load_scenario("sample").plant.coefficients()
    for c in sample_study.found.coefficients:
        assert c.excited
        assert abs(c.value - truth[c.name]) < 4 * c.std, c.name
        assert c.std < 0.02 * max(truth[c.name], 0.1), c.name
    assert sample_study.found.chi2_per_dof == pytest.approx(1.0, abs=0.15)


def test_the_identified_model_predicts_what_it_did_not_see(sample_study):
    held_out = sample_study.judged[-1]
    assert held_out.holdout
    assert held_out.prediction.nrmse["r"] < 0.03
    assert "held out" in sample_study.text()


def test_the_saved_model_is_the_identified_one(sample_study, tmp_path):
    files = {f.name for f in sample_study.save(tmp_path)}
    assert {"model.toml", "coefficients.csv", "prediction.csv", "rejected.csv"} <= files
    assert load_model(tmp_path / "model.toml") == sample_study.found.model
    assert sum(name.endswith(".png") for name in files) == 2


@pytest.fixture(scope="module")
def real():
    craft = vehicle("four_fan")
    inputs = [s.name for s in craft.plant().inputs]
    bench = BenchTable.from_csv(DATA / "thrust_bench.csv", fans=2)

    def read(run):
        files = f"{DATA}/run_{run}_pose.csv+{DATA}/run_{run}_command.csv"
        return gather(files, inputs, bench=bench, only_while=Condition.parse("pwm_lift>1000"), settle=1.0)

    return craft, read


@needs_data
@pytest.mark.parametrize("run", "abcd")
def test_every_real_run_goes_from_file_to_coefficients(real, run):
    craft, read = real
    study = Study.make(craft, [read(run)])
    assert study.found["fan_torque"].value > 2.5 * study.found["fan_torque"].std
    force = study.found["fan_force"]
    assert abs(force.value - 1 / 0.1763) < 5 * force.std and force.std < 2  # 1/m, or a little less


@needs_data
def test_a_fit_on_two_runs_predicts_the_third_better_than_no_model(real):
    craft, read = real
    study = Study.make(craft, [read("a"), read("b")], [read("c")])
    r = study.judged[-1].run.measured[study.judged[-1].run.channels.index("r")]
    stays = np.sqrt(np.nanmean((r[50:] - r[:-50]) ** 2))  # 50 Hz: the rate one second later as it is now
    assert study.judged[-1].prediction.rms["r"] < 0.8 * stays
    assert [s.reason for s in study.judged[-1].run.rejected] == []
