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
BLIND = Path(__file__).parents[2] / "tests" / "identification" / "diagnose" / "blind"


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each document, and two for the blind test of diagnose."""
    count = 0
    for document, name in NAMES.items():
        items = json.loads((KEPT / f"{document}.json").read_text(encoding="utf-8"))["items"]
        count += len(items)
        _document(document, name, items, into / "evidence")
    write(
        into / "evidence" / "blind.md",
        "# How often diagnose is right",
        "Logs are simulated with effects that `diagnose` does not know of. `python -m tests.identification.diagnose.table` writes "
        "this table.",
        (BLIND / "table.md").read_text(encoding="utf-8"),
    )
    write(
        into / "evidence" / "criteria.md",
        "# How near decisions are to their limits",
        "Each decision of `diagnose` compares a value with a limit. The table counts the decisions that would turn if the limit "
        "were doubled or halved. This is a first-order sensitivity: it counts decisions, not verdicts, since a turned decision "
        "may change what is tried next. The cases in the second table were run again with the thresholds of a rule changed.",
        (BLIND / "criteria.md").read_text(encoding="utf-8"),
    )
    write(
        into / "evidence.md",
        "# Figures of the papers beside ours",
        "`hovercontrol analyze` recomputes the figures and tables of the source documents and compares them with the "
        "printed numbers within a stated tolerance. Numbers that a parameter was fitted to are marked: they test nothing.",
        "- " + "\n- ".join(f"[{name}](evidence/{document}.md)" for document, name in NAMES.items()),
        "- [How often diagnose is right](evidence/blind.md)",
        "- [How near decisions are to their limits](evidence/criteria.md)",
        toctree([*(f"evidence/{document}" for document in NAMES), "evidence/blind", "evidence/criteria"]),
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
