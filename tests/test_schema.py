"""Every scenario, model and result fits its schema, and what the loaders refuse the schemas refuse."""

import copy
import json
import re
import sys
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from hovercontrol import InputError, effect_names, vehicle
from hovercontrol.app import cli
from hovercontrol.app.schema import KINDS, schema
from hovercontrol.craft.effects import effect, effect_class
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.modelfile import model_from_table, model_text
from hovercontrol.craft.models.vehicles import VEHICLES
from hovercontrol.documents.scenarios import load_scenario, scenario_names
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log

CHECK = {kind: Draft202012Validator(schema(kind)) for kind in KINDS}
MODELS = (Path(__file__).parents[1] / "docs" / "concepts" / "models.md").read_text(encoding="utf-8")
TABLE1 = tomllib.loads((resources.files("hovercontrol.documents.scenarios") / "table1.toml").read_text())


def wrong(kind, content):
    return [error.message for error in CHECK[kind].iter_errors(content)]


@pytest.mark.parametrize("kind", KINDS)
def test_the_schemas_are_schemas(kind):
    Draft202012Validator.check_schema(schema(kind))
    assert schema(kind)["$schema"].endswith("2020-12/schema")


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_fits(name):
    text = (resources.files("hovercontrol.documents.scenarios") / f"{name}.toml").read_text(encoding="utf-8")
    assert wrong("scenario", tomllib.loads(text)) == []


@pytest.mark.parametrize("name", VEHICLES)
def test_every_vehicle_as_a_model_file_fits(name):
    assert wrong("model", tomllib.loads(model_text(vehicle(name)))) == []


def test_the_model_files_of_the_documentation_fit():
    blocks = re.findall(r"```toml\n(.*?)```", MODELS, flags=re.DOTALL)
    assert len(blocks) >= 2
    for block in blocks:
        assert wrong("model", tomllib.loads(block)) == []


@pytest.mark.parametrize("name", effect_names())
def test_every_effect_that_can_be_written_fits(name):
    cls = effect_class(name)
    given = {k: min(max(0.5, n.lower), n.upper) for k, n in cls.numbers.items()}
    craft = vehicle("four_fan") if cls.craft == "fan" else Model("puck")
    if name in {e.name for e in craft.effects}:
        craft = craft.with_effects([])
        craft = Model("fans", (), fans=craft.fans)
    text = model_text(craft.with_effects([effect(name, **given)]))
    content = tomllib.loads(text)
    assert name in content["effects"]
    model_from_table(content)
    assert wrong("model", content) == []


MODEL = {"plant": {"name": "puck"}, "effects": {"yaw_coulomb": 0.5}}
BAD_MODELS = {
    "an unknown effect": {"effects": {"yaw_colomb": 0.5}},
    "a negative drag": {"effects": {"yaw_coulomb": -0.5}},
    "text for a number": {"effects": {"yaw_coulomb": "much"}},
    "an unknown number": {"effects": {"yaw_coulomb": {"value": 0.5, "widht": 0.1}}},
    "a missing number": {"effects": {"input_delay": {}}},
    "a unit without a value": {"effects": {"yaw_coulomb": {"unit": "deg/s^2"}}},
    "an unknown section": {"plants": {}},
    "an unknown input": {"inputs": {"sail": {"unit": "m"}}},
    "a fan without a place": {"fans": {"left": {"x": 0.1}}},
}


@pytest.mark.parametrize("case", BAD_MODELS)
def test_a_model_that_the_loader_refuses_does_not_fit(case):
    content = MODEL | BAD_MODELS[case]
    with pytest.raises(InputError):
        model_from_table(content)
    assert wrong("model", content)


def test_a_number_with_a_unit_may_be_out_of_the_bounds_of_another():
    content = {"effects": {"yaw_coulomb": {"value": 47.0, "unit": "deg/s^2"}}}
    assert model_from_table(content).effects[0].values["value"] == pytest.approx(np.radians(47.0))
    assert wrong("model", content) == []


BAD_SCENARIOS = {
    "no step": lambda c: c["scenario"].pop("step"),
    "an unknown section": lambda c: c.update(sampel={}),
    "an unknown vehicle": lambda c: c["plant"].update(vehicle="boat"),
    "a model and a vehicle": lambda c: c["plant"].update(model="a.toml"),
    "an unknown state": lambda c: c["plant"]["start"].update(w=1.0),
    "an unknown reference": lambda c: c["reference"].update(kind="spiral"),
    "a reference of other arguments": lambda c: c["reference"].update(radius=1.0),
    "a phase without an end": lambda c: c["phase"][0].pop("until"),
    "too much adaptation": lambda c: c["phase"][0].update(adaptation=1.5),
    "an unknown statistic": lambda c: c["metric"][0].update(statistic="avg"),
    "controller and commands": lambda c: c.update(commands={"time": [0.0], "thrust": [1.0]}),
    "text for a gain": lambda c: c["controller"].update(k1="two"),
}


@pytest.mark.parametrize("case", BAD_SCENARIOS)
def test_a_scenario_that_the_loader_refuses_does_not_fit(case, tmp_path):
    content = copy.deepcopy(TABLE1)
    BAD_SCENARIOS[case](content)
    assert wrong("scenario", content)
    path = tmp_path / "bad.toml"
    path.write_text(toml(content), encoding="utf-8")
    with pytest.raises(InputError):
        load_scenario(path)


def toml(content):
    """A scenario as TOML: tables of inline values, and lists of tables."""
    lines = []
    for name, section in content.items():
        for entry in section if isinstance(section, list) else [section]:
            lines.append(f"[[{name}]]" if isinstance(section, list) else f"[{name}]")
            lines += [f"{k} = {inline(v)}" for k, v in entry.items()]
    return "\n".join(lines)


def inline(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {inline(v)}" for k, v in value.items()) + "}"
    return json.dumps(value)


@pytest.fixture(scope="module")
def logs():
    """Two runs of a craft on a slope that its model does not have."""
    rng, t = np.random.default_rng(3), 0.04 * np.arange(400)
    craft = vehicle("c17_experiment")
    truth, found = craft.with_effects([effect("slope", x=0.15)]).plant(), []
    for k in range(2):
        u = [np.repeat(rng.uniform(*span, 20), 20) for span in ((1, 4), (-0.4, 0.4))]
        run = truth.compile(friction="smooth").simulate(t, u)
        seen = {
            n: y + 1e-3 * rng.normal(size=t.size) for n, y in zip(run.output_labels, run.outputs, strict=True)
        }
        found.append(Log(f"run{k}", t, seen | dict(zip(("thrust", "rudder"), u, strict=True))))
    return craft, found


def test_results_fit(logs, tmp_path):
    craft, (one, other) = logs
    named = diagnose(craft, [one], other, names=["slope"])
    unnamed = diagnose(craft, [one], names=["gyro_bias"])
    assert named.verdict == "effect" and unnamed.verdict in ("unexplained", "partial")
    for k, result in enumerate((named, unnamed)):
        result.save(tmp_path / str(k))
        told = json.loads((tmp_path / str(k) / "result.json").read_text())
        assert wrong("result", told) == []
        assert wrong("result", told | {"verdict": "perhaps"}) and wrong("result", told | {"more": 1})
        for key in told:
            assert wrong("result", {k: v for k, v in told.items() if k != key}), key


def test_the_command_prints_a_schema_and_names_the_nearest(monkeypatch, capsys):
    for words, status in ((["schema", "model"], 0), (["schema", "modell"], 2)):
        monkeypatch.setattr(sys, "argv", ["hovercontrol", *words])
        with pytest.raises(SystemExit) as done:
            cli.main()
        assert done.value.code == status
    said = capsys.readouterr()
    assert json.loads(said.out) == schema("model") and "did you mean 'model'?" in said.err
