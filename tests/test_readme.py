"""Every Python example in README runs as it stands."""

import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest
import typer.main

from hovercontrol.commands.app import app

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_there_are_six_examples():
    assert len(BLOCKS) == 6


def test_every_example_runs_in_order(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # an example writes an FMU
    matplotlib.use("Agg")
    space: dict = {}
    for block in BLOCKS:
        if block.startswith(">>>"):
            command, _, expected = block.partition("\n")
            exec(command.removeprefix(">>> "), space)
            assert capsys.readouterr().out.strip() == expected.strip()
        else:
            exec(block, space)
    assert len(plt.get_fignums()) == 2, "the response's and the region's picture"
    assert space["loop"].to_control().nstates == 83
    line = dict(zip(space["line"].output_labels, space["line"].outputs, strict=True))
    assert abs(line["y"][-1]) < 0.15 and abs(line["rudder_applied"]).max() <= 0.45
    assert (tmp_path / "plant.fmu").stat().st_size > 10_000
    assert space["region"].outside("theorem", "simulated") == []
    assert space["found"].verdict == "effect"
    (slope,) = [e for e in space["found"].effects if e.parameter == "slope_x"]
    assert slope.value == pytest.approx(0.1, abs=3 * slope.std)


def test_it_is_short_and_its_links_lead_somewhere():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150
    links = re.findall(r"\]\((?!https?://)([^)#]+)\)", README.read_text(encoding="utf-8"))
    assert links
    assert not [link for link in links if not (README.parent / link).exists()]


def test_each_command_it_names_is_there():
    text = README.read_text(encoding="utf-8")
    commands = set(re.findall(r"hovercontrol (\w+)", text)) - {"as"}
    known = {command.name for command in typer.main.get_command(app).commands.values()}
    assert commands and commands <= known, commands - known
    for module in re.findall(r"python -m ([\w.]+)", text):
        assert list(README.parent.glob(f"{module.replace('.', '/')}*")), module
