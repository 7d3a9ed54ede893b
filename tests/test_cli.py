"""The command line as a new user meets it: help, a right call, wrong calls."""

import re
import subprocess
import sys

import pytest

from hovercontrol.documents.samples import sample_path

RUN = [sys.executable, "-m", "hovercontrol.app.cli"]


def test_help_shows_an_example_for_every_command(call):
    assert "simulate" in call("--help").stdout
    for command in ("simulate", "identify"):
        assert "Example: hovercontrol" in " ".join(call(command, "--help").stdout.split())


def test_help_breaks_no_sentence(call):
    for command in ("check", "identify", "diagnose", "cockpit"):
        text = re.split(r"\n(?:Arguments|Options):\n", call(command, "--help").stdout)[0]
        said = [" ".join(part.split()) for part in re.split(r"\n *\n", text)]
        whole = [part for part in said if part and "Usage:" not in part]
        assert len(whole) > 2 and all(part.endswith(".") for part in whole), whole


def test_without_arguments_the_help_is_shown(call):
    done = call()
    assert done.returncode == 0 and "simulate" in done.stdout and done.stderr == ""


def test_help_waits_for_no_library_that_it_does_not_use():
    run = "hovercontrol.app.commands.app.app(['--help'], standalone_mode=False)"
    code = f"import sys, hovercontrol.app.commands.app; {run}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    unused = {"numpy", "sympy", "scipy", "matplotlib", "control", "pandas", "rich", "asyncio"}
    assert not unused & set(done.stdout.splitlines()[-1].split())


def test_the_command_itself_tells_its_version():
    done = subprocess.run([*RUN, "--version"], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "0.1.0\n")


def test_simulate_writes_its_results(call, tmp_path):
    done = call("simulate", "sample", "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert {"log.csv", "path.png"} <= {p.name for p in (tmp_path / "out").iterdir()}


def test_a_missed_figure_of_merit_ends_with_status_1(call, tmp_path):
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
        (["simulate", "none.toml"], "none.toml: expected a TOML file, there is no such file"),
        (["simulate", "table1", "--aut", "x"], "No such option: --aut"),
        (["simulat", "table1"], "No such command 'simulat'"),
        (["simulate", "table1", "--out", "/dev/null/x"], "cannot write there"),
        (["identify"], "expected one or more logs"),
        (["identify", "--sample", "--model", "a.toml", "--vehicle", "four_fan"], "exclude each other"),
        (
            ["identify", "--sample", "--model", "a.toml"],
            "a.toml: expected a TOML file, there is no such file",
        ),
        (["identify", "--sample", "--columns", "time"], "expected NAME=COLUMN, found 'time'"),
        (["identify", "--sample", "--coefficients", "yaw_colomb"], "did you mean 'yaw_coulomb'?"),
        (["identify", "--sample", "--vehicle", "four_fan"], "no column 'rear_left'"),
        (["identify", "--sample", "--coefficients", "thrust,thrust"], "coefficient 'thrust' is named twice"),
        (["identify", "--sample", "--while", "time>50"], "time > 50 holds in no row"),
        (
            ["identify", "nothere.csv", "--vehicle", "c17_experiment"],
            "nothere.csv: expected a log file, there is no such file",
        ),
    ],
)
def test_wrong_input_is_one_line_with_status_2_and_nothing_written(call, tmp_path, args, said):
    done = call(*args, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == "" and list(tmp_path.iterdir()) == []


SAMPLE = sample_path().read_text().splitlines()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: [rows[0].replace("psi", "psy"), *rows[1:]], "no column 'psi'; did you mean 'psy'?"),
        (
            lambda rows: [*rows[:50], f"{rows[49].split(',')[0]},{rows[9].split(',', 1)[1]}", *rows[50:]],
            "line 51, column 'time': time repeats",
        ),
        (lambda rows: [*rows[:50], rows[9], *rows[50:]], "line 51, column 'time': time runs backwards"),
        (
            lambda rows: [*rows[:50], *rows[1150:]],
            "1 gap of 22 s, 22 s in total; the median interval between rows is 0.02 s",
        ),
        (lambda rows: [*rows[:50], "0.98,1e30,0,0,0,0", *rows[51:]], "1e+30 in line 51 looks"),
        (lambda rows: [*rows[:50], "0.98,0,abc,0,0,0", *rows[51:]], "line 51, column 'y': expected a number"),
        (lambda rows: rows[:1], "found no rows"),
        (
            lambda rows: [rows[0], *(f"{20 * k},{row.split(',', 1)[1]}" for k, row in enumerate(rows[1:]))],
            "rows are 20 s apart: is its time in seconds?",
        ),
        (lambda rows: [], "line 1: expected a header"),
        (lambda rows: rows[:5], "too few rows"),
    ],
)
def test_a_wrong_log_is_one_line_with_file_and_row(call, tmp_path, change, said):
    (tmp_path / "mine.csv").write_text("\n".join(change(list(SAMPLE))) + "\n")
    done = call("identify", "mine.csv", "--vehicle", "c17_experiment", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr and "mine.csv" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == "" and [p.name for p in tmp_path.iterdir()] == ["mine.csv"]


@pytest.mark.slow("option1")
@pytest.mark.parametrize("option", [[], ["--allow-gaps"]])
def test_a_log_with_gaps_is_accepted_with_one_line(call, tmp_path, option):
    (tmp_path / "mine.csv").write_text("\n".join([*SAMPLE[:700], *SAMPLE[1000:1300], *SAMPLE[1313:]]) + "\n")
    done = call("identify", "mine.csv", "--vehicle", "c17_experiment", *option, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("warning")]
    assert said == [
        "warning: mine.csv: 2 gaps of 6.02 s at most, bridged by the model; "
        "the median interval between rows is 0.02 s"
    ]
    assert "free_run_mine.png" in {p.name for p in (tmp_path / "out").iterdir()}
    assert "--allow-gaps" not in call("identify", "--help", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("training", "holdout"), [("mine.csv", "./mine.csv"), ("mine.csv+c.csv", "out/../mine.csv+d.csv")]
)
def test_a_training_log_under_another_spelling_is_no_hold_out(call, tmp_path, training, holdout):
    (tmp_path / "mine.csv").write_text("\n".join(SAMPLE) + "\n")
    (tmp_path / "out").mkdir()
    done = call("identify", training, "--vehicle", "c17_experiment", "--holdout", holdout, cwd=tmp_path)
    assert done.returncode == 2
    assert f"{holdout} is given twice (as {training}); a held-out log must not be in the fit" in done.stderr


def test_a_rudder_in_degrees_is_one_line(call, tmp_path):
    rows = [row.split(",") for row in SAMPLE]
    at = [name.strip('"') for name in rows[0]].index("rudder")
    for row in rows[1:]:
        row[at] = str(57.29577951 * float(row[at]))
    (tmp_path / "mine.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")
    done = call("identify", "mine.csv", "--vehicle", "c17_experiment", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1
    assert "mine.csv: column 'rudder': expected -0.4538 to 0.4538 rad" in done.stderr
    assert "in degrees?" in done.stderr


@pytest.mark.slow
def test_a_hold_out_predicted_worse_than_trivially_ends_with_status_1(call, tmp_path):
    """The hold-out's commands are those of another time."""
    header, rows = SAMPLE[0], [row.split(",") for row in SAMPLE[1:]]
    (tmp_path / "a.csv").write_text("\n".join(SAMPLE[:1001]) + "\n")
    wrong = [",".join([*row[:4], *rows[k][4:]]) for k, row in enumerate(rows[1000:])]
    (tmp_path / "b.csv").write_text("\n".join([header, *wrong]) + "\n")
    done = call(
        "identify", "a.csv", "--vehicle", "c17_experiment", "--holdout", "b.csv", "--out", "out", cwd=tmp_path
    )
    assert done.returncode == 1, done.stderr
    assert "b: the model predicts" in done.stdout and "not excited" not in done.stdout
    assert "predicted worse 1 s ahead" in " ".join(call("identify", "--help").stdout.split())


def test_slips_with_files_are_told(call, tmp_path):
    (tmp_path / "raft.toml").write_text("[effects]\nthrust = 1.0\n")
    (tmp_path / "run.csv").write_text("time,u,v,r,thrust,rudder\n0,0,0,0,1,0\n")
    for words, said in (
        (("simulate", "rafft.toml"), "there is no such file; did you mean 'raft.toml'?"),
        (("identify", "rum.csv", "--model", "raft.toml"), "no such file; did you mean 'run.csv'?"),
        (
            ("identify", "raft.toml", "--model", "raft.toml"),
            "expected a log (CSV or Parquet), found a .toml file",
        ),
        (
            ("diagnose", "run.csv", "--holdout", "--model", "raft.toml"),
            "found --model: does the option before it lack",
        ),
    ):
        done = call(*words, cwd=tmp_path)
        assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("command", ["identify", "diagnose", "monitor"])
def test_a_users_log_is_read_for_no_craft_that_he_does_not_name(call, tmp_path, command):
    (tmp_path / "mine.csv").write_text("\n".join(SAMPLE) + "\n")
    done = call(command, "mine.csv", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2 and not (tmp_path / "out").exists()
    assert done.stderr.startswith(f"hovercontrol: {command}: expected the model of the logs: --model FILE")
    assert "--vehicle NAME: c17_simulation" in done.stderr and done.stderr.count("\n") == 1
