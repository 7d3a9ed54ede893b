"""The gallery: every analysis and scenario with its picture and the command that makes it."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

from generate import analyses
from generate.pages import clean, write
from generate.scenarios import first_picture
from hovercontrol.app.commands.analyze import known_scripts
from hovercontrol.documents.scenarios import load_scenario, scenario_names


def pages(into: Path) -> None:
    """Write the one page of the gallery."""
    clean(into)
    reference = into.parent / "reference"
    found = [
        (
            f"analyses/{n}",
            f"analyses/{analyses.pictures(n)[0].name}",
            f"hovercontrol analyze {n}",
            analyses.title(n),
        )
        for n in known_scripts()
        if analyses.pictures(n)
    ]
    runs = [
        (f"scenarios/{n}", f"scenarios/{first_picture(reference / 'scenarios', n)}", f"hovercontrol simulate {n}",
         load_scenario(n).title)
        for n in scenario_names()
    ]  # fmt: skip
    write(
        into / "index.md",
        "# Gallery",
        "The command below a picture makes it. A click on a picture shows numbers, files and further pictures.",
        "## Analyses",
        _grid(found),
        "## Scenarios",
        _grid(runs),
        "## Effects",
        "The page of each [effect](../reference/effects.md) shows a run with and without it.",
    )


def _grid(found: Iterable[tuple[str, str, str, str]]) -> str:
    cards = [
        f":::{{grid-item-card}} {escape(text)}\n:img-top: ../reference/{picture}\n:link: ../reference/{page}\n"
        f":link-type: doc\n:class-card: picture\n`{line}`\n:::"
        for page, picture, line, text in found
    ]
    return "::::{grid} 1 2 3 3\n:gutter: 3\n\n" + "\n\n".join(cards) + "\n::::"
