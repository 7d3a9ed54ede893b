"""A new model file loads, simulates and diagnoses as it is written, and every line in it can be used."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol import InputError, load_model
from hovercontrol.app import cli
from hovercontrol.base.pythonfile import from_python
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.template import KINDS, template
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log, read_log

FILES = {"rudder": "craft.toml", "fan": "craft.toml", "block": "machine.py"}


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["hovercontrol", *map(str, words)])
    with pytest.raises(SystemExit) as done:
        cli.main()
    return done.value.code


def load(path):
    return load_model(path) if path.suffix == ".toml" else from_python(f"{path}:MODEL", BlockModel)


@pytest.mark.parametrize("kind", KINDS)
def test_it_simulates_and_diagnoses_as_written(kind, tmp_path, monkeypatch, capsys):
    path = tmp_path / FILES[kind]
    assert run(monkeypatch, "new", path, "--kind", kind) == 0 and "wrote" in capsys.readouterr().out
    model, rng = load(path), np.random.default_rng(2)
    block = model.plant()
    t = 0.02 * np.arange(700)
    bounds = [(max(s.lower, -0.1), min(s.upper, 0.1 if kind == "fan" else 4.0)) for s in block.inputs]
    u = np.array([np.repeat(rng.uniform(low, high, 20), 35) for low, high in bounds])
    seen = simulated(block, t, u)
    inputs = dict(zip([s.name for s in block.inputs], u, strict=True))
    noisy = {k: y + 1e-3 * rng.normal(size=t.size) for k, y in seen.items()}
    found = diagnose(model, [Log("run", t, noisy | inputs)], names=[model.candidates()[0].name])
    assert found.verdict == "none"


def simulated(block, t, u):
    from hovercontrol.blocks.simulation.trajectory import simulate

    response = simulate(block, t, u)
    return dict(zip(response.output_labels, np.atleast_2d(response.outputs), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_command_takes_it_as_its_head_says(kind, tmp_path, monkeypatch, capsys):
    path, fmu = tmp_path / FILES[kind], tmp_path / "craft.fmu"
    assert run(monkeypatch, "new", path, "--kind", kind) == 0
    assert run(monkeypatch, "simulate", path, "--out", tmp_path / "run") == 0, capsys.readouterr().err
    log = tmp_path / "run" / "log.csv"
    written = read_log(log)
    for s in load(path).plant().inputs:
        assert s.lower <= written[s.name].min() < written[s.name].max() <= s.upper
    assert run(monkeypatch, "check", log, "--model", path, "--out", tmp_path / "check") in (0, 1)
    assert "could estimate" in (tmp_path / "check" / "check.txt").read_text()
    assert run(monkeypatch, "export", path, "-o", fmu) == 0 and fmu.is_file()
    assert all(f"    hovercontrol {name} " in path.read_text() for name in ("simulate", "check", "diagnose"))


def test_a_machine_is_driven_by_the_commands_of_a_log(tmp_path, monkeypatch, capsys):
    """The trolley's v' = F / 50 kg - 0.4 v / s by hand: under 60 N, v = 3 m/s (1 - exp(-0.4 t))."""
    path, t = tmp_path / "trolley.py", 0.1 * np.arange(101)
    path.write_text(template("block", "trolley", path.name), encoding="utf-8")
    Log("force", t, {"force": np.full(t.size, 60.0)}).save(tmp_path / "force.csv")
    done = run(monkeypatch, "simulate", path, "--commands", tmp_path / "force.csv", "--out", tmp_path / "out")
    assert done == 0, capsys.readouterr().err
    log = read_log(tmp_path / "out" / "log.csv")
    assert log.time[-1] == 10.0
    assert log["position"] == pytest.approx(3.0 * (log.time - (1 - np.exp(-0.4 * log.time)) / 0.4), abs=1e-4)


def test_the_cockpit_says_that_it_needs_a_craft(tmp_path, monkeypatch, capsys):
    path = tmp_path / "trolley.py"
    path.write_text(template("block", "trolley", path.name), encoding="utf-8")
    assert run(monkeypatch, "cockpit", "--model", f"{path}:MODEL", "--out", tmp_path, "--no-open") == 2
    said = capsys.readouterr().err
    assert "expected a craft (a model file or a Model), found the Block 'trolley'" in said
    assert len(said.strip().splitlines()) == 1


@pytest.mark.parametrize("kind", ["rudder", "fan"])
def test_every_line_that_is_commented_out_can_be_used(kind, tmp_path):
    lines = template(kind, "craft", "craft.toml").splitlines()
    craft = load_text("\n".join(lines), tmp_path)
    known = {*Effect.known, *(cls.name for cls in craft.candidates())}
    offered = [k for k, line in enumerate(lines) if line.removeprefix("# ").split(" = ")[0] in known]
    names = {lines[k].removeprefix("# ").split(" = ")[0] for k in offered}
    assert names >= {cls.name for cls in craft.candidates()} | {e.name for e in craft.effects}
    for k in offered:
        used = [*lines[:k], lines[k].removeprefix("# "), *lines[k + 1 :]]
        assert isinstance(load_text("\n".join(used), tmp_path), Model)


def load_text(text, folder):
    path = folder / "used.toml"
    path.write_text(text, encoding="utf-8")
    return load_model(path)


def test_what_is_there_is_left_as_it_is_and_wrong_words_are_named(tmp_path, monkeypatch, capsys):
    path = tmp_path / "craft.toml"
    path.write_text("mine", encoding="utf-8")
    assert run(monkeypatch, "new", path) == 2
    assert "expected the name of a new file" in capsys.readouterr().err and path.read_text() == "mine"
    assert run(monkeypatch, "new", tmp_path / "a.toml", "--kind", "fans") == 2
    assert "unknown 'fans'; did you mean 'fan'?" in capsys.readouterr().err
    assert run(monkeypatch, "new", tmp_path / "a.toml", "--kind", "block") == 2
    assert "ends in .py" in capsys.readouterr().err
    with pytest.raises(InputError, match="'2fast' is not a valid model name"):
        template("rudder", "2fast", "2fast.toml")


def test_without_a_file_it_asks_for_kind_file_and_mass(tmp_path, monkeypatch, capsys):
    from hovercontrol.app.commands import new

    monkeypatch.chdir(tmp_path)
    answers = iter(["fan", "", "0.5"])
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    monkeypatch.setattr(new.sys, "stdin", SimpleNamespace(isatty=lambda: True))
    assert new.new() == 0
    craft = load_model("craft.toml")
    assert craft.mass == 0.5 and craft.coefficients()["fan_force"] == 2.0
    monkeypatch.setattr(new.sys, "stdin", SimpleNamespace(isatty=lambda: False))
    with pytest.raises(InputError, match="expected the name of a file"):
        new.new()
