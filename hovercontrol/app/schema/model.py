"""The JSON Schema of model files, made of the effects."""

from __future__ import annotations

from hovercontrol.app.schema.parts import NUMBER, TEXT, Schema, array, between, document, table
from hovercontrol.base.boundary import checked
from hovercontrol.craft.effects import Effect, effect_class, effect_names
from hovercontrol.craft.effects.fan_classes import ENDINGS, fan_effects

POSITIVE = {"exclusiveMinimum": 0, **NUMBER}


@checked
def model_schema() -> Schema:
    """Return the JSON Schema of model files; effects of a script's own are in it once they are defined.

    Examples
    --------
    >>> sorted(model_schema()["properties"])
    ['effects', 'fans', 'inputs', 'plant']
    """
    sections = {
        "plant": table(
            {"name": TEXT, "limited": {"type": "boolean"}, "mass": POSITIVE, "inertia": POSITIVE},
            description="the craft; with its mass [kg] and inertia [kg m^2], forces in N",
        ),
        "inputs": table(
            {"thrust": _input(), "rudder": _input()}, description="commands that differ from the default"
        ),
        "effects": effects_schema(),
        "fans": {
            "type": "object",
            "description": "fans by name: place [m] from the centre of mass, direction of push [rad]",
            "additionalProperties": _fan(),
        },
    }
    return document("hovercontrol model", "A craft as a list of effects (TOML).", table(sections))


def effects_schema() -> Schema:
    """Return the schema of a section of effects."""
    of_fans = dict(zip(ENDINGS, fan_effects("fan").values(), strict=True))
    own = {f"^.+{ending}$": _effect(cls) for ending, cls in of_fans.items()}
    return {**table({name: _effect(effect_class(name)) for name in effect_names()}), "patternProperties": own}


def _effect(cls: type[Effect]) -> Schema:
    """Return the schema of one effect: a number, or a table of its numbers."""
    numbers = {
        key: {"description": f"[{n.unit}]", **between(n.lower, n.upper)} for key, n in cls.numbers.items()
    }
    needed = [key for key, n in cls.numbers.items() if n.default is None]
    first = "value" if "value" in cls.numbers else next(iter(cls.numbers), "value")
    forms: list[Schema] = []
    if set(needed) <= {first} and first in cls.numbers:
        n = cls.numbers[first]
        forms.append(between(n.lower, n.upper))
    if "value" in cls.numbers:
        free = {**numbers, "value": {"description": "in its unit, bounds hold in SI", **NUMBER}}
        forms.append(table(numbers, needed))
        forms.append(
            table({**free, "unit": TEXT}, [*needed, "unit", *([] if "value" in needed else ["value"])])
        )
    else:
        forms.append(table(numbers, needed))
    line = (cls.__doc__ or "").strip().split("\n")[0]
    return {"description": line, "anyOf": forms}


def _input() -> Schema:
    return table({"unit": TEXT, "description": TEXT, "lower": NUMBER, "upper": NUMBER})


def _fan() -> Schema:
    points = table({"signal": array(NUMBER, 2), "force": array(NUMBER, 2)}, ("signal", "force"))
    return table(
        {
            "x": NUMBER,
            "y": NUMBER,
            "direction": NUMBER,
            "curve": {"anyOf": [array(NUMBER, 1), points]},
            "gain": NUMBER,
            "reverses": {"type": "boolean"},
            "upper": POSITIVE,
        },
        ("x", "y", "direction"),
    )
