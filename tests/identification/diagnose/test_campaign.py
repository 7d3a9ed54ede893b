"""An experiment is proposed, run on a machine, and settles what the logs left open."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.app import cli
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.experiment.separate import assurance

V, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2", lower=0.0, upper=3.0)
MODEL = """
import hovercontrol as hc
v, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2", lower=0.0, upper=3.0)
drag = hc.unknown("drag", of=["v"], unit="m/s^2")
CART = hc.Block("cart", [v], [F], [v], [], {"v": F.symbol - drag})
"""
CART = hc.Block("cart", [V], [F], [V], [], {"v": F.symbol - hc.unknown("drag", ["v"], "m/s^2")})


def driven(t: np.ndarray, push: np.ndarray, seed: int) -> hc.Log:
    """A cart with the drag 2 v/(0.6 + v), by Euler's method in small steps, with noise."""
    v, seen = 0.0, []
    for force in push:
        seen.append(v)
        for _ in range(50):
            v += (t[1] - t[0]) / 50 * (force - 2.0 * v / (0.6 + v))
    noise = 2e-3 * np.random.default_rng(seed).normal(size=t.size)
    return hc.Log(f"run {seed}", t, {"v": np.array(seen) + noise, "F": push})


def gentle() -> hc.Log:
    """Pushes so small that a saturating drag looks like an exponential approach."""
    t = np.arange(0.0, 15.0, 0.1)
    return driven(t, np.repeat(np.random.default_rng(3).uniform(0.0, 0.8, 15), 10), 1)


@pytest.mark.slow
def test_one_experiment_settles_the_form_of_a_drag() -> None:
    flown = []

    def fly(proposal: Experiment) -> hc.Log:
        flown.append(proposal)
        return driven(proposal.time, proposal.commands["F"], 10)

    found = hc.experiment(CART, [gentle()], fly=fly, names=[], within={"v": (-1.0, 3.0)})
    first, last = found.diagnoses[0], found.diagnosis
    assert first.verdict == "ambiguous" and flown[0].sure > 0.9
    assert last.verdict == "none" and found.next is None
    assert last.functions[0].forms[0].name == "saturating"
    assert len(found.logs) == 1 + len(flown)
    # shorter than the whole manoeuvre, since less is enough
    assert flown[0].time[-1] < 100.0


@pytest.mark.slow
def test_the_command_remembers_logs_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cart.py").write_text(MODEL)

    def saved(log: hc.Log, name: str) -> None:
        rows = np.column_stack([log.time, log["v"], log["F"]])
        np.savetxt(name, rows, delimiter=",", header="time,v,F", comments="")

    saved(gentle(), "first.csv")

    def said(log: str) -> tuple[int, str]:
        asked = ["experiment", "--model", "cart.py:CART", "--effects", "v_offset", "--out", "out", log]
        monkeypatch.setattr(sys, "argv", ["hovercontrol", *asked])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return int(end.value.code or 0), capsys.readouterr().out

    status, text = said("first.csv")
    assert status == 1 and "probability the logs tell the right one" in text
    t, push = np.loadtxt("out/next_experiment.csv", delimiter=",", skiprows=1).T
    saved(driven(t, push, 11), "second.csv")
    status, text = said("second.csv")
    assert status == 0 and "drag(v) = a v/(b + " in text
    assert len(json.loads(Path("out/experiment.json").read_text())["logs"]) == 2


def test_a_range_of_an_unknown_channel_is_refused() -> None:
    with pytest.raises(hc.InputError, match="no log has 'w'"):
        hc.experiment(CART, [gentle()], within={"w": (0.0, 1.0)})
    with pytest.raises(hc.InputError, match="expected low < high, found 2 and 1"):
        hc.experiment(CART, [gentle()], within={"v": (2.0, 1.0)})


def test_the_assurance_is_that_of_a_normal_log_likelihood_ratio() -> None:
    # twice the log likelihood ratio of a shift d of unit normal samples: mean d^2 n, variance 4 d^2 n
    rng, n, d = np.random.default_rng(0), 100, 0.6
    x = d + rng.normal(size=(20000, n))
    ratio = (x**2 - (x - d) ** 2).sum(axis=1)
    assert np.mean(ratio > 12.0) == pytest.approx(assurance(d**2 * n, 0.0), abs=0.01)
