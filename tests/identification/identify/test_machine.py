"""A machine of one's own is identified like a craft: as a Block, as a BlockModel, from a Python file."""

import csv
import json
import sys

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.app import cli
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.identify.study import Study

SOURCE = """
import hovercontrol as hc
v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
gain = hc.Signal("gain", "m/s^2/V", start=1.0, lower=0.0)
drag = hc.Signal("drag", "1/s", start=1.0, lower=0.0)
CART = hc.Block(
    "cart", [v], [u], [v], [gain, drag], {"v": gain.symbol * u.symbol - drag.symbol * v.symbol}
)
MODEL = hc.BlockModel(CART)
"""
space = {}
exec(SOURCE, space)
CART, MODEL = space["CART"], space["MODEL"]
TRUTH = {"gain": 2.0, "drag": 0.7}


def run_of(seed, delay=0, seconds=20.0):
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, 0.02)
    u = np.repeat(rng.uniform(-1, 1, t.size // 50 + 1), 50)[: t.size]
    v = np.zeros(t.size)
    late = np.concatenate([np.zeros(delay), u])[: t.size]
    for i in range(t.size - 1):
        end = TRUTH["gain"] * late[i] / TRUTH["drag"]
        v[i + 1] = end + (v[i] - end) * np.exp(-TRUTH["drag"] * 0.02)
    return hc.Log(f"run{seed}.csv", t, {"u": u, "v": v + 2e-3 * rng.normal(size=t.size)})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "cart.py").write_text(SOURCE, encoding="utf-8")
    for seed in (1, 2, 3):
        run_of(seed, delay=3).save(tmp_path / f"run{seed}.csv")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(monkeypatch, capsys, *words):
    monkeypatch.setattr(sys, "argv", ["hovercontrol", *map(str, words)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, err = capsys.readouterr()
    return end.value.code or 0, out, err


@pytest.mark.slow
def test_block_and_blockmodel_are_the_same_call():
    log = run_of(1)
    found, other = hc.identify(CART, [log]), hc.identify(MODEL, [log])
    assert found.table() == other.table()
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 4 * found[name].std < 0.1 * value
    assert found.model.coefficients() == {name: found[name].value for name in TRUTH}
    assert found.block == found.model.plant()
    # equal but for rounding: sums of BLAS depend on where an array lies in memory
    assert other.block.default_parameters == pytest.approx(found.block.default_parameters, rel=1e-9)
    assert other.block.derivatives == found.block.derivatives
    mine, others = (hc.check(model, [log]).coefficients for model in (CART, MODEL))
    assert [(row.name, row.unit) for row in mine] == [(row.name, row.unit) for row in others]
    assert [row.value for row in mine] == pytest.approx([row.value for row in others], rel=1e-9)


def test_a_model_with_effects_is_identified_with_them():
    late = MODEL.with_effects([MODEL.effect_class("input_delay")(seconds=0.06)])
    found = hc.identify(late, [run_of(1, delay=3)])
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 4 * found[name].std
    assert found.model.effects == late.effects and found.block.delays


@pytest.mark.slow
def test_parameters_that_are_not_linear_are_fitted_and_not_confused_between_models():
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "N")
    m, d = hc.Signal("m", "kg", start=1.0, lower=0.1), hc.Signal("d", "1/s", start=0.7)
    slope = u.symbol / m.symbol - d.symbol * v.symbol
    block = hc.Block("mass", [v], [u], [v], [m, d], {"v": slope})
    assert as_model(block).linear_coefficients() == ("d",)
    assert as_model(block).coefficients() == {"m": 1.0, "d": 0.7}
    for start in (1.0, 0.4):  # the equations are the same, the start is another
        assert hc.identify(block.with_values({"m": start}), [run_of(1)], ["m"])["m"].start == start
    found = hc.identify(hc.BlockModel(block), [run_of(1)], ["mass.m", "d"])
    assert found["m"].value == pytest.approx(0.5, abs=4 * found["m"].std)
    heavy = hc.identify(hc.BlockModel(block.with_values({"m": 2.0})), [run_of(1)], ["d"])
    light = hc.identify(hc.BlockModel(block.with_values({"m": 0.5})), [run_of(1)], ["d"])
    assert light["d"].value == pytest.approx(0.7, rel=0.02) and heavy["d"].value != light["d"].value


def test_parameters_of_two_parts_with_one_name_keep_their_keys():
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
    a, b = hc.Signal("motor.k", "m/s^2/V", start=1.0), hc.Signal("rail.k", "1/s", start=1.0)
    block = hc.Block("cart", [v], [u], [v], [a, b], {"v": a.symbol * u.symbol - b.symbol * v.symbol})
    assert as_model(block).coefficients() == {"motor.k": 1.0, "rail.k": 1.0}
    found = hc.identify(hc.BlockModel(block), [run_of(1)])
    assert found["motor.k"].value == pytest.approx(2.0, rel=0.02)
    assert found["rail.k"].value == pytest.approx(0.7, rel=0.02)
    assert found.model.coefficients()["rail.k"] == found["rail.k"].value
    assert hc.identify(block, [run_of(1)], ["rail.k"]).coefficients[0].name in ("k", "rail.k")


def test_a_study_of_a_block_can_be_used_again(tmp_path):
    study = Study.make(CART, [run_of(1)], [run_of(2)])
    files = {f.name for f in study.save(tmp_path)}
    assert {"parameters.toml", "coefficients.csv", "prediction.csv"} <= files and "model.toml" not in files
    assert hc.load_parameters(CART, tmp_path / "parameters.toml").plant() == study.found.block
    assert not study.negative and "craft" not in study.text() and "body" not in study.text()
    assert study.judged[1].channels == ("v",) and study.judged[1].prediction.share["v"] < 0.1


def test_a_log_of_less_than_the_horizon_and_a_slow_one_are_judged_as_they_can(tmp_path):
    short = run_of(1, seconds=1.2).between(0.0, 0.8)
    assert Study.make(CART, [short]).judged[0].prediction.horizon == pytest.approx(0.39, abs=0.02)


def test_the_command_identifies_a_block_from_a_python_file(folder, monkeypatch, capsys):
    words = ("run1.csv", "--holdout", "run2.csv", "--holdout", "run3.csv", "--out", "found")
    code, out, err = call(monkeypatch, capsys, "identify", *words, "--model", "cart.py:CART")
    assert code in (0, 1) and "unexpected" not in err
    assert "run2 (held out)" in out and "run3 (held out)" in out and "parameters.toml" in out
    found = hc.load_parameters(CART, "found/parameters.toml").coefficients()
    with (folder / "found" / "coefficients.csv").open() as file:
        assert found == {row["name"]: float(row["value"]) for row in csv.DictReader(file)}
    code, _, err = call(monkeypatch, capsys, "identify", "run1.csv", "--model", "cart.py:CARD")
    assert code == 2 and "did you mean 'CART'?" in err and len(err.strip().splitlines()) == 1


@pytest.mark.slow
def test_every_command_takes_what_diagnose_found(folder, monkeypatch, capsys):
    words = ("run1.csv", "run2.csv", "--holdout", "run3.csv", "--model", "cart.py:MODEL", "--json")
    code, out, _ = call(monkeypatch, capsys, "diagnose", *words, "--out", "lacks")
    result = json.loads(out)
    assert code == 0 and [e["name"] for e in result["effects"]] == ["input_delay"]
    names = [c["name"] for c in result["coefficients"]]
    assert names == ["gain", "drag", "input_delay_seconds"]
    best = result["coefficients"][names.index("gain")]
    assert abs(best["value"] - 2.0) < 4 * best["std"] and best["start"] == 1.0 and best["unit"] == "m/s^2/V"
    assert result["coefficients"][2]["start"] is None
    with_params = ("cart.py:CART", "--params", "lacks/parameters.toml")
    code, out, err = call(monkeypatch, capsys, "simulate", *with_params, "--commands", "run3.csv", "-o", "s")
    assert code == 0, err
    ran, seen = hc.read_log("s/log.csv", model=CART), hc.read_log("run3.csv")
    assert np.std(ran["v"][: len(seen)] - seen["v"][: len(ran)]) < 0.01
    code, out, err = call(monkeypatch, capsys, "check", "run3.csv", "--model", *with_params, "-o", "c")
    assert code == 0 and "gain" in out, err
    code, _, err = call(monkeypatch, capsys, "simulate", "table1", "--params", "lacks/parameters.toml")
    assert code == 2 and "--params belongs to a model FILE.py:NAME, found table1" in err
