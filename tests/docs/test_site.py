"""The site's reference has a page for everything that is public, without anybody keeping a list."""

import inspect
import json
import sys
from pathlib import Path

import pytest
import typer.main

import hovercontrol
from hovercontrol.app.commands.analyze import known_scripts
from hovercontrol.app.commands.app import app
from hovercontrol.app.schema import KINDS
from hovercontrol.craft.effects import effect_names
from hovercontrol.documents.scenarios import scenario_names

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module", autouse=True)
def generators():
    sys.path.insert(0, str(DOCS))
    yield
    sys.path.remove(str(DOCS))


def pages(folder):
    return {path.stem for path in folder.glob("*.md")}


def test_every_public_name_has_a_page_and_its_module_links_it(tmp_path):
    from generate import api

    api.pages(tmp_path)
    found = pages(tmp_path / "api")
    assert {f"hovercontrol.{name}" for name in hovercontrol.__all__} <= found
    for module in api.public_modules():
        text = (tmp_path / "api" / f"{module.__name__}.md").read_text(encoding="utf-8")
        for name in module.__all__:
            (line,) = [line for line in text.splitlines() if line.startswith(f"| [`{name}`](")]
            assert line.partition("](")[2].partition(".md)")[0] in found, line


def test_a_page_of_a_constant_says_what_it_is(tmp_path):
    from generate import api

    api.pages(tmp_path)
    assert "Every craft by name." in (tmp_path / "api" / "hovercontrol.VEHICLES.md").read_text(
        encoding="utf-8"
    )


def test_every_command_and_each_of_its_options_is_in_the_reference(tmp_path):
    from generate import commands

    commands.pages(tmp_path)
    known = typer.main.get_command(app).commands
    assert pages(tmp_path / "commands") == set(known)
    for name, command in known.items():
        text = (tmp_path / "commands" / f"{name}.md").read_text(encoding="utf-8")
        for parameter in command.params:
            if not parameter.hidden and parameter.opts[0].startswith("-"):
                assert f"`{parameter.opts[0]}`" in text, (name, parameter.opts)


def test_every_vehicle_analysis_and_format_has_a_page(tmp_path):
    from generate import analyses, formats, vehicles

    vehicles.pages(tmp_path)
    assert pages(tmp_path / "vehicles") == set(hovercontrol.VEHICLES)
    analyses.pages(tmp_path)
    assert pages(tmp_path / "analyses") == set(known_scripts())
    formats.pages(tmp_path)
    assert pages(tmp_path / "formats") == {"log", "parameters", *KINDS}
    for kind in KINDS:
        json.loads((tmp_path / "formats" / f"{kind}.schema.json").read_text(encoding="utf-8"))


def test_each_analysis_has_a_title_in_words(tmp_path):
    from generate import analyses
    from generate.titles import TITLES

    assert set(TITLES) == set(known_scripts())
    analyses.pages(tmp_path)
    for name, title in TITLES.items():
        assert "_" not in title and len(title) <= 70
        assert (tmp_path / "analyses" / f"{name}.md").read_text(encoding="utf-8").startswith(f"# {title}\n")


def test_every_effect_and_scenario_has_a_page(tmp_path, monkeypatch):
    from generate import effect_runs, effects, scenarios

    made = []
    monkeypatch.setattr(effect_runs, "every_run", lambda: None)
    monkeypatch.setattr(effects, "_page", lambda cls, runs, folder: made.append(cls.name))
    effects.pages(tmp_path)
    assert made == effect_names()
    monkeypatch.setattr(scenarios, "run_all", lambda names, folder: made.extend(names))
    scenarios.pages(tmp_path)
    assert made[len(effect_names()) :] == scenario_names()


@pytest.mark.parametrize("name", ["surge_quadratic_drag", "input_delay", "gyro_bias", "fan_lag"])
def test_an_effects_page_tells_equation_numbers_and_what_shows_it(name, tmp_path):
    from generate import effect_runs, effects

    from hovercontrol.craft.effects import effect_class

    cls = effect_class(name)
    kind = "fan" if cls.craft == "fan" else "rudder"
    seen = effect_runs.seen_by(name, {kind: effect_runs.driven(kind)})
    effects._page(cls, effect_runs.Runs({name: seen}), tmp_path)
    text = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    assert inspect.getdoc(cls).split("\n")[0] in text
    assert cls.source in text
    for key, number in cls.numbers.items():
        assert f"| `{cls.parameter(key)}` | {number.unit} |" in text
    assert "class='new'" in text or "shifts commands against measurements" in text
    assert (tmp_path / f"{name}.svg").exists() or (tmp_path / f"{name}.png").exists()
    assert seen.shown_by()[0][1] > 0.001


def test_an_effect_that_the_craft_cannot_tell_from_another_is_its_twin():
    from generate import effect_runs

    craft = {"rudder": effect_runs.driven("rudder")}
    names = ("input_delay", "time_offset", "surge_quadratic_drag")
    runs = effect_runs.Runs({name: effect_runs.seen_by(name, craft) for name in names})
    assert [twin for twin, _ in runs.twins("input_delay")] == ["time_offset"]
    assert runs.twins("surge_quadratic_drag") == []
