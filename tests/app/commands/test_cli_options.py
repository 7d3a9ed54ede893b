"""Options that are wrong end a command with status 2, one line, and nothing written."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.base.errors import did_you_mean
from hovercontrol.fmi.exporter.binaries import PLATFORMS, chosen_platforms
from hovercontrol.logs import Log

VARY = ["--vary", "controller.k2=1:2:3"]


@pytest.fixture
def folder(tmp_path):
    t = 0.02 * np.arange(300)
    columns = {"x": np.sin(t), "y": 0.3 * t, "psi": 0.1 * t, "lift": 1.0 * (t > 2)}
    Log("a", t, columns).save(tmp_path / "a.csv")
    Log("b", t, {k: v for k, v in columns.items() if k != "lift"}).save(tmp_path / "b.csv")
    return tmp_path


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--columns", "x=nope"], "a.csv: no column 'nope' to read 'x' from"),
        (["--columns", "psi=psi:furlong"], "read as 'furlong': expected a unit like 'rad'"),
        (["--columns", "x=x,x=y"], "--columns: 'x' is given twice: 'x' and 'y'"),
        (["--columns", "x=y,psi=y"], "column 'y' is to be both 'x' and 'psi'"),
        (["--columns", "x=x", "--columns", "y=y"], "check: --columns is given 2 times, expected once"),
        (["--frame", "nde"], "frame: expected one of z-up, enu, ned, found 'nde'"),
        (["--while", "lifd>0"], "condition: no column 'lifd'; did you mean 'lift'?"),
        (["--while", "lift>5"], "lift > 5 holds in no row"),
        (["--while", "lift>0", "--settle", "60"], "nothing is left after 60 s to settle"),
        (["a.csv"], "check: a.csv is given twice"),
    ],
)
def test_an_option_of_check_that_fits_no_log_is_wrong(call, folder, options, said):
    done = call("check", "a.csv", *options, cwd=folder)
    assert done.returncode == 2, done.stdout
    assert said in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == "" and not (folder / "out").exists()


@pytest.mark.slow
def test_an_option_that_fits_one_log_of_two_is_a_finding_about_the_other(call, folder):
    done = call("check", "a.csv", "b.csv", "--while", "lift>0", "--settle", "0", cwd=folder)
    assert done.returncode == 1 and "b.csv: condition: no column 'lift'; known" in done.stdout
    assert (folder / "out" / "check" / "check.json").is_file()


def test_a_log_that_cannot_be_read_is_a_finding(call, folder):
    (folder / "bad.csv").write_text("time,x,y,psi\n0,0,0,0\n0,0,0,1\n")
    done = call("check", "bad.csv", cwd=folder)
    assert done.returncode == 1 and "time repeats" in done.stdout


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (
            ["sweep", "k06-turn", *["--vary", "controller.k2=1:2:3"] * 2],
            "--vary controller.k2 is given twice",
        ),
        (["sweep", "k06-turn", *VARY, *VARY], "--vary controller.k2 is given twice"),
        (["sweep", "k06-turn", *VARY, "--of", "r", "--of", "u"], "--of is given 2 times"),
        (["export", "table1", "--platforms", "all", "--platforms", "all"], "--platforms is given 2 times"),
        (
            ["export", "table1", "--platforms", ","],
            "platforms: expected one or more names, found none; known: ",
        ),
        (["export", "table1", "--platforms", "all,nope"], "unknown platform 'nope'; known: "),
        (["export", "table1", "--platforms", "all,al"], "unknown platform 'al'; did you mean 'all'?"),
    ],
)
def test_what_is_given_twice_does_not_win_silently(call, tmp_path, args, said):
    done = call(*args, cwd=tmp_path)
    assert done.returncode == 2 and said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and list(tmp_path.iterdir()) == []


def test_all_platforms_are_all_whatever_is_beside():
    assert chosen_platforms("all,x86_64-linux") == chosen_platforms("all") == tuple(PLATFORMS.values())


def test_a_name_is_never_proposed_for_itself():
    assert did_you_mean("all", ["all", "ball"]) == "; did you mean 'ball'?"
    assert did_you_mean("all", ["all", "windows"]) == "; known: windows"


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["simulate", "craft.toml", "--duration", "1e9"], "expected a run of at most 40000 s, found 1e+09 s"),
        (
            ["simulate", "craft.toml", "--columns", "thrust=a"],
            "--columns belongs to the log of --commands",
        ),
        (["identify", "a.csv", "--coefficients", ","], "--coefficients: expected names separated by commas"),
        (
            ["diagnose", "a.csv", "--vehicle", "c17_experiment", "--effects", "slope,wind,slope"],
            "--effects: 'slope' is given twice",
        ),
        (["analyze", "nope"], "unknown analysis or item 'nope'; known: "),
        (["identify", "a.csv", "--model", "hoverdemon"], "the built-in craft is --vehicle hoverdemon"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_any_work(call, folder, args, said):
    call("new", "craft.toml", cwd=folder)
    before = sorted(folder.iterdir())
    done = call(*args, cwd=folder)
    assert done.returncode == 2 and said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and sorted(folder.iterdir()) == before
