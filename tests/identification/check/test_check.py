"""A check of logs finds what was put into them: rates, gaps, jitter, outliers, noise, units, excitation."""

import json
import re
import sys

import numpy as np
import pytest
import sympy as sp
from matplotlib.quiver import Quiver

import hovercontrol as hc
from hovercontrol import vehicle
from hovercontrol.app import cli
from hovercontrol.documents.samples import sample_path
from hovercontrol.identification.check import check, facts
from hovercontrol.logs import Log

CRAFT = vehicle("c17_experiment")


def driven(seconds=12.0, seed=0, **commands):
    """A log of the craft at 50 Hz with 1 mm, 1 mrad, 5 mm/s, 5 mrad/s of noise."""
    rng, t = np.random.default_rng(seed), 0.02 * np.arange(round(50 * seconds))
    u = {
        "thrust": np.repeat(rng.uniform(2.0, 5.0, t.size), 40)[: t.size],
        "rudder": np.repeat(rng.uniform(-0.4, 0.4, t.size), 30)[: t.size],
    } | {name: np.full(t.size, value) for name, value in commands.items()}
    run = CRAFT.plant().compile(friction="smooth").simulate(t, u)
    size = dict(zip(["x", "y", "psi", "u", "v", "r"], (1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3), strict=True))
    columns = {
        k: row + size[k] * rng.normal(size=t.size)
        for k, row in zip(run.output_labels, run.outputs, strict=True)
    }
    return Log("run.csv", t, columns | u)


@pytest.fixture(scope="module")
def log():
    return driven()


@pytest.fixture(scope="module")
def checked(log):
    return check(CRAFT, [log])


def test_a_good_log_is_good_and_shows_its_coefficients(checked):
    assert checked.errors == () and not checked.negative
    assert {c.name for c in checked.coefficients} == set(CRAFT.linear_coefficients())
    thrust = next(c for c in checked.coefficients if c.name == "thrust")
    assert abs(thrust.value - 0.75) < 4 * thrust.std < 0.05


def test_times_in_another_unit_end_before_the_trial_fit():
    q, w, torque = hc.Signal("q", "rad"), hc.Signal("w", "rad/s"), hc.Signal("torque", "rad/s^2")
    k, g = hc.Signal("k", "1/s", start=0.1), hc.Signal("g", "1/s^2", start=19.0)
    swing = torque.symbol - g.symbol * sp.sin(q.symbol) - k.symbol * w.symbol
    pendulum = hc.Block("pendulum", [q, w], [torque], [q], [k, g], {"q": w.symbol, "w": swing})
    t = 0.01 * np.arange(2500)
    log = Log("swing", 1e3 * t, {"q": np.sin(4.0 * t), "torque": np.cos(3.0 * t)})
    found = check(hc.BlockModel(pendulum), [log])
    # |s|^2 = 19 cos 1 for both, |s| = 3.2/s, so that pi/|s| = 0.98 s
    said = "swing: rows are 10 s apart, all motion of the model is over in 0.98 s: is the unit of time wrong"
    assert [line.partition(" (--")[0] for line in found.errors] == [said] and found.negative
    assert found.coefficients == ()


def test_rate_noise_and_commands_are_those_of_the_log(checked):
    columns = {c.name: c for c in checked.logs[0].columns}
    timing = checked.logs[0].timing[0]
    assert timing.rate == pytest.approx(50.0) and timing.steady and not timing.gaps
    assert columns["x"].noise == pytest.approx(1e-3, rel=0.15)
    assert columns["r"].noise == pytest.approx(5e-3, rel=0.15)
    assert columns["thrust"].kind == "command" and columns["thrust"].change_every == pytest.approx(0.8)
    assert columns["rudder"].unit == "rad" and columns["x"].outliers == ()


def test_what_is_put_into_a_log_is_found(log):
    rng = np.random.default_rng(1)
    keep = (log.time < 5.0) | (log.time > 6.5)
    jittered = log.time + np.abs(rng.normal(size=len(log))) * 2e-3
    spoilt = log["x"].copy()
    spoilt[[100, 450]] += 0.3
    bad = Log("bad.csv", jittered, {**log.columns, "x": spoilt}).select(keep)
    found = facts(bad, ["thrust", "rudder"])
    (gap,) = found.timing[0].gaps
    assert gap == pytest.approx((5.0, 6.5), abs=0.05)
    assert found.timing[0].jitter == pytest.approx(2e-3 * np.sqrt(1 - 2 / np.pi), rel=0.15)
    assert found.timing[0].steady and found.timing[0].rate == pytest.approx(50.0, rel=1e-3)
    times = next(c for c in found.columns if c.name == "x").outliers
    assert times == pytest.approx([2.0, 9.0], abs=0.02)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda c: {"psi": np.degrees(c["psi"])}, "psi.*expected a heading in rad"),
        (lambda c: {"r": np.degrees(c["r"])}, "'r': expected a yaw rate in rad/s"),
        (lambda c: {"x": 1e3 * c["x"], "y": 1e3 * c["y"]}, "the position moves 1000 times.*in mm"),
        (lambda c: {"rudder": np.degrees(c["rudder"])}, "'rudder'.*is it in degrees"),
        (lambda c: {"v": 0 * c["v"]}, "'v' is constant"),
    ],
)
def test_wrong_units_are_findings_and_no_exceptions(log, change, line):
    wrong = Log("wrong.csv", log.time, {**log.columns, **change(log.columns)})
    found = check(CRAFT, [wrong])
    assert found.negative and len(found.errors) == 1
    assert re.search(line, found.errors[0]), found.errors
    assert found.coefficients == () and len(found.logs) == 1
    assert "must be corrected" in found.text()


def test_what_the_commands_do_not_excite_is_told():
    found = check(CRAFT, [driven(8.0, rudder=0.0)])
    hidden = {c.name for c in found.coefficients if not c.excited}
    assert {"rudder_torque", "yaw_linear_drag"} <= hidden and "thrust" not in hidden
    assert found.negative and "no: nothing measured depends on it" in found.text()


def test_a_log_given_twice_is_an_error(log):
    found = check(CRAFT, [log, Log("again.csv", log.time, log.columns)])
    assert "again.csv" in found.errors[0]


@pytest.mark.slow
def test_it_is_json_and_a_picture(checked, tmp_path):
    files = checked.save(tmp_path)
    assert [f.name for f in files] == ["check.json", "check.png", "check.svg", "check.txt"]
    told = json.loads((tmp_path / "check.json").read_text())
    assert told["logs"][0]["timing"][0]["rate"] == pytest.approx(50.0)
    assert {c["name"] for c in told["coefficients"] if c["shown"]} == set(CRAFT.linear_coefficients())
    axes = [a for sub in checked.plot().subfigs for a in sub.axes]
    assert [a.get_ylabel() for a in axes[:3]] == ["x [m]", "y [m]", "psi [rad]"]
    assert axes[-1].get_xlabel().startswith("standard error")
    path = next(a for a in axes if a.get_xlabel() == "x [m]")
    (headings,) = (c for c in path.collections if isinstance(c, Quiver))
    assert pytest.approx(1.0) == headings.U**2 + headings.V**2


@pytest.mark.slow
def test_the_command_prints_json_alone_and_reads_two_files(log, tmp_path, capsys, monkeypatch):
    pose = Log("pose", log.time, {k: log[k] for k in ("x", "y", "psi")})
    sent = log.select(slice(None, None, 3))
    pose.save(tmp_path / "pose.csv")
    Log("sent", sent.time, {k: sent[k] for k in ("thrust", "rudder")}).save(tmp_path / "sent.csv")
    monkeypatch.setattr(
        sys, "argv",
        ["hovercontrol", "check", f"{tmp_path}/pose.csv+{tmp_path}/sent.csv", "--vehicle", "c17_experiment",
         "--json", "--out", str(tmp_path / "out")],
    )  # fmt: skip
    with pytest.raises(SystemExit) as done:
        cli.main()
    told = json.loads(capsys.readouterr().out)
    assert done.value.code == (1 if any(not c["shown"] for c in told["coefficients"]) else 0)
    assert [t["rate"] for t in told["logs"][0]["timing"]] == pytest.approx([50.0, 50.0 / 3], rel=1e-6)
    assert (tmp_path / "out" / "check.svg").exists()


def test_a_log_that_cannot_be_read_is_a_finding_and_a_missing_one_bad_input(
    log, tmp_path, capsys, monkeypatch
):
    Log("d", log.time, {**log.columns, "psi": np.degrees(log["psi"])}).save(tmp_path / "degrees.csv")
    for name, status in (("degrees.csv", 1), ("nowhere.csv", 2)):
        monkeypatch.setattr(
            sys, "argv", ["hovercontrol", "check", f"{tmp_path}/{name}", "--json", "--out", f"{tmp_path}/out"]
        )
        with pytest.raises(SystemExit) as done:
            cli.main()
        assert done.value.code == status
    told = json.loads(capsys.readouterr().out)
    assert "look like degrees" in told["errors"][0] and told["logs"] == []


def test_the_sample_log_without_a_model(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["hovercontrol", "check", str(sample_path())])
    with pytest.raises(SystemExit) as done:
        cli.main()
    assert done.value.code == 0 and "no error found" in capsys.readouterr().out


def test_a_log_of_a_navigation_is_told_from_one_with_wrong_poses():
    t, rng = 0.01 * np.arange(3000), np.random.default_rng(4)
    fixes = 0.03 * np.cumsum(rng.normal(size=31))[(t // 1).astype(int)]
    still = {name: 1e-4 * rng.normal(size=t.size) for name in ("y", "psi", "v", "r")}
    moves = {"x": 0.5 * t + fixes + 1e-4 * rng.normal(size=t.size), "u": 0.5 + 1e-3 * rng.normal(size=t.size)}
    found = facts(Log("ins.csv", t, still | moves))
    assert found.rejected == () and "output of a navigation" in found.remarks[0]


@pytest.mark.slow
def test_the_picture_of_a_long_log_is_small(tmp_path):
    t = 0.01 * np.arange(50_000)
    rng = np.random.default_rng(0)
    jitter = 1e-3 * rng.uniform(size=t.size)
    pose = {"x": np.sin(t) + 1e-3 * rng.normal(size=t.size), "y": np.cos(t), "psi": 0.1 * t}
    check(None, [Log("long.csv", t + jitter, pose)]).save(tmp_path)
    assert (tmp_path / "check.svg").stat().st_size < 2_000_000  # each stamp takes 80 bytes


def test_spans_are_shaded_as_one():
    t = 0.02 * np.arange(20_000)
    t = t + 0.5 * np.repeat(np.arange(200), 100)  # 199 gaps
    axes = check(None, [Log("gaps.csv", t, {"r": np.sin(t)})]).plot().axes
    assert all(len(a.patches) < 10 for a in axes) and any(len(a.collections) for a in axes)


def test_outliers_of_a_long_log_are_found_piece_by_piece(monkeypatch):
    rng, t = np.random.default_rng(4), 0.02 * np.arange(3000)
    row = np.sin(t) + 0.01 * rng.normal(size=t.size)
    at = np.unique(rng.integers(0, t.size, 60))
    row[at] += rng.choice([-1.0, 1.0], at.size)
    log = Log("long.csv", t, {"r": row})
    whole = facts(log).columns[0].outliers
    monkeypatch.setattr(sys.modules["hovercontrol.identification.check.facts"], "PIECE", 100)
    assert facts(log).columns[0].outliers == whole and len(whole) > 40
