"""``hovercontrol diagnose`` as a user meets it."""

import json
import sys

import numpy as np
import pytest

from hovercontrol.app import cli
from hovercontrol.craft.models.modelfile import load_model, save_model
from hovercontrol.logs import Log

from .generator import Conditions, make


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model file, a training log and a held-out log of a craft on a slope."""
    folder = tmp_path_factory.mktemp("diagnose")
    case = make(11, ["slope"], Conditions(duration=12.0, logs=1))
    save_model(case.model, folder / "craft.toml")
    case.logs[0].save(folder / "a.csv")
    case.holdout.save(folder / "c.csv")
    return folder


def fails(args, monkeypatch, capsys, where):
    """Return the line of a call that ends with status 2."""
    monkeypatch.chdir(where)
    monkeypatch.setattr(sys, "argv", ["hovercontrol", "diagnose", *args])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, err = capsys.readouterr()
    assert end.value.code == 2, err
    lines = [line for line in err.strip().splitlines() if not line.startswith("warning")]
    assert out == "" and len(lines) == 1
    return lines[0]


def test_every_hold_out_is_read(folder, tmp_path, monkeypatch, capsys):
    words = [str(folder / "a.csv"), "--model", str(folder / "craft.toml")]
    for held in (["none.csv", str(folder / "c.csv")], [str(folder / "c.csv"), "none.csv"]):
        twice = [word for name in held for word in ("--holdout", name)]
        assert "none.csv" in fails([*words, *twice], monkeypatch, capsys, tmp_path)
    twice = ["--holdout", str(folder / "c.csv"), "--holdout", str(folder / "a.csv")]
    assert "a.csv is given twice" in fails([*words, *twice], monkeypatch, capsys, tmp_path)


def test_a_missing_slope_is_found_named_added_and_shown(call, folder, tmp_path):
    args = [str(folder / "a.csv"), "--holdout", str(folder / "c.csv"), "--model", str(folder / "craft.toml")]
    done = call("diagnose", *args, "--effects", "slope,gyro_bias", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    missing, gap, remains, wrote = done.stdout.splitlines()
    assert missing.startswith("Missing: slope, x ")
    assert gap.startswith("On the held-out log it removes ")
    assert remains == "Unmodelled residual: none beyond noise."
    assert wrote == "wrote model.toml, report.html, result.json to out"
    assert sorted(p.name for p in (tmp_path / "out").glob("[!.]*")) == [
        "model.toml",
        "report.html",
        "result.json",
    ]
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["verdict"] == "effect" and result["effects"][0]["name"] == "slope"
    assert result["effects"][0]["evidence"]["blocks"]["n"] >= 8
    assert all(left["rms"] == 0 for left in result["remainder"].values())
    assert result["warnings"] == []
    assert load_model(tmp_path / "out" / "model.toml").effect("slope").values["x"] == pytest.approx(
        result["effects"][0]["coefficient"]
    )
    page = (tmp_path / "out" / "report.html").read_text()
    assert "hovercontrol diagnose a.csv --holdout c.csv --model craft.toml" in page
    assert str(folder) not in page and str(tmp_path) not in page


def ends(found, tmp_path, monkeypatch, capsys):
    """Return status and lines of a call whose search ends as `found` did."""
    for log in (*found.case.logs, found.case.holdout):
        log.save(tmp_path / f"{log.name.replace(' ', '')}.csv")
    save_model(found.case.model, tmp_path / "craft.toml")
    told = []

    def again(*args, progress, **options):
        told.append(progress)
        progress(0.5, "trying slope")
        return found.found

    monkeypatch.setattr("hovercontrol.identification.diagnose.diagnose", again)
    monkeypatch.chdir(tmp_path)
    args = ["log1.csv", "--holdout", "hold-out.csv", "--model", "craft.toml"]
    monkeypatch.setattr(sys, "argv", ["hovercontrol", "diagnose", *args])
    try:
        cli.main()
        code = 0
    except SystemExit as end:
        code = end.code or 0
    assert told
    return code, capsys.readouterr().out.splitlines()


@pytest.mark.slow("effect")
@pytest.mark.parametrize(
    ("kind", "status", "first"),
    [
        ("effect", 0, "Missing: slope, "),
        ("none", 0, "Missing: nothing beyond noise."),
        ("two readings", 0, "Missing: input delay, "),
        ("partial", 1, "Missing: slope, "),
        ("ambiguous", 1, "Missing: wind, "),
        ("unexplained", 1, "Missing: a residual that no candidate effect explains"),
    ],
)
def test_the_exit_status_follows_the_verdict(every, kind, status, first, tmp_path, monkeypatch, capsys):
    code, lines = ends(every[kind], tmp_path, monkeypatch, capsys)
    assert code == status and lines[0].startswith(first) and lines[2].startswith("Unmodelled residual: ")
    result = json.loads((tmp_path / "out" / "diagnose" / "result.json").read_text())
    assert result["verdict"] == ("effect" if kind == "two readings" else kind)
    assert {"effects", "rivals", "gap", "remainder", "leads", "where", "next_experiment"} <= {*result}
    assert (tmp_path / "out" / "diagnose" / "report.html").exists()


@pytest.mark.parametrize(
    ("args", "said"),
    [
        ([], "diagnose: expected one or more logs"),
        (["a.csv", "--model", "none.toml"], "none.toml: expected a TOML file, there is no such file"),
        (["a.csv", "--model", "craft.toml", "--holdout", "./a.csv"], "./a.csv is given twice (as a.csv)"),
        (["a.csv", "--model", "craft.toml", "--effects", "sloep"], "did you mean 'slope'?"),
        (
            ["a.csv", "--model", "craft.toml", "--effects", ","],
            "--effects: expected names separated by commas",
        ),
        (["a.csv", "--vehicle", "four_fan"], "no column 'rear_left'"),
        (["a.csv", "--model", "craft.toml", "--max-effects", "0"], "greater than or equal to 1"),
        (["gone.csv", "--model", "craft.toml"], "gone.csv"),
    ],
)
def test_a_wrong_call_is_one_line(folder, args, said, monkeypatch, capsys):
    assert said in fails([*args, "--out", "out"], monkeypatch, capsys, folder)
    assert not (folder / "out").exists()


def test_help_shows_an_example(capsys):
    from hovercontrol.app.commands.app import app

    app(["diagnose", "--help"], standalone_mode=False)
    said = " ".join(capsys.readouterr().out.split())
    assert "Example: hovercontrol diagnose" in said
    for verdict in ("none", "effect", "partial", "ambiguous", "unexplained"):
        assert f"{verdict} (" in said
    assert "Exit status 0 for none and effect; 1 for partial, ambiguous, unexplained." in said


def bad(log, kind):
    columns = dict(log.columns)
    if kind == "copy":
        return Log("bad", log.time, {k: v for k, v in columns.items()})
    if kind == "short":
        return log.select(slice(0, 10))
    if kind == "degrees":
        columns["psi"] = np.degrees(columns["psi"])
    if kind == "both in degrees":
        columns["psi"], columns["r"] = np.degrees(columns["psi"]), np.degrees(columns["r"])
    if kind == "rudder in degrees":
        columns["rudder"] = np.degrees(columns["rudder"])
    if kind == "constant":
        columns["v"] = np.zeros(len(log))
    if kind == "empty":
        columns["u"] = np.full(len(log), np.nan)
    return Log("bad", log.time, columns)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("copy", "bad.csv: the held-out log is the training log a.csv"),
        ("short", "bad.csv: too short"),
        ("degrees", "bad.csv: column 'psi': expected a heading in rad"),
        ("both in degrees", "bad.csv: columns 'psi' and 'r': expected rad and rad/s"),
        ("rudder in degrees", "bad.csv: column 'rudder': expected an angle in rad"),
        ("constant", "bad.csv: column 'v' is constant while x moves"),
        ("empty", "bad.csv: column 'u' is empty"),
    ],
)
def test_a_bad_log_is_one_line_and_nothing_is_written(folder, kind, said, monkeypatch, capsys):
    from hovercontrol.logs import read_log

    log = read_log(folder / "a.csv", None, ["thrust", "rudder"])
    bad(log, kind).save(folder / "bad.csv")
    args = ["a.csv", "--holdout", "bad.csv", "--model", "craft.toml", "--out", "out"]
    line = fails(args, monkeypatch, capsys, folder)
    assert said in line and not (folder / "out").exists()
