"""Blocks: signals and equations of every part that can be wired, compiled and exported."""

from __future__ import annotations

import re
from pathlib import Path

from generate.pages import code, html, table, toctree, write
from hovercontrol.app.commands.exportable import choose
from hovercontrol.app.commands.exportable_parts import PARTS
from hovercontrol.documents.scenarios import load_scenario, scenario_names

#: Longer pages than these signs are cut down to signals: the whole autopilot has hundreds of equations.
LONGEST = 400_000


def names() -> list[str]:
    """Return what has a page: the parts of an autopilot, and those of C17's loop and of each law of K06's."""
    parts = [name for name in PARTS if not name.startswith("link_")]
    laws = []
    for name in scenario_names():
        scenario = load_scenario(name)
        own = f"{name}:controller"
        if scenario.controller is not None and scenario.autopilot is None and "field" not in name:
            laws.append(own)
    return ["table1:controller", "table1:estimator", "table1:reference",
            *(law for law in laws if law.startswith("k06")), *parts]  # fmt: skip


def _file(name: str) -> str:
    return re.sub(r"\W", "-", name)


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each Block."""
    rows, every = [], names()
    for name in every:
        chosen = choose(name)
        file = _file(name)
        block = chosen.block
        shown = block._repr_html_()
        write(
            into / "blocks" / f"{file}.md",
            f"# {name}",
            chosen.text,
            code(f"$ hovercontrol export {name} -o {file}.fmu", "console"),
            html(f"<div class='card-html'>{shown}</div>") if len(shown) < LONGEST else
            f"{len(block.states)} states, {len(block.parameters)} parameters; too many equations for a page.",
        )  # fmt: skip
        ticks = ", ".join(dict.fromkeys(f"{t.period:g} s" for t in block.ticks)) or (
            f"{block.period:g} s" if block.period else "continuous"
        )
        rows.append((f"[`{name}`](blocks/{file}.md)", chosen.text, ticks, len(block.states)))
    write(
        into / "blocks.md",
        "# Blocks",
        "Every Block has python-control systems, NumPy functions, machine code and FMUs "
        "([how](../concepts/blocks.md)). Plants are under [craft](vehicles.md).",
        table(("block", "what it is", "ticks", "states"), rows),
        toctree(f"blocks/{_file(name)}" for name in every),
    )
    return "blocks", f"{len(rows)} blocks"
