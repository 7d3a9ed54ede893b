"""hovercontrol export as a new user meets it."""

import json
import re
import zipfile
from importlib import resources

import control
import fmpy
import numpy as np
import pytest

from hovercontrol.app.commands.exportable import choose
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.documents.scenarios import load_scenario, run_scenario, scenario_names
from hovercontrol.fmi.exporter.export import export_fmu

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

MODEL = """
[plant]
name = "mine"
[effects]
yaw_coulomb = 0.83
thrust = 0.75
"""
SCENARIO = """
[scenario]
step = 0.02
title = "a circle"
[plant]
vehicle = "c17_simulation"
[reference]
kind = "circle"
radius = 2.0
[controller]
control_point = 0.2
[[phase]]
until = 4.0
"""


@pytest.mark.slow
def test_the_list_can_be_exported(call):
    done = call("export", "--list")
    assert done.returncode == 0
    for name in ("table1 ", "table1:controller", "table2:plant", "four_fan", "x86_64-windows", "imu  "):
        assert name in done.stdout
    assert "sampled loop: C17 Table II" in done.stdout


def test_the_list_as_json_has_names_as_keys(call):
    listed = json.loads(call("export", "--list", "--json").stdout)
    parts = ("plant", "reference", "controller", "estimator")
    assert listed["table1"]["parts"] == [f"table1:{part}" for part in parts]
    assert {"four_fan", "imu", "table2"} <= set(listed) and all("," not in key for key in listed)


def test_a_loop_is_written_as_a_system_of_fmus(call, tmp_path):
    done = call("export", "table1", "-o", "loop.ssp", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 FMUs of FMI 2.0 (plant, reference, controller, estimator)" in done.stdout
    assert "SystemStructure.ssd" in zipfile.ZipFile(tmp_path / "loop.ssp").namelist()
    done = call("export", "imu", "-o", "loop.ssp", cwd=tmp_path)
    assert done.returncode == 2 and "continuous scenario" in done.stderr


OVEN = """
import hovercontrol as hc

T, P = hc.Signal("T", "K"), hc.Signal("P", "W")
C, G = hc.Signal("C", "J/K", start=50.0), hc.Signal("G", "W/K", start=2.0)
OVEN = hc.Block("oven", [T], [P], [T], [C, G], {"T": (P.symbol - G.symbol * T.symbol) / C.symbol})
LOOP = [OVEN, hc.pid(T, P, kp=8.0, ki=1.0)]
"""


def test_a_list_of_blocks_in_a_file_is_a_system_of_fmus_one_fmu_and_a_run(call, tmp_path):
    """C T' = kp e + ki I - G T: from T_ref = 10 K the loop has the poles of 50 s^2 + 10 s + 1."""
    (tmp_path / "oven.py").write_text(OVEN)
    done = call("export", "oven.py:LOOP", "-o", "loop.ssp", "--outputs", "T", cwd=tmp_path)
    assert done.returncode == 0 and "2 FMUs of FMI 2.0 (oven, controller)" in done.stdout, done.stderr
    done = call("export", "oven.py:LOOP", "-o", "loop.fmu", cwd=tmp_path)
    assert "(1 inputs" in done.stdout, done.stderr
    times = np.arange(0.0, 20.0, 0.5)
    run = fmpy.simulate_fmu(
        str(tmp_path / "loop.fmu"), stop_time=20.0, output_interval=0.5, start_values={"T_ref": 10.0}
    )
    wanted = control.forced_response(control.tf([80.0, 10.0], [50.0, 10.0, 1.0]), times, np.ones(times.size))
    assert np.interp(times, run["time"], run["T"]) == pytest.approx(wanted.outputs, abs=2e-2)
    assert call("simulate", "oven.py:LOOP", "--duration", "1", cwd=tmp_path).returncode == 0
    done = call("export", "oven.py:OVEN", "-o", "loop.ssp", cwd=tmp_path)
    assert done.returncode == 2 and "NAME = [plant, controller]" in done.stderr


@pytest.mark.parametrize(
    ("what", "name", "inputs", "outputs"),
    [
        ("table1:plant", "plant", 2, 6),
        ("table2:controller", "controller", 18, 4),
        ("four_fan", "plant", 4, 6),
        ("mine.toml", "plant", 2, 6),
        ("circle.toml", "circle", 0, 16),
        ("circle.toml:reference", "reference", 0, 6),
    ],
)
def test_scenarios_parts_craft_and_files_become_fmus(call, what, name, inputs, outputs, tmp_path):
    (tmp_path / "mine.toml").write_text(MODEL)
    (tmp_path / "circle.toml").write_text(SCENARIO)
    done = call("export", what, "--fmi", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    path = tmp_path / "out" / f"{name}.fmu"
    assert f"wrote out/{name}.fmu: FMI 2.0" in done.stdout and f"{outputs} outputs" in done.stdout
    variables = fmpy.read_model_description(path).modelVariables
    assert sum(v.causality == "input" for v in variables) == inputs
    assert sum(v.causality == "output" for v in variables) == outputs


def test_a_scenarios_loop_starts_as_its_first_phase(call, tmp_path):
    done = call("export", "table1", "-o", "loop.fmu", "--friction", "smooth", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    description = fmpy.read_model_description(tmp_path / "loop.fmu")
    found = {v.name: v.start for v in description.modelVariables}
    assert found["controller.adaptation"] == "0.0"
    assert float(description.defaultExperiment.stopTime) == 50.0
    assert "first phase" in description.description


@pytest.mark.slow
def test_a_real_loop_flies_as_simulate_does(tmp_path):
    scenario = load_scenario("k06-real-turn")
    flown = run_scenario(scenario).columns
    chosen = choose("k06-real-turn")
    assert "real loop beside the ideal one" in chosen.text
    path = export_fmu(chosen.block, tmp_path / "turn.fmu", stop=chosen.stop, step=chosen.step)
    names = {v.name for v in fmpy.read_model_description(path).modelVariables}
    assert {"imu.seed", "magnetometer.noise", "uplink_delay.on", "thrust_clipped", "ideal.plant.u"} <= names
    assert any("downlink" in name for name in names)
    log = {"r": "true_r", "u_hat": "u", "thrust": "thrust", "rudder_clipped": "rudder_clipped", "gap": "gap"}
    told = fmpy.simulate_fmu(str(path), stop_time=chosen.stop, output_interval=chosen.step, output=[*log])
    for name, column in log.items():
        assert told[name] == pytest.approx(flown[column], abs=1e-5), name
    assert np.ptp(told["r"]) > 2.0 and told["rudder_clipped"][-1] > 0


SCENARIOS = resources.files("hovercontrol.documents.scenarios")
REAL_LOOPS = [n for n in scenario_names() if "[autopilot]" in (SCENARIOS / f"{n}.toml").read_text()]


@pytest.mark.parametrize("name", REAL_LOOPS)
def test_every_scenario_with_an_autopilot_exports_its_real_loop(name, monkeypatch):
    """The loop itself takes seconds to derive: here only what it is asked for."""
    asked = []

    def real(scenario, parts):
        asked.append((scenario.name, scenario.autopilot, sorted(parts)))
        return interconnect([*parts.values()], "both")

    monkeypatch.setattr("hovercontrol.app.commands.exportable.real_loop", real)
    monkeypatch.setattr("hovercontrol.app.commands.exportable.real_parameters", lambda scenario, phase: {})
    chosen = choose(name)
    assert [a[0] for a in asked] == [name] and asked[0][1] is not None
    assert chosen.text.startswith("The autopilot's real loop beside the ideal one: ")


@pytest.mark.slow
def test_parts_of_a_scenarios_autopilot_are_those_of_its_file(tmp_path):
    text = REAL.replace("[autopilot]", "[autopilot]\nseed = 7\ngyro_range = false")
    (tmp_path / "mine.toml").write_text(text)
    imu = choose(f"{tmp_path}/mine.toml:imu").block
    assert imu.default_parameters["imu.seed"] == 7.0
    assert imu.default_parameters["imu.yaw_rate_limit"] == 0.0
    assert choose("k06-real-turn:imu").block.default_parameters["imu.yaw_rate_limit"] > 5.0
    assert choose(f"{tmp_path}/mine.toml:rudder_servo").step == 0.02


REAL = """
[scenario]
step = 0.02
[plant]
vehicle = "hoverdemon"
[controller]
kind = "stop"
k1 = 1.0
k2 = 2.5
[autopilot]
[[phase]]
until = 0.1
"""

OWN = """
import hovercontrol as hc
from hovercontrol.craft.models.blockmodel import BlockModel
v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
CART = hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
CLOCK = hc.Block("clock", [v], [a], [v], derivatives={"v": a.symbol * 0 + v.symbol}, period=0.25)
MODEL = BlockModel(CART)
CRAFT = hc.vehicle("hoverdemon")
NUMBER = 3
"""


def test_a_users_blocks_and_models_become_fmus(call, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    done = call("export", "mine.py:CART", "-o", "cart.fmu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    description = fmpy.read_model_description(tmp_path / "cart.fmu")
    assert description.description == "CART of mine.py."
    assert {v.name for v in description.modelVariables} >= {"v", "a"}
    assert choose(f"{tmp_path}/mine.py:MODEL").block.name == "cart"
    assert choose(f"{tmp_path}/mine.py:CLOCK").step == 0.25
    assert [s.name for s in choose(f"{tmp_path}/mine.py:CRAFT").block.inputs] == ["thrust", "rudder"]
    for name, said in (
        ("CARD", "did you mean 'CART'?"),
        ("NUMBER", "expected a Block or BlockModel or Model"),
    ):
        with pytest.raises(InputError, match=re.escape(said)):
            choose(f"{tmp_path}/mine.py:{name}")


@pytest.mark.parametrize(
    ("args", "said"),
    [
        ([], "expected a scenario, a part, a craft or a file"),
        (["tabel1"], "unknown block 'tabel1'; did you mean 'table1'?"),
        (["table1:plan"], "table1 has no part 'plan'; did you mean 'plant'?"),
        (["tabel1:plant"], "unknown scenario 'tabel1' in 'tabel1:plant'; did you mean 'table1'?"),
        (["four_fam"], "did you mean 'four_fan'?"),
        (["servo"], "unknown block 'servo'; nearest of"),
        (["servo"], "rudder_servo"),
        (["magnetometr"], "did you mean 'magnetometer'?"),
        (["none.py:PLANT"], "none.py: expected a Python file, there is no such file"),
        (["table2:sensr"], "table2 has no part 'sensr'; did you mean 'sensor'?"),
        (["none.toml"], "none.toml: expected a TOML file, there is no such file"),
        (["none.toml:plant"], "none.toml: expected a TOML file, there is no such file"),
        (["four_fan", "--step", "1e-320"], "expected 1e+09 steps at most"),
        (["four_fan", "-o", "x.fmx"], "x.fmx: expected a file name that ends in .fmu, or in .ssp"),
        (["four_fan", "-o", "x.ssp"], "FILE.py:NAME of a list of Blocks, NAME = [plant, controller]"),
        (["four_fan", "-o", "/dev/null/x.fmu"], "cannot write there"),
        (["four_fan", "--fmi", "1"], "--fmi: expected 2 or 3, found 1"),
        (["four_fan", "--platforms", "win64"], "unknown platform 'win64'"),
        (["four_fan", "--friction", "dry"], "friction: expected 'events' or 'smooth', found 'dry'"),
        (["four_fan", "--step", "-1"], "step must be positive, found -1.0"),
    ],
)
def test_wrong_input_is_one_line_with_status_2_and_nothing_written(call, tmp_path, args, said):
    done = call("export", *args, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and len(done.stderr) < 400
    assert done.stdout == "" and list(tmp_path.iterdir()) == []
