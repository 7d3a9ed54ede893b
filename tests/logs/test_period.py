"""Logs without a column of time: a period gives it, in every format and for every command that reads logs."""

import numpy as np
import pandas as pd
import pytest
import scipy.io

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.logs import gather, read_log

PLANT = """import hovercontrol as hc
y, u = hc.Signal("y", "m/s"), hc.Signal("u", "V")
g, c = hc.Signal("g", "m/s^2/V", start=5.0), hc.Signal("c", "1/s", start=1.0)
PLANT = hc.Block("plant", [y], [u], [y], [g, c], {"y": g.symbol * u.symbol - c.symbol * y.symbol})
"""
PERIOD, G, C = 0.01, 8.0, 2.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """y' = g u - c y with u held from row to row: y[k+1] = a y[k] + (g/c) (1 - a) u[k], a = exp(-c T)."""
    folder, rng = tmp_path_factory.mktemp("logs"), np.random.default_rng(7)
    (folder / "plant.py").write_text(PLANT)
    u, a = np.repeat(rng.uniform(0.0, 1.0, 40), 20), np.exp(-C * PERIOD)
    y = np.zeros(u.size)
    for k in range(u.size - 1):
        y[k + 1] = a * y[k] + G / C * (1.0 - a) * u[k]
    y += 1e-3 * rng.normal(size=u.size)
    table = pd.DataFrame({"y": y, "u": u})
    table.to_csv(folder / "a.csv", index=False)
    table.to_csv(folder / "bare.txt", index=False, header=False, sep=" ")
    table[["y"]].to_csv(folder / "y.csv", index=False)
    table[["u"]].to_csv(folder / "u.csv", index=False)
    table.to_parquet(folder / "a.parquet")
    scipy.io.savemat(folder / "a.mat", {"y": y[:, None], "u": u[:, None]})
    return folder


@pytest.mark.parametrize("name", ["a.csv", "bare.txt", "a.parquet", "a.mat", "y.csv+u.csv"])
def test_rows_are_one_period_apart_in_every_format(folder, monkeypatch, name):
    monkeypatch.chdir(folder)
    columns = {"y": "1", "u": "2"} if name == "bare.txt" else {}
    log = gather(name, ["u"], columns=columns, period=PERIOD)
    assert np.allclose(log.time, PERIOD * np.arange(800))
    assert {"y", "u"} <= log.columns.keys() and len(
        read_log(folder / "a.csv", usecols=[], period=PERIOD)
    ) == 800
    with pytest.raises(InputError, match="period: --period SECONDS"):
        gather(name, ["u"], columns=columns)


@pytest.mark.slow("monitor", "check", "simulate", "sweep", "diagnose")
@pytest.mark.parametrize("command", ["check", "identify", "diagnose", "monitor", "simulate", "sweep"])
def test_every_command_that_reads_a_log_takes_a_period(call, folder, tmp_path, command):
    options = ["--columns", "y=1,u=2", "--period", "0.01", "--out", str(tmp_path / "out")]
    log = [str(folder / "bare.txt"), *options]
    drive = ["plant.py:PLANT", "--commands", *log]
    words = {"simulate": drive, "sweep": [*drive, "--vary", "plant.g=5:8:2", "--of", "y"]}
    done = call(command, *words.get(command, [*log, "--model", "plant.py:PLANT"]), cwd=folder)
    assert done.returncode == 0, done.stderr
    if command == "identify":
        found = pd.read_csv(tmp_path / "out" / "coefficients.csv", index_col="name")
        for name, truth in (("g", G), ("c", C)):
            assert abs(found["value"][name] - truth) < 4.0 * found["std"][name] < 0.01 * truth


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.csv", "--period", "0"], "--period: expected a positive time in seconds, found 0"),
        (["a.csv", "--period", "nan"], "--period: expected a positive time in seconds, found nan"),
        (["a.csv", "--period", "10ms"], "Invalid value for '--period'"),
        (
            ["a.csv", "--period", "0.01", "--columns", "time=y"],
            "no column of time beside --period, found 'y'",
        ),
        (
            ["a.csv"],
            "a.csv: no column 'time'; known: u, y (a column of another name: --columns time=NAME; rows",
        ),
    ],
)
def test_a_wrong_period_is_one_line(call, folder, words, said):
    done = call("identify", *words, "--model", "plant.py:PLANT", "--out", "none", cwd=folder)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1
    assert not (folder / "none").exists()


def test_a_log_with_a_time_takes_no_period(tmp_path):
    (tmp_path / "a.csv").write_text("time,y\n0,1\n1,2\n")
    with pytest.raises(InputError, match="expected no column of time beside --period, found 'time'"):
        hc.read_log(tmp_path / "a.csv", period=0.1)


def test_trials_are_told_by_their_column_where_a_period_gives_the_time(tmp_path):
    (tmp_path / "a.csv").write_text("run,y\n" + "".join(f"{k // 20},{k}\n" for k in range(60)))
    log = hc.read_log(tmp_path / "a.csv", trial="run", period=0.5)
    assert [trial.first for trial in log.trials] == [0, 20, 40]
