"""``hovercontrol monitor``: a log is replayed, a pipe is followed, wrong input ends in one line."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from hovercontrol.logs import Log

MODEL = '''"""A cart with a motor."""

import hovercontrol as hc

v, F = hc.Signal("v", "m/s"), hc.Signal("F", "N")
m, c = hc.Signal("m", "kg", start=2.0), hc.Signal("c", "1/s", start=0.5)
CART = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
'''
PERIOD = 0.1


def log(name, change=0.0, seed=1, seconds=40.0):
    """The cart in exact steps; its drag c grows by `change` at 20 s."""
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round(seconds / PERIOD))
    F, v, rows = 2.0 * np.sign(np.sin(0.9 * t + 0.1)), 0.0, []
    for k, now in enumerate(t):
        rows.append(v + 0.01 * rng.normal())
        c = 0.5 + (change if now >= 20.0 else 0.0)
        v = F[k] / (2.0 * c) + (v - F[k] / (2.0 * c)) * np.exp(-c * PERIOD)
    return Log(name, t, {"v": np.array(rows), "F": F})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the cart, a reference log, another log without a fault, and one with a change."""
    path = tmp_path_factory.mktemp("cart")
    (path / "cart.py").write_text(MODEL)
    log("sound").save(path / "sound.csv")
    log("same", seed=2).save(path / "same.csv")
    log("drag", change=0.4, seed=3).save(path / "drag.csv")
    t = PERIOD * np.arange(200)
    pose = {"x": np.sin(0.3 * t), "y": np.cos(0.3 * t), "psi": -0.3 * t}
    Log("degrees", t, {**pose, "thrust": 0.5 + 0 * t, "rudder": 20.0 * np.sin(t)}).save(path / "degrees.csv")
    return path


OPTIONS = ["--reference", "sound.csv", "--model", "cart.py:CART", "--candidates", "c,v_bias"]


@pytest.mark.slow
def test_a_change_is_told_and_kept(call, folder):
    done = call("monitor", "drag.csv", *OPTIONS, "--out", "out", cwd=folder)
    assert done.returncode == 1
    alarm = next(line for line in done.stdout.splitlines() if " c changed by " in line)
    assert alarm.startswith("2") and "1/s since" in alarm
    assert "coefficients and noise fitted on sound.csv" in done.stdout
    told = json.loads((folder / "out" / "result.json").read_text())
    assert told["alarms"][0]["name"] == "c" and abs(told["alarms"][0]["change"] - 0.4) < 0.1
    assert (folder / "out" / "timeline.png").is_file()


def _files(folder):
    """Return what lies in a folder; Python's own cache of the model's file aside."""
    return sorted(path for path in folder.iterdir() if path.name != "__pycache__")


@pytest.mark.slow
def test_no_change_is_status_0_and_nothing_is_written(call, folder):
    before = _files(folder)
    done = call("monitor", "same.csv", *OPTIONS, cwd=folder)
    assert done.returncode == 0 and "same.csv: nothing changed in 39.9 s" in done.stdout
    assert _files(folder) == before


@pytest.mark.slow
def test_without_a_sound_log_the_noise_is_that_of_the_first_part(call, folder):
    done = call("monitor", "drag.csv", "--model", "cart.py:CART", "--candidates", "c", "--json", cwd=folder)
    told = json.loads(done.stdout)
    assert done.returncode == 1 and told["alarms"][0]["name"] == "c" and told["files"] == []
    assert "noise taken from the first 13 s of drag.csv" in told["notes"][0]


def test_standard_input_is_followed_line_by_line(call, folder, monkeypatch):
    with (folder / "drag.csv").open() as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        done = call("monitor", "-", "--follow", *OPTIONS, cwd=folder)
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert [e["event"] for e in events] == ["start", "alarm", "named", "end"] and done.returncode == 1
    assert events[2]["name"] == "c" and 20.0 < events[1]["time"] < 23.0
    assert "coefficients and noise fitted on sound.csv" in done.stderr


@pytest.mark.slow
def test_a_growing_file_is_followed_until_ctrl_c(folder, tmp_path):
    path, rows = tmp_path / "live.csv", (folder / "drag.csv").read_text().splitlines(keepends=True)
    path.write_text("".join(rows[:5]))
    words = [sys.executable, "-m", "hovercontrol", "monitor", str(path), "--follow", *OPTIONS]
    running = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert json.loads(running.stdout.readline())["event"] == "start"
        with path.open("a") as file:
            for row in rows[5:]:
                file.write(row)
                file.flush()
        assert json.loads(running.stdout.readline())["event"] == "alarm"
        assert json.loads(running.stdout.readline())["name"] == "c"
        time.sleep(0.3)
        os.kill(running.pid, signal.SIGINT)
        rest, errors = running.communicate(timeout=30)
        assert json.loads(rest)["event"] == "end" and running.returncode == 1
        assert "Traceback" not in errors
    finally:
        running.kill()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "monitor: expected a log"),
        (["drag.csv", "--follow", "--model", "cart.py:CART"], "--follow needs --reference LOG"),
        (["-", *OPTIONS], "- is standard input: add --follow"),
        (["nope.csv", "--follow", *OPTIONS], "nope.csv: no such file"),
        (["drag.csv", *OPTIONS, "--follow", "--out", "o"], "--follow prints JSON lines: no --out"),
        (["drag.csv", *OPTIONS, "--hold", "0"], "--hold: expected a positive time in seconds, found 0"),
        (["drag.csv", *OPTIONS, "--false-alarms-per-hour", "-1"], "expected a positive number, found -1"),
        (["drag.csv", *OPTIONS, "--measured", "w"], "'w'"),
        (["sound.csv", *OPTIONS], "sound.csv is given twice"),
        (["degrees.csv", "--vehicle", "c17_simulation"], "column 'rudder': expected"),
        (["drag.csv", *OPTIONS[:-1], "c,vbias"], "unknown name 'vbias'; did you mean 'v_bias'?"),
    ],
)
def test_wrong_input_is_one_line(call, folder, words, said):
    before = _files(folder)
    done = call("monitor", *words, cwd=folder)
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert _files(folder) == before


def test_help_has_an_example(call, folder):
    done = call("monitor", "--help", cwd=folder)
    assert "Example: hovercontrol monitor today.csv --reference good.csv" in done.stdout
    assert "--follow" in done.stdout
