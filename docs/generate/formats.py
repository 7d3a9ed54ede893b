"""File formats: logs, model files, scenario files, results, with their JSON Schemas."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from generate.pages import code, table, toctree, write
from hovercontrol.log_check.facts import UNITS
from hovercontrol.models.model import MOTION
from hovercontrol.schema import KINDS, schema

ABOUT = {
    "model": ("Model files (TOML)", "A craft as a list of effects. `hc.load_model`, `--model FILE`."),
    "scenario": (
        "Scenario files (TOML)",
        "What happens, to which craft, in which phases. `hovercontrol simulate FILE`.",
    ),
    "result": ("result.json of a diagnosis", "What `hovercontrol diagnose` found, for other programs."),
}


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each format."""
    for kind in KINDS:
        found = schema(kind)
        head, text = ABOUT[kind]
        plain = json.dumps(found, indent=1)
        (into / "formats").mkdir(parents=True, exist_ok=True)
        (into / "formats" / f"{kind}.schema.json").write_text(plain + "\n", encoding="utf-8")
        write(
            into / "formats" / f"{kind}.md",
            f"# {head}",
            text,
            code(f"$ hovercontrol schema {kind} > {kind}.schema.json", "console"),
            f"The whole JSON Schema (draft 2020-12): {{download}}`{kind}.schema.json`. Editors check and complete by it.",
            "## Keys",
            table(("key", "type", "what it is"), _rows(found)),
            "An effect is a number, or an object with `value`, `unit` and the numbers on [its page](../effects.md)."
            if kind == "model"
            else "",
        )
    write(
        into / "formats" / "log.md",
        "# Logs (CSV or Parquet)",
        "A header and a row for each time. `time` and any of pose and body velocities, then the inputs by the plant's names. "
        "A log of a Block of your own has its inputs and any of its outputs or states by their names. Missing values are empty cells. Other names and units are mapped: `--columns time=stamp_ms:ms,psi=yaw:deg`. The frame is x, y on "
        "the floor with z up; psi turns from x to y. `--frame ned` converts north-east-down logs.",
        table(
            ("column", "unit", "what it is"),
            [
                ("`time`", "s", "time"),
                *((f"`{s.name}`", UNITS.get(s.name, s.unit), s.description) for s in MOTION),
                ("`thrust`, `rudder`, ...", "the plant's", "inputs, held from row to row"),
            ],
        ),
        code(
            "time,x,y,psi,thrust,rudder\n0.00,0.000,0.000,0.000,1.5,0.10\n0.02,0.000,0.000,0.001,1.5,0.10",
            "text",
        ),
    )
    write(
        into / "formats" / "parameters.md",
        "# Parameter files (TOML)",
        "Values for a model that is written in Python: `identify` and `diagnose` write `parameters.toml`, `--params` of every command that "
        "takes `FILE.py:NAME` reads it, and `hc.load_parameters(model, file)`.",
        code(
            '[model]\nname = "motor"\n\n[coefficients]\ngain = 13.9  # rad/s^2/V\n\n'
            "[effects]\nspeed_coulomb = 0.4\ninput_delay = {seconds = 0.04}",
            "toml",
        ),
    )
    kinds = ["log", "parameters", *KINDS]
    rows = [("[Logs](formats/log.md)", "CSV or Parquet")]
    rows += [("[Parameter files](formats/parameters.md)", "TOML: what a fit found of a Block of your own")]
    rows += [(f"[{ABOUT[k][0]}](formats/{k}.md)", ABOUT[k][1]) for k in KINDS]
    write(into / "formats.md", "# File formats", table(("file", "what it is"), rows),
          toctree(f"formats/{k}" for k in kinds))  # fmt: skip
    return "formats", f"{len(kinds)} formats"


def _rows(found: dict[str, Any], prefix: str = "", depth: int = 0) -> list[tuple[str, str, str]]:
    """Return keys, types and texts, nested keys by dots; the deepest are in the schema's file."""
    rows = []
    for part in found.get("anyOf", [found]) if "properties" not in found else [found]:
        for key, inside in part.get("properties", {}).items():
            rows.append((f"`{prefix}{key}`", _type(inside), inside.get("description", "")))
            if depth < 2 and not prefix.startswith("effects."):  # each effect has its page
                more = inside.get("items", inside)
                rows += _rows(more, f"{prefix}{key}{'[]' if more is not inside else ''}.", depth + 1)
    return list(dict.fromkeys(rows))


def _type(inside: dict[str, Any]) -> str:
    if "enum" in inside:
        return " or ".join(f"`{v}`" for v in inside["enum"])
    if "anyOf" in inside:
        return " or ".join(dict.fromkeys(_type(part) for part in inside["anyOf"]))
    kind = inside.get("type", "")
    text = " or ".join(kind) if isinstance(kind, list) else kind
    low, high = inside.get("minimum"), inside.get("maximum")
    limits = [f"at least {low:g}"] if low is not None else []
    limits += [f"at most {high:g}"] if high is not None else []
    return f"{text}, {' and '.join(limits)}" if limits else text
