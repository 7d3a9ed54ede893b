"""Pieces of JSON Schemas, and schemas of types."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints

Schema = dict[str, Any]

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TEXT: Schema = {"type": "string"}
NUMBER: Schema = {"type": "number"}
POSITIVE: Schema = {"type": "number", "exclusiveMinimum": 0}
#: Of each key's type in a section of a scenario.
KINDS: dict[type, Schema] = {
    str: TEXT,
    float: NUMBER,
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    list: {"type": "array", "items": TEXT},
    dict: {"type": "object", "additionalProperties": NUMBER},
}


def document(title: str, description: str, body: Schema) -> Schema:
    """Return a whole schema."""
    return {"$schema": DRAFT, "title": title, "description": description, **body}


def table(properties: Mapping[str, Schema], required: Iterable[str] = (), description: str = "") -> Schema:
    """Return the schema of an object with these keys and no others."""
    made: Schema = {"type": "object", "properties": dict(properties), "additionalProperties": False}
    if names := list(required):
        made["required"] = names
    return {"description": description, **made} if description else made


def between(lower: float, upper: float) -> Schema:
    """Return the schema of a number within bounds."""
    found: Schema = {"type": "number"}
    if math.isfinite(lower):
        found["minimum"] = lower
    if math.isfinite(upper):
        found["maximum"] = upper
    return found


def array(items: Schema, shortest: int = 0, longest: int | None = None) -> Schema:
    """Return the schema of a list."""
    found: Schema = {"type": "array", "items": items}
    if shortest:
        found["minItems"] = shortest
    if longest is not None:
        found["maxItems"] = longest
    return found


def of_type(kind: Any) -> Schema:
    """Return the schema of a type: TypedDict, list, dict by text, tuple, Literal, plain types, with notes.

    A ``float`` may be null: a number that is not finite is written so.

    Examples
    --------
    >>> of_type(list[Literal["a", "b"]])
    {'type': 'array', 'items': {'enum': ['a', 'b']}}
    """
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return {"description": parts[1], **of_type(parts[0])}
    if origin is NotRequired:
        return of_type(parts[0])
    if origin is Literal:
        return {"enum": list(parts)}
    if origin is list:
        return array(of_type(parts[0]))
    if origin is tuple:
        return array(of_type(parts[0]), len(parts), len(parts))
    if origin is dict:
        return {"type": "object", "additionalProperties": of_type(parts[1])}
    if origin in (Union, UnionType):
        return {"anyOf": [of_type(part) for part in parts]}
    if hasattr(kind, "__required_keys__"):
        hints = get_type_hints(kind, include_extras=True)
        line = (kind.__doc__ or "").strip().split("\n")[0]
        needed = [k for k, v in hints.items() if get_origin(v) is not NotRequired]
        return table({k: of_type(v) for k, v in hints.items()}, needed, line)
    if kind is NoneType:
        return {"type": "null"}
    if kind is float:
        return {"type": ["number", "null"]}
    return KINDS[kind]
