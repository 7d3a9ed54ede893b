"""``--json``: every command that reports prints one JSON value, and nothing else, on standard output."""

import json
import shutil
import sys

import pytest

from hovercontrol.app import cli
from hovercontrol.documents.samples import sample_path
from hovercontrol.logs import read_log

SCRIPT = '''"""Two words."""


def main(out, progress):
    out.mkdir(parents=True)
    (out / "words.txt").write_text("one\\ntwo\\n")
    return [out / "words.txt"]
'''
REPORTING = (
    "simulate",
    "check",
    "identify",
    "diagnose",
    "experiment",
    "monitor",
    "fleet",
    "export",
    "analyze",
    "sweep",
    "benchmark",
)


@pytest.fixture
def told(monkeypatch, capsys, tmp_path):
    """Return what a command says with --json, and its status."""
    monkeypatch.chdir(tmp_path)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["hovercontrol", *words, "--json"])
        with pytest.raises(SystemExit) as done:
            cli.main()
        return json.loads(capsys.readouterr().out), done.value.code

    return run


def test_every_command_that_reports_has_it():
    import typer

    from hovercontrol.app.commands.app import app

    commands = typer.main.get_command(app).commands
    with_json = {name for name, c in commands.items() if any("--json" in p.opts for p in c.params)}
    assert with_json == set(REPORTING)


def test_simulate_tells_its_figures_and_files(told):
    found, status = told("simulate", "k06-turn")
    assert status == 0 and all(f["met"] for f in found["figures"]) and found["scenario"] == "k06-turn"
    assert any(name.endswith("log.csv") for name in found["files"])
    listed, _ = told("simulate", "--list")
    assert listed["table1"].startswith("C17 Table I")


def test_identify_tells_coefficients_and_predictions(told):
    found, status = told("identify", "--sample")
    assert status == 0
    thrust = next(c for c in found["coefficients"] if c["name"] == "thrust")
    assert abs(thrust["value"] - 0.75) < 0.01 and thrust["unit"] == "m/s^2/A" and thrust["excited"]
    assert found["prediction"][0]["log"] == "rudder_craft"


def test_diagnose_tells_its_result(told):
    found, status = told(
        "diagnose", str(sample_path()), "--vehicle", "c17_experiment", "--effects", "slope", "--out", "d"
    )
    assert found["verdict"] == "none" and status == 0
    with open("d/result.json") as file:
        saved = json.load(file)
    assert {k: v for k, v in found.items() if k != "files"} == saved


def test_fleet_tells_its_findings(told, tmp_path):
    (tmp_path / "boat7").mkdir()
    read_log(sample_path()).between(0.0, 5.0).save(tmp_path / "boat7" / "a.csv")
    found, status = told("fleet", "boat7", "--vehicle", "c17_experiment", "--workers", "1")
    assert (status, found["logs"], found["refused"], found["craft"]) == (0, 1, {}, ["boat7"])
    assert found["findings"][0].startswith("1 of 1 logs of 1 craft used")
    assert "out/fleet/fleet.parquet" in found["files"]


def test_sweep_tells_its_numbers(told):
    found, status = told("sweep", "k06-turn", "--vary", "controller.k2=1:6:5")
    assert status == 0 and len(found["values"]) == 5 and found["axes"][0]["key"] == "controller.k2"
    assert (found["unit"], len(found["files"])) == ("m/s", 3)


def test_analyze_tells_its_findings(told, tmp_path, monkeypatch):
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "k06_words.py").write_text(SCRIPT, encoding="utf-8")
    monkeypatch.setattr("hovercontrol.app.commands.analyze.FOLDERS", (tmp_path / "scripts",))
    found, status = told("analyze", "words", "--out", "w")
    assert status == 0 and found["findings"] == ["one", "two"] and found["files"] == ["w/words.txt"]
    titles, status = told("analyze", "--list")
    assert status == 0 and titles["k06_words"] == "analysis: Two words." and "k06 table 6.6" in titles


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
def test_export_tells_its_variables(told):
    found, status = told("export", "hoverdemon", "-o", "h.fmu")
    assert status == 0 and found["files"] == ["h.fmu"] and found["fmi"] == 3
    assert {"thrust", "rudder"} <= {v["name"] for v in found["variables"] if v["kind"] == "input"}
