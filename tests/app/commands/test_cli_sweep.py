"""``hovercontrol sweep`` runs a scenario over a range of its numbers."""

import csv
import math

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.base.folders import own_folder
from hovercontrol.craft.models.template import template
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.drive import driven
from hovercontrol.documents.scenarios.grid import vary


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
    assert {f.name for f in (tmp_path / "map").glob("sweep.*")} == {"sweep.csv", "sweep.png", "sweep.svg"}


def test_every_phase_is_flown_with_its_own_parameters():
    scenario = load_scenario("table1")
    once = run_scenario(scenario)
    found = vary(scenario, {"controller.k1": np.array([1.9, 2.0])}, "error_y", "final")
    assert found.values[1] == pytest.approx(once.columns["error_y"][-1], abs=1e-7)
    assert found.values[0] != pytest.approx(found.values[1], rel=1e-3)


def test_commands_that_a_scenario_plays_are_the_same_in_all_runs():
    scenario = driven(vehicle("c17_experiment"), "steps")
    thrust = scenario.plant.coefficients()["thrust"]
    found = vary(scenario, {"plant.thrust": np.array([0.9 * thrust, thrust])}, "u", "final")
    assert found.values[1] == pytest.approx(run_scenario(scenario).columns["u"][-1], abs=1e-6)
    assert found.values[0] != pytest.approx(found.values[1], rel=1e-3)


def test_a_machine_of_ones_own_is_driven_at_every_point(call, tmp_path):
    path = tmp_path / "trolley.py"
    path.write_text(template("block", "trolley", path.name), encoding="utf-8")
    words = ("--vary", "trolley.mass=25:100:4", "--of", "position", "--figure", "final")
    done = call("sweep", f"{path}:MODEL", *words, "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out" / "sweep.csv").open() as file:
        found = [float(row["position.final"]) for row in csv.DictReader(file)]
    assert found == pytest.approx([found[0] / k for k in (1, 2, 3, 4)]), "linear in the force per mass"
    done = call("sweep", f"{path}:BLOCK", *words, "--vary", "trolley.dragg=1:2:2")
    assert done.returncode == 2 and "did you mean 'trolley.drag'?" in done.stderr


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
    from hovercontrol.blocks.backends.checkpoint import Checkpoint

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


# ---- the user's own files --------------------------------------------------------------------------------

WORDS = ("sweep", "k06-turn", "--vary", "controller.k2=0.5:6:4")


def test_a_users_folder_of_the_name_of_the_partial_results_is_refused_and_kept(call, tmp_path):
    (tmp_path / "res.partial" / "thesis").mkdir(parents=True)
    (tmp_path / "res.partial" / "thesis" / "text.tex").write_text("years")
    for words in ((), ("--resume",)):
        done = call(*WORDS, *words, "--out", "res", cwd=tmp_path)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "res.partial: expected a folder of unfinished results, found files of other" in done.stderr
    assert (tmp_path / "res.partial" / "thesis" / "text.tex").read_text() == "years"
    assert [p.name for p in tmp_path.iterdir()] == ["res.partial"]


def test_a_link_of_the_name_of_the_partial_results_receives_nothing(call, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "res.partial").symlink_to("far")
    done = call(*WORDS, "--out", "res", cwd=tmp_path)
    assert done.returncode == 2 and "found a symbolic link" in done.stderr
    assert list((tmp_path / "far").iterdir()) == [] and (tmp_path / "res.partial").is_symlink()
    (tmp_path / "res.partial").unlink()
    own_folder(tmp_path / "res.partial")
    (tmp_path / "res.partial" / "phase-1").symlink_to(tmp_path / "far")
    assert call(*WORDS, "--resume", "--out", "res", cwd=tmp_path).returncode == 2
    assert list((tmp_path / "far").iterdir()) == []


def test_what_a_user_puts_among_partial_results_outlives_them(call, tmp_path):
    own_folder(tmp_path / "res.partial")
    (tmp_path / "res.partial" / "phase-1").mkdir()
    mine = [tmp_path / "res.partial" / name for name in ("notes.txt", "phase-1/notes.txt")]
    for file in mine:
        file.write_text("mine")
    assert call(*WORDS, "--out", "res", cwd=tmp_path).returncode == 2, "it is not a folder of results alone"
    assert [file.read_text() for file in mine] == ["mine", "mine"]


@pytest.mark.parametrize("out", ["/", "//", "/.."])
def test_the_root_is_no_folder_for_a_sweep(call, tmp_path, out):
    done = call(*WORDS, "--out", out, cwd=tmp_path)
    assert done.returncode == 2 and "--out: expected a folder with a name, found /" in done.stderr


def test_a_refused_sweep_leaves_nothing(call, tmp_path):
    done = call("sweep", "k06-turn", "--vary", "controller.k3=1:2:3", cwd=tmp_path)
    assert done.returncode == 2 and list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_damaged_partial_result_is_said_and_computed_again(call, tmp_path, monkeypatch):
    from hovercontrol.blocks.backends.checkpoint import Checkpoint

    add = Checkpoint.add

    def stopped(self, result, part):
        add(self, result, part)
        raise KeyboardInterrupt

    words = ("sweep", "k06-turn", "--vary", "controller.k2=0.5:6:32")
    with monkeypatch.context() as changed:
        changed.setattr(Checkpoint, "add", stopped)
        assert call(*words, "--out", "out", cwd=tmp_path).returncode == 130
    (file,) = (tmp_path / "out.partial").glob("*/*.parquet")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 4
    file.write_bytes(content)
    done = call(*words, "--resume", "--out", "out", cwd=tmp_path)
    said = [line for line in done.stderr.splitlines() if line.startswith("warning")]
    assert done.returncode == 0 and len(said) == 1 and "damaged; its runs are computed again" in said[0]
    assert call(*words, "--out", "whole", cwd=tmp_path).returncode == 0
    one, other = ((tmp_path / name / "sweep.csv").read_bytes() for name in ("out", "whole"))
    assert one == other and not (tmp_path / "out.partial").exists()
