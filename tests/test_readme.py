"""The examples of README and of the page of short examples run as they stand."""

import os
import re
import shlex
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import typer.main
from PIL import Image

from hovercontrol.app.commands.app import app

PROJECT = Path(__file__).parents[1]
README = PROJECT / "README.md"
TEXT = README.read_text(encoding="utf-8")
SHORT = (PROJECT / "docs" / "examples.md").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the examples write FMUs
    yield tmp_path
    plt.close("all")


def test_its_example_of_ten_lines_runs_and_the_craft_reaches_the_ellipse(own_folder):
    (block,) = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    assert len([line for line in block.splitlines() if line]) <= 10
    space: dict = {}
    exec(block, space)
    run = dict(zip(space["run"].output_labels, space["run"].outputs, strict=True))
    error = np.hypot(run["error_x"], run["error_y"])
    assert error[0] > 1.0 and error[-1] < 0.02
    assert space["system"].nstates == 6
    assert (own_folder / "ellipse.fmu").stat().st_size > 10_000
    assert len(plt.get_fignums()) == 1


def test_its_picture_is_small():
    picture = PROJECT / "docs" / "craft.png"
    assert picture.stat().st_size < 100_000
    with Image.open(picture) as image:
        assert image.width >= 500
    assert "docs/craft.png" in TEXT


@pytest.mark.slow
def test_every_short_example_runs_in_order(own_folder):
    space: dict = {}
    blocks = re.findall(r"```python run\n(.*?)```", SHORT, flags=re.DOTALL)
    assert len(blocks) == 6
    for block in blocks:
        exec(block, space)
    assert len(plt.get_fignums()) == 2, "the response's and the region's picture"
    assert space["loop"].to_control().nstates == 83
    line = dict(zip(space["line"].output_labels, space["line"].outputs, strict=True))
    assert abs(line["y"][-1]) < 0.15 and abs(line["rudder_applied"]).max() <= 0.45
    assert (own_folder / "plant.fmu").stat().st_size > 10_000
    assert space["region"].outside("theorem", "simulated") == []
    assert space["found"].verdict == "effect"
    (slope,) = [e for e in space["found"].effects if e.parameter == "slope_x"]
    assert slope.value == pytest.approx(0.1, abs=3 * slope.std)


def test_it_is_short_and_its_links_lead_somewhere():
    assert len(TEXT.splitlines()) <= 60
    links = re.findall(r"\]\((?!https?://)([^)#]+)\)", TEXT)
    assert links
    assert not [link for link in links if not (PROJECT / link).exists()]


def test_ci_runs_its_commands_as_they_stand_there_and_none_of_their_recipes_twice():
    """CI once ran `make test-all` in place of `make test`, which failed for every user."""
    ours = re.findall(r"^    (make \w+) ", TEXT, re.MULTILINE)
    assert ours == ["make demo", "make test"]
    lines = (PROJECT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    run = [line.partition("#")[0].strip() for line in lines if line.startswith("make ")]
    assert set(ours) <= set(run)
    recipes, settings = [], {k: v for k, v in os.environ.items() if k != "MAKEFLAGS"}
    for command in run:
        words = [
            "make",
            "-n",
            "--no-print-directory",
            "-o",
            ".venv/ready",
            "-o",
            ".venv/tests",
            *shlex.split(command)[1:],
        ]
        done = subprocess.run(words, cwd=PROJECT, capture_output=True, text=True, check=True, env=settings)
        recipes += done.stdout.splitlines()
    assert len(recipes) > 8 and len(set(recipes)) == len(recipes)
    selected = [line.partition("-m pytest")[2] for line in recipes if "-m pytest" in line]
    assert [text.partition(" -m ")[2] for text in selected] == ['"not slow"', "slow"]  # all tests, once


@pytest.mark.parametrize("page", ["README.md", "docs/examples.md", "docs/evidence.md"])
def test_each_command_that_a_page_names_is_there(page):
    text = (PROJECT / page).read_text(encoding="utf-8")
    commands = set(re.findall(r"(?:\$ |`)hovercontrol (\w+)", text))
    known = {command.name for command in typer.main.get_command(app).commands.values()}
    assert commands <= known, commands - known
    assert commands or page == "README.md"
    for module in re.findall(r"python -m ([\w.]+)", text):
        assert list(PROJECT.glob(f"{module.replace('.', '/')}*")), module
