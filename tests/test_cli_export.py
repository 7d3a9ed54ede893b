"""hovercontrol export as a new user meets it."""

import importlib.util
import subprocess
import sys

import fmpy
import pytest

from hovercontrol.targets.compiler import NoCompilerError, find_compiler

RUN = [sys.executable, "-m", "hovercontrol.cli", "export"]
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


def call(*args, cwd=None, **more):
    return subprocess.run([*RUN, *args], capture_output=True, text=True, cwd=cwd, timeout=300, **more)


def test_the_list_can_be_exported():
    done = call("--list")
    assert done.returncode == 0
    for name in ("table1 ", "table1:controller", "table2:plant", "four_fan", "x86_64-windows"):
        assert name in done.stdout
    assert "table2 " not in done.stdout  # its loop is sampled


def test_help_shows_an_example():
    assert "Example: hovercontrol export table1:plant" in " ".join(call("--help").stdout.split())


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
def test_scenarios_parts_craft_and_files_become_fmus(what, name, inputs, outputs, tmp_path):
    (tmp_path / "mine.toml").write_text(MODEL)
    (tmp_path / "circle.toml").write_text(SCENARIO)
    done = call(what, "--fmi", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    path = tmp_path / "out" / f"{name}.fmu"
    assert f"wrote out/{name}.fmu: FMI 2.0" in done.stdout and f"{outputs} outputs" in done.stdout
    variables = fmpy.read_model_description(path).modelVariables
    assert sum(v.causality == "input" for v in variables) == inputs
    assert sum(v.causality == "output" for v in variables) == outputs


def test_a_scenarios_loop_starts_as_its_first_phase(tmp_path):
    done = call("table1", "-o", "loop.fmu", "--friction", "smooth", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    description = fmpy.read_model_description(tmp_path / "loop.fmu")
    found = {v.name: v.start for v in description.modelVariables}
    assert found["controller.adaptation"] == "0.0"
    assert float(description.defaultExperiment.stopTime) == 50.0
    assert "first phase" in description.description


def test_several_platforms_in_one_file(tmp_path):
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("ziglang (hovercontrol[fmu]) is not installed")
    done = call("four_fan", "-o", "x.fmu", "--platforms", "x86_64-linux,x86_64-windows", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "for x86_64-linux, x86_64-windows;" in done.stdout
    assert set(fmpy.supported_platforms(str(tmp_path / "x.fmu"))) >= {"linux64", "win64", "c-code"}


@pytest.mark.parametrize(
    ("args", "said"),
    [
        ([], "expected what to export"),
        (["tabel1"], "unknown block 'tabel1'; did you mean 'table1'?"),
        (["table1:plan"], "table1 has no part 'plan'; did you mean 'plant'?"),
        (["tabel1:plant"], "unknown scenario 'tabel1' in 'tabel1:plant'; did you mean 'table1'?"),
        (["four_fam"], "did you mean 'four_fan'?"),
        (
            ["table2"],
            "table2 is a sampled loop, which cannot be exported whole; its continuous parts can: table2:",
        ),
        (["sample"], "sample is a sampled loop"),
        (["none.toml"], "none.toml: no such file"),
        (["none.toml:plant"], "none.toml: no such file"),
        (["four_fan", "-o", "x.fmx"], "x.fmx: expected a file name that ends in .fmu"),
        (["four_fan", "-o", "/dev/null/x.fmu"], "cannot write there"),
        (["four_fan", "--fmi", "1"], "FMI version must be 2 or 3, found 1"),
        (["four_fan", "--platforms", "win64"], "unknown platform 'win64'"),
        (["four_fan", "--friction", "dry"], "friction must be 'events' or 'smooth', found 'dry'"),
        (["four_fan", "--step", "-1"], "step must be positive, found -1.0"),
    ],
)
def test_wrong_input_is_one_line_with_status_2_and_nothing_written(tmp_path, args, said):
    done = call(*args, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == "" and list(tmp_path.iterdir()) == []
