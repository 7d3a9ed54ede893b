"""The command line as a new user meets it: help, a right call, wrong calls."""

import subprocess
import sys

import pytest

RUN = [sys.executable, "-m", "hovercontrol.cli"]


def call(*args, cwd=None):
    return subprocess.run([*RUN, *args], capture_output=True, text=True, cwd=cwd, timeout=120)


def test_help_shows_an_example_for_every_command():
    assert "simulate" in call("--help").stdout
    for command in ("simulate", "identify"):
        assert "Example: hovercontrol" in " ".join(call(command, "--help").stdout.split())


def test_version():
    assert call("--version").stdout.strip() == "0.1.0"


def test_simulate_writes_its_results(tmp_path):
    done = call("simulate", "sample", "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert {"log.csv", "path.png"} <= {p.name for p in (tmp_path / "out").iterdir()}


def test_a_missed_figure_of_merit_ends_with_status_1(tmp_path):
    text = """
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
[[metric]]
name = "error"
of = "tracking_error"
from = 0.0
to = 0.1
high = 0.001
"""
    (tmp_path / "far.toml").write_text(text)
    done = call("simulate", "far.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1 and "outside" in done.stdout


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["simulate", "tabel1"], "unknown scenario 'tabel1'; did you mean 'table1'?"),
        (["simulate"], "expected a scenario's name"),
        (["simulate", "none.toml"], "none.toml: no such file"),
        (["simulate", "table1", "--aut", "x"], "No such option: --aut"),
        (["simulat", "table1"], "No such command 'simulat'"),
        (["identify"], "expected one or more logs"),
        (["identify", "nothere.csv"], "nothere.csv: expected a CSV or Parquet file, there is no such file"),
    ],
)
def test_wrong_input_is_one_line_with_status_2_and_nothing_written(tmp_path, args, said):
    done = call(*args, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == "" and list(tmp_path.iterdir()) == []
