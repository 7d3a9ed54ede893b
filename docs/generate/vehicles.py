"""Craft: the source documents' vehicles, their effects and equations."""

from __future__ import annotations

from pathlib import Path

from generate.pages import code, first_sentence, html, table, toctree, write
from hovercontrol import VEHICLES, save_model, vehicle


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each vehicle."""
    rows = []
    for name in sorted(VEHICLES):
        model = vehicle(name)
        text = into / "vehicles" / f"{name}.toml"
        text.parent.mkdir(parents=True, exist_ok=True)
        save_model(model, text)
        about = (VEHICLES[name].__doc__ or "").strip()
        about = "\n".join(line.strip() for line in about.splitlines()).replace(":data:", "")
        write(
            into / "vehicles" / f"{name}.md",
            f"# {name}",
            about.replace("Return ", "", 1)[:1].upper() + about.replace("Return ", "", 1)[1:],
            html(f"<div class='card-html'>{model._repr_html_()}</div>"),
            "## As a model file",
            code(text.read_text(encoding="utf-8"), "toml"),
            "## In Python",
            code(
                f'>>> import hovercontrol as hc\n>>> craft = hc.vehicle("{name}")\n>>> plant = craft.plant()',
                "pycon",
            ),
        )
        text.unlink()
        sentence = first_sentence(VEHICLES[name].__doc__).removeprefix("Return ")
        rows.append(
            (f"[`{name}`](vehicles/{name}.md)", sentence, ", ".join(s.name for s in model.plant().inputs))
        )
    write(
        into / "vehicles.md",
        "# Craft",
        "`hc.vehicle(name)` gives them; `--vehicle NAME` on the command line. "
        "A craft of your own is [a TOML file](../tutorials/own_craft.md).",
        table(("craft", "what it is", "inputs"), rows),
        toctree(f"vehicles/{name}" for name in sorted(VEHICLES)),
    )
    return "vehicles", f"{len(rows)} vehicles"
