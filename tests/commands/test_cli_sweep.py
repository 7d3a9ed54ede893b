"""``hovercontrol sweep`` runs a scenario over a range of its numbers."""

import csv
import math

import numpy as np
import pytest

from hovercontrol.errors import InputError
from hovercontrol.scenarios import load_scenario, run_scenario
from hovercontrol.scenarios.varied import vary


def test_one_number_is_a_curve_two_are_a_map(call, tmp_path):
    words = ("k06-forward", "--vary", "controller.k1=0.5:2:4", "--of", "u", "--figure", "final")
    done = call("sweep", *words, "--out", str(tmp_path))
    assert done.returncode == 0 and "largest final of u" in done.stdout
    with (tmp_path / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    m, until = 2.6, load_scenario("k06-forward").end
    for row in rows:  # with v = r = 0 the law makes u' = -k1 (u - u_ref)/m
        exact = 1.1 * (1 - math.exp(-float(row["controller.k1"]) * until / m))
        assert float(row["u.final"]) == pytest.approx(exact, abs=1e-5)
    done = call("sweep", *words, "--vary", "plant.u=0:1:3", "--out", str(tmp_path / "map"))
    assert done.returncode == 0
    assert {f.name for f in (tmp_path / "map").iterdir()} == {"sweep.csv", "sweep.png", "sweep.svg"}


def test_every_phase_is_flown_with_its_own_parameters():
    scenario = load_scenario("table1")
    once = run_scenario(scenario)
    found = vary(scenario, {"controller.k1": np.array([1.9, 2.0])}, "error_y", "final")
    assert found.values[1] == pytest.approx(once.columns["error_y"][-1], abs=1e-7)
    assert found.values[0] != pytest.approx(found.values[1], rel=1e-3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["k06-trun", "--vary", "controller.k2=1:2:3"], "did you mean 'k06-turn'?"),
        (["k06-turn"], "expected one or two --vary"),
        (
            ["k06-turn", "--vary", "controller.k2=1:2"],
            "expected KEY=FROM:TO:POINTS, found 'controller.k2=1:2'",
        ),
        (["k06-turn", "--vary", "controller.k2=2:1:3"], "is reversed"),
        (["k06-turn", "--vary", "controller.k3=1:2:3"], "did you mean 'controller.k2'?"),
        (["k06-turn", "--vary", "controller.k2=-1:2:3"], "controller.k2 = -1 kg/s is out of its bounds"),
        (["k06-turn", "--vary", "controller.k2=1:2:3", "--of", "rr"], "did you mean 'r'?"),
        (["k06-turn", "--vary", "controller.k2=1:2:3", "--figure", "rmse"], "did you mean 'rms'?"),
        (["sample", "--vary", "plant.thrust=1:2:3"], "only scenarios without [commands]"),
    ],
)
def test_wrong_input_is_one_line(call, words, said):
    done = call("sweep", *words)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_too_many_runs_are_refused():
    with pytest.raises(InputError, match="more than 1000000 runs"):
        ranges = {"controller.k1": np.linspace(1, 2, 2000), "controller.k2": np.linspace(1, 2, 2000)}
        vary(load_scenario("k06-turn"), ranges)


def test_a_sweep_that_was_stopped_goes_on_to_the_same_bits(call, tmp_path, monkeypatch):
    from hovercontrol.targets.checkpoint import Checkpoint

    words = ("sweep", "k06-turn", "--vary", "controller.k2=0.5:6:64")
    add, added = Checkpoint.add, []

    def stopped(self, result, part):
        add(self, result, part)
        added.append(part)
        if len(added) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as changed:
        changed.setattr(Checkpoint, "add", stopped)
        done = call(*words, "--out", "out", cwd=tmp_path)
    said = "hovercontrol: stopped; results so far are kept in out.partial; continue with --resume\n"
    assert (done.returncode, done.stderr) == (130, said)
    assert [p.name for p in tmp_path.iterdir()] == ["out.partial"]
    done = call(*words[:3], "controller.k2=0.5:7:64", "--resume", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2 and "belongs to another sweep" in done.stderr
    monkeypatch.setattr(Checkpoint, "add", lambda *of: (added.append(of[2]), add(*of)))
    assert call(*words, "--resume", "--out", "out", cwd=tmp_path).returncode == 0
    assert len(added) == 4 and len({part.start for part in added}) == 4
    assert call(*words, "--out", "whole", cwd=tmp_path).returncode == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "whole"]
    one, other = ((tmp_path / name / "sweep.csv").read_bytes() for name in ("out", "whole"))
    assert one == other
