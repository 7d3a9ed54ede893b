"""A model file alone is a run: steps of its commands."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.modelfile import load_model
from hovercontrol.craft.models.template import template
from hovercontrol.documents.scenarios import load_scenario, run_scenario


def written(folder, kind):
    file = folder / f"{kind}.toml"
    file.write_text(template(kind, kind, file.name), encoding="utf-8")
    return file


@pytest.mark.parametrize("kind", ["rudder", "fan"])
def test_what_new_writes_is_driven_within_its_bounds_and_moves_in_each_direction(tmp_path, kind):
    file = written(tmp_path, kind)
    run = run_scenario(load_scenario(file))
    assert run.scenario.name == kind
    assert run.time[[0, -1]].tolist() == [0.0, 20.0]
    for signal in load_model(file).plant().inputs:
        given = run.columns[signal.name]
        assert signal.lower <= given.min() < given.max() <= signal.upper
        held = np.flatnonzero(np.diff(given)) + 1
        assert np.allclose(run.time[held] % 1.0, 0.0)  # steps, a second each
    for name in "uvr":
        assert np.ptp(run.columns[name]) > 0.5


def test_the_run_is_a_log_that_holds_the_models_coefficients(tmp_path):
    from hovercontrol.identification.identify import identify

    file = written(tmp_path, "fan")
    run = run_scenario(load_scenario(file))
    random = np.random.default_rng(0)
    log = run.log()
    noisy = {
        k: v + (1e-3 * random.normal(size=v.size) if k in ("x", "y", "psi") else 0)
        for k, v in log.columns.items()
    }
    found = identify(load_model(file), [type(log)("noisy", log.time, noisy)]).model.coefficients()
    for name, value in load_model(file).coefficients().items():
        assert found[name] == pytest.approx(value, rel=0.1), name


def test_commands_without_bounds_have_their_usual_size(tmp_path):
    file = tmp_path / "free.toml"
    file.write_text(
        '[plant]\nname = "free"\n[effects]\nthrust = 1.0\nrudder_torque = 1.0\n', encoding="utf-8"
    )
    commands = load_scenario(file).commands
    assert 0 < min(commands["thrust"]) < max(commands["thrust"]) < 1
    assert -0.5 < min(commands["rudder"]) < 0 < max(commands["rudder"]) < 0.5


def test_a_fault_in_a_model_file_is_told_as_that_of_a_model_file(tmp_path):
    file = written(tmp_path, "rudder")
    file.write_text(
        file.read_text(encoding="utf-8").replace("\nyaw_coulomb", "\nyaw_columb"), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"yaw_columb.*yaw_coulomb"):
        load_scenario(file)


def test_the_commands_of_a_log_drive_a_model_as_they_drove_it_when_the_log_was_made(tmp_path):
    file = written(tmp_path, "rudder")
    first = run_scenario(load_scenario(file, seconds=5.0))
    log = first.log()
    later = type(log)("later", log.time + 100.0, log.columns)
    again = run_scenario(load_scenario(file, commands=later))
    assert again.time[-1] == pytest.approx(5.0)
    for name in ("x", "psi", "v", "thrust"):
        np.testing.assert_allclose(again.columns[name], first.columns[name], atol=1e-9)


def test_what_cannot_be_driven_so_is_said_in_one_line(tmp_path, call):
    file = written(tmp_path, "rudder")
    log = run_scenario(load_scenario(file, seconds=2.0)).log()
    log.save(tmp_path / "run.csv")
    hole = log.with_columns({"thrust": np.where(log.time < 1.0, log["thrust"], np.nan)})
    for given, said in (
        ({"seconds": 3.0, "commands": log}, "expected commands for 3 s, found 2 s"),
        ({"seconds": 0.0}, "expected a run of at least 0.02 s, found 0 s"),
        ({"seconds": float("nan")}, "found nan s"),
        ({"commands": hole}, "column 'thrust': expected a command, found none at 1 s"),
        ({"commands": log.select(slice(0, 0))}, "samples"),
    ):
        with pytest.raises(InputError, match=said):
            load_scenario(file, **given)
    with pytest.raises(InputError, match="expected a model file"):
        load_scenario("table1", seconds=3.0)
    done = call("simulate", "rudder.toml", "--commands", "run.csv", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "out" / "log.csv").exists()
    done = call("simulate", "rudder.toml", "--commands", "run.csv", "--columns", "rudder=ruder", cwd=tmp_path)
    assert done.returncode == 2 and "'ruder'" in done.stderr and done.stderr.count("\n") == 1
