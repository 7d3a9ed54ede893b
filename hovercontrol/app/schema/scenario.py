"""The JSON Schema of scenario files, made of what the loader checks by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hovercontrol.app.schema.model import effects_schema
from hovercontrol.app.schema.parts import KINDS, NUMBER, POSITIVE, TEXT, Schema, array, document, table
from hovercontrol.base.boundary import checked
from hovercontrol.blocks.random_numbers import LARGEST_SEED
from hovercontrol.control.autopilot.navigation import NAVIGATION
from hovercontrol.control.controllers.references import REFERENCES
from hovercontrol.craft.models.vehicles import VEHICLES
from hovercontrol.documents.scenarios import sections as keys
from hovercontrol.documents.scenarios.autopilots import KEYS as AUTOPILOT
from hovercontrol.documents.scenarios.measures import STATISTICS
from hovercontrol.documents.scenarios.parts import GUIDANCE, LAWS

_NUMBERS: Schema = {"type": "object", "additionalProperties": NUMBER}
_SIZE: Schema = {"anyOf": [NUMBER, array(NUMBER, 1)]}


@checked
def scenario_schema() -> Schema:
    """Return the JSON Schema of scenario files.

    Examples
    --------
    >>> scenario_schema()["title"]
    'hovercontrol scenario'
    """
    sections = {
        "scenario": table({**_of(keys.HEAD), "step": POSITIVE}, ("step",)),
        "plant": _plant(),
        "body": table(dict.fromkeys(keys.BODY, POSITIVE), keys.BODY),
        "reference": _kinds(REFERENCES, ("name",), _reference),
        "guidance": _kinds(GUIDANCE, ("body", "name", "period"), lambda _: NUMBER),
        "controller": {
            "anyOf": [
                table(_of(keys.CONTROLLER)),
                _kinds(LAWS, ("body", "name", "period"), lambda _: NUMBER),
            ]
        },
        "actuation": table(_of(keys.ACTUATION)),
        "estimator": table({key: _of(keys.ESTIMATOR).get(key, _SIZE) for key in keys.ESTIMATOR}),
        "commands": {
            "type": "object",
            "description": "time [s] from 0 on and each input at those times, held in between",
            "properties": {"time": {"anyOf": [array(NUMBER, 1), {"const": 0.0}]}},
            "required": ["time"],
            "additionalProperties": _SIZE,
        },
        "sampling": table(
            {
                **{key: {"type": "number", "minimum": 0} for key in keys.SAMPLING},
                **dict.fromkeys(("measurement", "command", "log"), POSITIVE),
                "seed": {"type": "integer", "minimum": 0},
                "poor_view": table({**_of(keys.POOR_VIEW), "centre": array(NUMBER, 2, 2)}),
            },
            ("measurement",),
        ),
        "autopilot": _autopilot(),
        "phase": array(_phase(), 1),
        "metric": array(
            table({**_of(keys.METRIC), "statistic": {"enum": list(STATISTICS)}}, keys.METRIC_NEEDS)
        ),
    }
    whole = table({name: sections[name] for name in keys.SECTIONS}, ("scenario", "plant", "phase"))
    whole["oneOf"] = [{"required": ["controller"]}, {"required": ["commands"]}]
    parts = {name: _part(sections[name]) for name in keys.SECTIONS}
    parts["scenario"]["required"] = ["base"]
    body: Schema = {"anyOf": [whole, table(parts, ("scenario",), "a scenario that is another but for this")]}
    return document("hovercontrol scenario", "What happens, to which craft, in which phases (TOML).", body)


def _part(section: Schema) -> Schema:
    """Return a section of which the base may have the rest."""
    return {key: value for key, value in section.items() if key not in ("required", "oneOf")}


def _of(kinds: Mapping[str, type]) -> dict[str, Schema]:
    return {key: KINDS[kind] for key, kind in kinds.items() if kind in KINDS}


def _plant() -> Schema:
    made = table(
        {
            **_of(keys.PLANT),
            "vehicle": {"enum": list(VEHICLES)},
            "model": {"description": "a model file, from this file's folder", **TEXT},
            "start": table(dict.fromkeys(keys.STATES, NUMBER)),
            "coefficients": _NUMBERS,
            "effects": effects_schema(),
        }
    )
    return {**made, "oneOf": [{"required": ["vehicle"]}, {"required": ["model"]}]}


def _phase() -> Schema:
    return table(
        {
            **_of(keys.PHASE),
            "until": POSITIVE,
            "adaptation": {"type": "number", "minimum": 0, "maximum": 1},
            "scale": _NUMBERS,
            "set": _NUMBERS,
        },
        ("until",),
    )


def _autopilot() -> Schema:
    own: dict[str, Schema] = {
        "navigation": {"enum": list(NAVIGATION)},
        "fan_table": {"anyOf": [TEXT, array(TEXT, 1, 2)]},
        "beacons": array(array(NUMBER, 3, 3)),
        "rudder_loss": {"type": "number", "minimum": 0, "exclusiveMaximum": 1},
        "seed": {"type": "integer", "minimum": 0, "maximum": LARGEST_SEED},
    }
    return table({key: own[key] if key in own else KINDS[kind] for key, kind in AUTOPILOT.items()})


def _kinds(
    makers: Mapping[str, Callable[..., Any]], without: Sequence[str], value: Callable[[str], Schema]
) -> Schema:
    """Return the schema of a section whose ``kind`` names one of some functions."""
    forms = []
    for name, maker in makers.items():
        accepted, required = keys.arguments(maker, without)
        properties = {"kind": {"const": name}, **{key: value(key) for key in accepted}}
        forms.append(table(properties, ("kind", *required)))
    return {"oneOf": forms}


def _reference(key: str) -> Schema:
    """Return what an argument of a reference can be."""
    pair = array(NUMBER, 2, 2)
    lists = {"velocity": pair, "start": pair, "points": array(pair, 2), "times": array(NUMBER, 2)}
    return lists.get(key, NUMBER)
