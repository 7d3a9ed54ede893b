"""A new model file loads, simulates and diagnoses as it is written, and every line in it can be used."""

import sys

import numpy as np
import pytest

from hovercontrol import InputError, cli, load_model
from hovercontrol.discrepancy import diagnose
from hovercontrol.effects import Effect
from hovercontrol.io.pythonfile import from_python
from hovercontrol.logs import Log
from hovercontrol.models.blockmodel import BlockModel
from hovercontrol.models.model import Model
from hovercontrol.models.template import KINDS, template

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
    from hovercontrol.simulation.trajectory import simulate

    response = simulate(block, t, u)
    return dict(zip(response.output_labels, np.atleast_2d(response.outputs), strict=True))


@pytest.mark.parametrize("kind", ["rudder", "fan"])
def test_every_line_that_is_commented_out_can_be_used(kind, tmp_path):
    lines = template(kind, "craft", "craft.toml").splitlines()
    craft = load_text("\n".join(lines), tmp_path)
    offered = [k for k, line in enumerate(lines) if line.removeprefix("# ").split(" = ")[0] in Effect.known]
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
    assert "exists already" in capsys.readouterr().err and path.read_text() == "mine"
    assert run(monkeypatch, "new", tmp_path / "a.toml", "--kind", "fans") == 2
    assert "unknown 'fans'; did you mean 'fan'?" in capsys.readouterr().err
    assert run(monkeypatch, "new", tmp_path / "a.toml", "--kind", "block") == 2
    assert "ends in .py" in capsys.readouterr().err
    with pytest.raises(InputError, match="'2fast' is no name"):
        template("rudder", "2fast", "2fast.toml")
