"""The command: lists, writes cases, scores a tool of a user, refuses wrong input in one line."""

import json

import pytest

from hovercontrol.app.commands.benchmark import benchmark
from hovercontrol.base.errors import InputError
from hovercontrol.identification.benchmark import benchmark_names

TOOL = """
from hovercontrol.identification.benchmark import Answer, Term

def guess(model, train, holdout):
    return Answer("missing", (Term("r", "Abs(r)*r"),))

def broken(model, train, holdout):
    raise RuntimeError("no answer")

def short(model):
    return None
"""


@pytest.fixture
def tool(tmp_path):
    file = tmp_path / "tools.py"
    file.write_text(TOOL)
    return str(file)


def test_it_lists_the_cases(capsys):
    assert benchmark(list_cases=True) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == benchmark_names()


def test_a_tool_of_a_user_is_scored_and_a_stopped_run_goes_on(tmp_path, tool, capsys):
    out = tmp_path / "out"
    assert benchmark(out=out, tool=f"{tool}:guess,{tool}:broken", first=2, jobs=1) == 0
    assert "missing, detected" in capsys.readouterr().out
    result = json.loads((out / "result.json").read_text())
    assert [r["case"] for r in result["cases"][::2]] == benchmark_names()[:2]
    first, failed = result["cases"][:2]  # the first case lacks yaw_quadratic_drag: - c abs(r) r in r'
    assert (first["form"], failed["verdict"]) == (True, "unknown")
    assert failed["error"] == "RuntimeError: no answer"
    assert {f.name for f in out.iterdir()} >= {"result.json", "table.csv", "table.png"}
    kept = sorted((tmp_path / "out.cases").glob("case-*.json"))
    before = [f.stat().st_mtime_ns for f in kept]
    assert benchmark(out=out, tool=f"{tool}:guess,{tool}:broken", first=2, jobs=1) == 0
    assert [f.stat().st_mtime_ns for f in kept] == before


def test_one_case_is_scored_alone(tmp_path, tool, capsys):
    out, one = tmp_path / "out", benchmark_names()[2]
    assert benchmark(out=out, case=one, tool=f"{tool}:guess", jobs=1) == 0
    result = json.loads((out / "result.json").read_text())
    assert [(r["case"], r["tool"]) for r in result["cases"]] == [(one, f"{tool}:guess")]
    assert not (tmp_path / "out.answer").exists()


def test_blind_logs_have_neutral_names_and_answers_apart(tmp_path):
    out = tmp_path / "blind"
    assert benchmark(out=out, blind="secret", logs_only=True, first=1) == 0
    sheet = json.loads((tmp_path / "blind.answer" / "answers.json").read_text())
    case = out / "blind-001"
    assert list(sheet) == ["blind-001"] and (case / "train.csv").exists()
    assert sheet["blind-001"]["lacks"] not in (case / "model.py").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"edition": "smal"}, "expected small or full, found 'smal'"),
        ({"tool": "sindi"}, "did you mean 'sindy'"),
        ({"case": "ship.nothing"}, "expected MACHINE.WHAT.CONDITION.SEED"),
        ({"case": "ship.nothing", "tool": "arx"}, "expected MACHINE.WHAT.CONDITION.SEED"),
        ({"logs_only": True, "tool": "arx"}, "--logs runs no tool"),
    ],
)
def test_wrong_input_ends_in_one_line(options, message, tmp_path):
    with pytest.raises(InputError, match=message):
        benchmark(out=tmp_path / "out", **options)


def test_a_tool_must_take_three_arguments(tool, tmp_path):
    with pytest.raises(InputError, match="expected a function"):
        benchmark(out=tmp_path / "out", tool=f"{tool}:short")
