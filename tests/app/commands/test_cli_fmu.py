"""``check``, ``simulate`` and ``sweep`` with an FMU as the model, against the exact solution."""

import csv
import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import hovercontrol as hc
from hovercontrol.app.schema import schema
from hovercontrol.craft.models.template import template
from hovercontrol.documents.scenarios.fmu_sweep import vary_fmu

#: v' = gain drive u - drag v
GAIN, DRAG, NOISE, STEP = 2.0, 0.8, 0.01, 0.02


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with motor.fmu and run.csv, a log with the drag of the FMU halved."""
    found = tmp_path_factory.mktemp("motor")
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V", lower=-3.0, upper=3.0)
    gain, drive, drag = (
        hc.Signal("gain", "m/s^2/V", start=GAIN),
        hc.Signal("drive", "1", start=1.0),
        hc.Signal("drag", "1/s", start=DRAG, lower=0.0),
    )
    slope = gain.symbol * drive.symbol * u.symbol - drag.symbol * v.symbol
    block = hc.Block("motor", [v], [u], [v], [gain, drive, drag], {"v": slope})
    block.to_fmu(found / "motor.fmu", version=2)
    rng = np.random.default_rng(3)
    t = STEP * np.arange(600)
    u = np.repeat(rng.uniform(-2.0, 2.0, 12), 50)
    seen = exact(u, DRAG / 2, 0.5) + NOISE * rng.normal(size=t.size)
    hc.Log("run", t, {"u": u, "v": seen}).save(found / "run.csv")
    return found


def exact(u, drag, v):
    """The velocity at the rows: a linear equation with its input held from row to row."""
    found = []
    for value in u:
        found.append(v)
        end = GAIN * value / drag
        v = end + (v - end) * np.exp(-drag * STEP)
    return np.array(found)


def columns(path):
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "status"}


@pytest.mark.slow
def test_check_says_which_parameters_a_log_tells(call, folder, tmp_path):
    words = (str(folder / "run.csv"), "--model", str(folder / "motor.fmu"), "--out", str(tmp_path))
    done = call("check", *words, "--json")
    found = {c["name"]: c for c in json.loads(done.stdout)["coefficients"]}
    assert done.returncode == 1 and found["motor.drag"]["shown"]
    assert found["motor.drag"]["value"] == pytest.approx(DRAG / 2, abs=4 * found["motor.drag"]["std"])
    assert "hardly distinguishable from motor.drive" in found["motor.gain"]["reason"]


def test_check_tries_the_parameters_that_are_asked_for(folder):
    plant = hc.fmu_plant(folder / "motor.fmu", ["motor.drag", "motor.gain"], isolated=False)
    found = hc.check(plant, [hc.read_log(folder / "run.csv")])
    assert [c.name for c in found.coefficients] == ["motor.drag", "motor.gain"] and not found.negative
    plant.close()


def test_simulate_is_the_exact_solution_and_says_how_far_the_log_is(call, folder, tmp_path):
    words = ("--model", str(folder / "motor.fmu"), "--commands", str(folder / "run.csv"))
    done = call("simulate", *words, "--out", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    found, log = columns(tmp_path / "log.csv"), columns(folder / "run.csv")
    np.testing.assert_allclose(found["v"], exact(log["u"], DRAG, 0.0), atol=1e-5)
    error = np.sqrt(np.mean((log["v"] - exact(log["u"], DRAG, 0.0)) ** 2))
    said = json.loads(done.stdout)
    assert said["errors"]["v"]["rms"] == pytest.approx(error, rel=1e-4)
    assert list(Draft202012Validator(schema("simulation")).iter_errors(said)) == []
    np.testing.assert_array_equal(found["v_measured"], log["v"])


@pytest.mark.slow
def test_with_the_true_value_and_start_only_noise_is_left(call, folder, tmp_path):
    (tmp_path / "values.csv").write_text(f"name,value\nmotor.drag,{DRAG / 2}\n", encoding="utf-8")
    words = (str(folder / "motor.fmu"), "--commands", str(folder / "run.csv"), "--match-start")
    done = call("simulate", *words, "--params", "values.csv", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    assert found["errors"]["v"]["rms"] == pytest.approx(NOISE, rel=0.1)
    assert found["start"]["v"] == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
def test_an_fmu_without_a_log_gets_steps_within_its_bounds(call, folder, tmp_path):
    done = call("simulate", str(folder / "motor.fmu"), "--duration", "4", "--out", str(tmp_path))
    found = columns(tmp_path / "log.csv")
    assert done.returncode == 0 and found["time"][-1] == pytest.approx(4.0)
    assert np.ptp(found["u"]) > 0.5 and np.abs(found["u"]).max() <= 3.0
    np.testing.assert_allclose(found["v"], exact(found["u"], DRAG, 0.0), atol=1e-5)


@pytest.mark.slow
def test_sweep_over_a_parameter_and_a_start_value(call, folder, tmp_path):
    words = ("--model", str(folder / "motor.fmu"), "--commands", str(folder / "run.csv"), "--out", "out")
    vary = ("--vary", "motor.drag=0.2:0.8:4", "--vary", "v=-1:1:3", "--figure", "maximum")
    done = call("sweep", *words, *vary, cwd=tmp_path)
    assert done.returncode == 0 and "largest maximum of v" in done.stdout, done.stderr
    found, u = columns(tmp_path / "out" / "sweep.csv"), columns(folder / "run.csv")["u"]
    for k, (drag, v) in enumerate(zip(found["motor.drag"], found["v.start"], strict=True)):
        path = exact(u, drag, v)
        assert found["v.final"][k] == pytest.approx(path[-1], abs=1e-5)
        assert found["v.maximum"][k] == pytest.approx(path.max(), abs=1e-5)
        assert found["v.rms"][k] ** 2 == pytest.approx(
            np.mean((path[1:] ** 2 + path[:-1] ** 2) / 2), rel=1e-4
        )
    assert not (tmp_path / "out.partial").exists()


def test_a_sweep_as_json_fits_its_schema(call, folder, tmp_path):
    words = ("--vary", "motor.drag=0.2:0.8:2", "--vary", "v=0:1:2", "--json", "--out", str(tmp_path / "out"))
    said = json.loads(call("sweep", str(folder / "motor.fmu"), *words).stdout)
    check = Draft202012Validator(schema("sweep"))
    assert list(check.iter_errors(said)) == [] and list(check.iter_errors(said | {"axes": 1}))


def test_a_sweep_goes_on_where_it_was_stopped(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("hovercontrol.documents.scenarios.fmu_sweep.TOGETHER", 4)
    plant = hc.fmu_plant(folder / "motor.fmu", isolated=False)
    ranges = {"motor.drag": np.linspace(0.2, 0.8, 10)}

    def stop(done):
        if done > 0.85:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        vary_fmu(plant, ranges, checkpoint=tmp_path, progress=stop)
    begin = plant.runs.count
    resumed = vary_fmu(plant, ranges, checkpoint=tmp_path)
    middle = plant.runs.count
    whole = vary_fmu(plant, ranges)
    assert middle - begin == plant.runs.count - middle - 8, "eight of ten runs were kept"
    np.testing.assert_array_equal(resumed.values, whole.values)
    plant.close()


def test_a_sweep_of_ones_own_block_can_be_run_again_and_by_a_log(call, tmp_path):
    path = tmp_path / "trolley.py"
    path.write_text(template("block", "trolley", path.name), encoding="utf-8")
    t = STEP * np.arange(100)
    hc.Log("push", t, {"force": np.ones(100)}).save(tmp_path / "push.csv")
    words = (f"{path}:BLOCK", "--vary", "trolley.mass=25:100:2", "--commands", "push.csv")
    for _ in range(2):
        done = call("sweep", *words, "--of", "position", "--figure", "final", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob("out/*.partial"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("check", "run.csv", "--fit", "motor.drag"), "--fit belongs to an FMU; expected --model FILE.fmu"),
        (("check", "run.csv", "--model", "motor.fmu", "--fit", "motor.drap"), "did you mean 'motor.drag'?"),
        (("check", "run.csv", "--model", "moto.fmu"), "did you mean 'motor.fmu'?"),
        (("diagnose", "run.csv", "--laws-in", "v"), "--laws-in belongs to an FMU; expected --model FILE.fmu"),
        (("diagnose", "run.csv", "--model", "motor.fmu", "--laws-in", "w"), "no continuous state 'w'"),
        (("simulate", "--model", "motor.fmu", "--commands", "bare.csv"), "no column for the input 'u'"),
        (("simulate", "motor.fmu", "--model", "motor.fmu"), "--model takes the place of the argument"),
        (("simulate", "motor.fmu", "--match-start"), "expected one with outputs"),
        (("simulate", "motor.fmu", "--params", "run.csv"), "expected columns name and value"),
        (("sweep", "--model", "motor.fmu", "--vary", "motor.drap=0:1:3"), "did you mean 'motor.drag'?"),
        (("sweep", "motor.fmu", "--vary", "motor.drag=-1:1:3"), "motor.drag = -1 1/s is out of its bounds"),
        (("sweep", "motor.fmu", "--vary", "motor.drag=0:1:3", "--of", "w"), "no output 'w'"),
    ],
)
def test_wrong_input_is_one_line(call, folder, words, said):
    (folder / "bare.csv").write_text("time,v\n0,0\n1,0\n2,0\n", encoding="utf-8")
    done = call(*words, cwd=folder)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr
