"""Analyses: regions, margins and trials, each a script with the public API only."""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

from generate.pages import code, folded, table, toctree, write
from generate.titles import TITLES
from hovercontrol.app.commands.analyze import known_scripts

#: Made by ``make pictures`` and kept: some analyses take minutes.
KEPT = Path(__file__).parents[1] / "pictures" / "analyses"


def title(name: str) -> str:
    """Return an analysis' title in words."""
    return TITLES.get(name, summary(name))


def summary(name: str) -> str:
    """Return the first line of an analysis' docstring."""
    text = ast.get_docstring(ast.parse(known_scripts()[name].read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each analysis."""
    names = list(known_scripts())
    folder = into / "analyses"
    folder.mkdir(parents=True)
    for name in names:
        kept = pictures(name)
        for picture in kept:
            shutil.copy(picture, folder)
        write(
            folder / f"{name}.md",
            f"# {title(name)}",
            summary(name),
            code(f"$ hovercontrol analyze {name} --out out/{name}", "console"),
            *(_found(name, kept) if kept else ["No picture is kept of this analysis: run the line above."]),
            folded("The script", code(known_scripts()[name].read_text(encoding="utf-8"), "python")),
        )
    write(
        into / "analyses.md",
        "# Analyses",
        "`hovercontrol analyze NAME` draws one and writes a table (CSV) and its findings. Each is a script in "
        "`analyses/` to copy and change.",
        table(
            ("analysis", "name", "what it computes"),
            [(f"[{title(n)}](analyses/{n}.md)", f"`{n}`", summary(n)) for n in names],
        ),
        toctree(f"analyses/{n}" for n in names),
    )
    return "analyses", f"{len(names)} analyses"


def pictures(name: str) -> list[Path]:
    """Return the kept pictures of an analysis, with the findings beside each as ``.txt``."""
    return sorted(KEPT.glob(f"{name}*.png"))


def _found(name: str, kept: list[Path]) -> list[str]:
    texts = [p.with_suffix(".txt").read_text(encoding="utf-8").strip() for p in kept]
    return [
        *(f"![{title(name)}]({p.name})" for p in kept),
        "## Findings",
        *map(_findings, filter(None, texts)),
        "This command made picture and findings (`make pictures` makes all of them).",
    ]


def _findings(text: str) -> str:
    """Return findings as a list, those with a table as they stand."""
    if "   " in text:
        return code(text, "text")
    lines: list[str] = []
    for line in text.splitlines():
        if lines and line[:1].islower() and not lines[-1].endswith((".", ":")):  # it was broken there
            lines[-1] += f" {line}"
        elif line:
            lines.append(line)
    return "\n".join(f"- {_plain(line)}" for line in lines)


def _plain(line: str) -> str:
    """Return a finding so that no sign of Markdown is in it."""
    for sign in "\\*_<>[]$|":
        line = line.replace(sign, f"\\{sign}")
    return line
