"""The scripts in analyses/: each is short, runs alone and leaves pictures and a table."""

import ast
import importlib.util
import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "analyses"
SMALL = {
    "c17_beta_region": {"points": 20},
    "c17_gain_region": {"points": 6},
    "c17_zero_dynamics": {"points": 8},
    "c17_iss_gain": {"sizes": 4, "runs": 4},
    "c17_interconnection": {"cells": 2, "runs": 4},
    "c17_excitation": {"points": 4},
    "c17_table2": {
        "seeds": 1,
        "P0": (0.1, 100.0),
        "R": (1.0,),
        "position_noise": (3e-4,),
        "heading_noise": (1e-3,),
        "factor": (1.13,),
    },
    "k06_forward_region": {"points": 4},
    "k06_reverse_region": {"points": 4},
    "k06_steering": {"points": 2},
}


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_script_is_tried():
    assert {p.stem for p in FOLDER.glob("*_*.py")} >= set(SMALL)


@pytest.mark.slow("excitation", "table2", "steering", "reverse", "beta", "gain", "zero")
@pytest.mark.parametrize("name", SMALL)
def test_a_script_leaves_pictures_a_table_and_its_findings(name, tmp_path):
    told = []
    files = load(name).main(tmp_path, told.append, **SMALL[name])
    kinds = {f.suffix for f in files}
    assert kinds == {".png", ".svg", ".csv", ".txt"}
    assert all(f.stem.startswith(name) and f.stat().st_size > 50 for f in files)
    assert told[-1] == pytest.approx(1.0)
    text = (tmp_path / f"{name}.txt").read_text()
    assert "nan" not in text.lower().split()


@pytest.mark.parametrize("name", [p.stem for p in FOLDER.glob("*.py")])
def test_a_script_is_short_and_runs_what_its_document_has(name):
    text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    assert text.count("\n") <= 15
    used = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ImportFrom)]
    own, *others = sorted(n.module for n in used if n.module != "hovercontrol.control.analysis.output")
    assert own.startswith(f"hovercontrol.documents.{name.partition('_')[0]}.")
    assert not others


def run_alone(name, out, monkeypatch):
    monkeypatch.setattr(sys, "argv", [name, "--out", str(out)])
    runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")


@pytest.mark.slow
def test_a_script_runs_alone_and_says_what_it_found(tmp_path, monkeypatch, capsys):
    run_alone("c17_beta_region", tmp_path / "out", monkeypatch)
    assert "(19) implies (18)" in capsys.readouterr().out
    assert (tmp_path / "out" / "c17_beta_region.svg").exists()


def test_a_folder_that_is_a_file_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    there = tmp_path / "file"
    there.write_text("")
    with pytest.raises(SystemExit) as end:
        run_alone("c17_gain_region", there, monkeypatch)
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("hovercontrol: ") and said.count("\n") == 1
