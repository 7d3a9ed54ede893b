"""Pieces of pages in Markdown: tables, pictures, raw HTML, files of one name."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.figure import Figure


def clean(folder: Path) -> None:
    """Make an empty folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)


def write(path: Path, *parts: str) -> None:
    """Write a page of parts with an empty line between them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n\n".join(part for part in parts if part) + "\n", encoding="utf-8")


def toctree(names: Iterable[str], *options: str) -> str:
    """Return a list of pages for the side bar."""
    return "\n".join(["```{toctree}", ":hidden:", *options, "", *names, "```"])


def html(text: str) -> str:
    """Return HTML as it stands."""
    return f"````{{raw}} html\n{text}\n````" if text else ""


def cell(value: object) -> str:
    """Return a table's cell: bars and line breaks cannot stand in one."""
    return " ".join(str(value).split()).replace("|", "\\|")


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; nothing without rows."""
    lines = ["| " + " | ".join(map(cell, row)) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *lines])


def code(text: str, language: str = "") -> str:
    """Return text as code."""
    return f"````{language}\n{text.strip()}\n````"


def folded(title: str, inside: str) -> str:
    """Return what opens when its title is clicked."""
    return f":::::{{dropdown}} {title}\n{inside}\n:::::"


def picture(figure: Figure, path: Path, text: str, *, dpi: int = 110) -> str:
    """Save a figure beside a page, as SVG where that is small, and return its place on the page.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
        Of the page that shows it.
    text : str
        What is seen, for those who do not see it.
    dpi : int, optional
        Of the PNG that takes the SVG's place where there are too many points.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    vector = path.with_suffix(".svg")
    figure.savefig(vector, bbox_inches="tight")
    if vector.stat().st_size > 150_000:
        vector.unlink()
        vector = path.with_suffix(".png")
        figure.savefig(vector, dpi=dpi, bbox_inches="tight")
    return f"![{text}]({vector.name})"


def first_sentence(text: str | None) -> str:
    """Return a docstring's first paragraph as one line."""
    return " ".join((text or "").strip().split("\n\n")[0].split())


def bounds(lower: float, upper: float) -> str:
    """Return bounds in words; nothing where there are none."""
    if lower == -float("inf") and upper == float("inf"):
        return ""
    if upper == float("inf"):
        return f"at least {lower:.4g}"
    return f"at most {upper:.4g}" if lower == -float("inf") else f"{lower:.4g} to {upper:.4g}"
