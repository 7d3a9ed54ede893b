"""Figures of the papers beside ours: what is printed, ours, a computed verdict."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

from generate.pages import code, table, toctree, write
from hovercontrol.documents import all_items

#: Indexes of ``hovercontrol analyze`` and some of its pictures, made by ``make pictures``.
KEPT = Path(__file__).parents[1] / "pictures" / "reproduce"

NAMES = {"c17": "C17, paper by Cabecinhas and others", "k06": "K06, thesis by Kulis"}
BLIND = Path(__file__).parents[2] / "tests" / "discrepancy" / "blind" / "table.md"


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each document, and one for the blind test of diagnose."""
    count = 0
    for document, name in NAMES.items():
        items = json.loads((KEPT / f"{document}.json").read_text(encoding="utf-8"))["items"]
        count += len(items)
        _document(document, name, items, into / "evidence")
    write(
        into / "evidence" / "blind.md",
        "# How often diagnose is right",
        "Effects are hidden from `diagnose` in made logs; each case is judged without seeing it. This table is written "
        "by `python -m tests.discrepancy.table`.",
        BLIND.read_text(encoding="utf-8"),
    )
    write(
        into / "evidence.md",
        "# Figures of the papers beside ours",
        "`hovercontrol analyze` rebuilds what the source documents print and computes each verdict from the printed "
        "numbers and a tolerance stated beside them. A number that ours was fitted to tests nothing, and is marked.",
        "- " + "\n- ".join(f"[{name}](evidence/{document}.md)" for document, name in NAMES.items()),
        "- [How often diagnose is right](evidence/blind.md)",
        toctree([*(f"evidence/{document}" for document in NAMES), "evidence/blind"]),
    )
    return "evidence", f"{count} tables, figures and equations of the papers"


def _document(document: str, name: str, items: list[dict[str, Any]], folder: Path) -> None:
    counts = Counter(item["verdict"] for item in items)
    folder.mkdir(parents=True, exist_ok=True)
    sections = []
    for item in items:
        picture = KEPT / f"{document}-{item['item'].replace(' ', '_')}.png"
        shown = ""
        if picture.exists():
            shutil.copy(picture, folder)
            shown = f"![{item['item']}, rebuilt]({picture.name})"
        rows = [
            (p["name"], p["text"] + (" (fitted)" if p["fitted"] else ""), f"{_short(p['ours'])} {p['unit']}")
            for p in item["printed"]
        ]
        sections += [
            f"## {item['item'].replace('fig', 'Figure').replace('table', 'Table').replace('eq', 'Equation')}",
            f"{item['title'][:1].upper()}{item['title'][1:]}: **{item['verdict']}**.",
            table(("number", "printed", "ours"), rows),
            item["why"],
            f"Not shown by ours: {item['lacks']}." if item["lacks"] else "",
            shown,
        ]
    write(
        folder / f"{document}.md",
        f"# {name}",
        f"{len(items)} of {_every(document)} items are kept here: {', '.join(f'{n} {verdict}' for verdict, n in counts.most_common())}. This makes all of them:",
        code(f"$ hovercontrol analyze --document {document} --out out/{document}", "console"),
        *sections,
    )


def _every(document: str) -> int:
    return sum(item.document == document for item in all_items())


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
