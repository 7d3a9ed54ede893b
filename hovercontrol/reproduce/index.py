"""The index of what was rebuilt: a page and the same as JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from hovercontrol.io.files import write_atomically
from hovercontrol.reproduce.item import KINDS, Outcome
from hovercontrol.reproduce.markers import numbered_items, places

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em }
table { border-collapse: collapse; width: 100%; margin: 0.5em 0 1em }
th, td { border-bottom: 1px solid #ccc; padding: 0.3em 0.8em 0.3em 0; text-align: left; vertical-align: top }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap }
section { border-top: 2px solid #888; margin-top: 2em }
img { max-width: 24em; margin: 0.3em 0.6em 0 0; vertical-align: top }
.verdict { font-weight: 600; padding: 0.1em 0.5em; border-radius: 0.3em; background: #e8e8e8 }
.agrees { background: #cdebd0 } .differs { background: #f7d9b9 } .failed { background: #f3bcbc }
.note { color: #444; max-width: 60em }
"""


def write_index(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Write ``index.html`` and ``index.json`` of outcomes, with the places in the code of numbered items."""
    documents = list(dict.fromkeys(o.item.document for o in outcomes))
    content = json.dumps(index_content(outcomes), indent=1, allow_nan=False)
    write_atomically(folder / "index.json", lambda path: path.write_text(content, encoding="utf-8"))
    page = _page(outcomes, documents)
    write_atomically(folder / "index.html", lambda path: path.write_text(page, encoding="utf-8"))


def index_content(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the index as what JSON holds: items, and the places in the code of every numbered item."""
    documents = list(dict.fromkeys(o.item.document for o in outcomes))
    return {"items": [_entry(o) for o in outcomes], "code": [e for d in documents for e in _code(d)]}


def _entry(outcome: Outcome) -> dict[str, Any]:
    item = outcome.item
    return {
        "document": item.document,
        "item": item.name,
        "title": item.title,
        "verdict": outcome.verdict,
        "printed": [
            {
                "name": p.name,
                "text": p.text,
                "low": _finite(p.low),
                "high": _finite(p.high),
                "unit": p.unit,
                "ours": _finite(outcome.values.get(p.name, math.nan)),
                "fitted": p.fitted,
            }
            for p in item.printed
        ],
        "values": {key: _finite(value) for key, value in outcome.values.items()},
        "lacks": item.lacks,
        "why": item.why if outcome.verdict == "differs" else "",
        "failure": outcome.failure,
        "files": list(outcome.files),
        "seconds": round(outcome.seconds, 2),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _code(document: str) -> list[dict[str, Any]]:
    found = places()
    return [
        {
            "document": document,
            "item": f"{n.kind} {n.number}",
            "title": n.title,
            "places": [str(p) for p in found.get(n.key, [])],
            "without_code": n.without_code,
        }
        for n in numbered_items(document)
    ]


def _page(outcomes: Sequence[Outcome], documents: Sequence[str]) -> str:
    names = " and ".join(d.upper() for d in documents)
    counts = Counter(o.verdict for o in outcomes)
    said = ", ".join(f"{n} {verdict}" for verdict, n in counts.most_common())
    rows = "".join(
        f'<tr><td><a href="#{o.item.folder}">{o.item.document.upper()} {escape(_called(o))}</a></td>'
        f"<td>{escape(o.item.title)}</td><td>{_badge(o)}</td></tr>"
        for o in outcomes
    )
    sections = "".join(_section(o) for o in outcomes)
    lists = "".join(_code_table(d) for d in documents)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{names} rebuilt</title><style>{STYLE}</style></head><body>"
        f"<h1>{names} rebuilt</h1><p>{len(outcomes)} items: {said}. A verdict is computed from the numbers "
        "that the document prints and the tolerance stated beside each. A number that ours was fitted to "
        f"tests nothing.</p><table><tr><th>item</th><th>shows</th><th>verdict</th></tr>{rows}</table>"
        f"{sections}{lists}</body></html>\n"
    )


def _called(outcome: Outcome) -> str:
    return f"{KINDS[outcome.item.kind]} {outcome.item.number}"


def _badge(outcome: Outcome) -> str:
    return f'<span class="verdict {outcome.verdict.split()[0]}">{outcome.verdict}</span>'


def _section(outcome: Outcome) -> str:
    item = outcome.item
    head = f"{item.document.upper()} {_called(outcome)}: {item.title}"
    parts = [f'<section id="{item.folder}"><h2>{escape(head)}</h2><p>{_badge(outcome)}</p>']
    if outcome.failure:
        parts.append(f"<p>{escape(outcome.failure)}</p>")
    parts.append(_numbers(outcome))
    if outcome.verdict == "differs":
        parts.append(f'<p class="note">Why: {escape(item.why or "not known")}</p>')
    if item.lacks:
        parts.append(f'<p class="note">Not printed: {escape(item.lacks)}</p>')
    pictures = [f for f in outcome.files if f.endswith(".png")]
    others = [f for f in outcome.files if f not in pictures]
    parts += [f'<a href="{escape(f)}"><img src="{escape(f)}" alt="{escape(f)}"></a>' for f in pictures]
    if others:
        links = ", ".join(f'<a href="{escape(f)}">{escape(f.rpartition("/")[2])}</a>' for f in others)
        parts.append(f"<p>{links}</p>")
    return "".join(parts) + "</section>"


def _numbers(outcome: Outcome) -> str:
    printed = {p.name: p for p in outcome.item.printed}
    rows = []
    for name in dict.fromkeys([*printed, *outcome.values]):
        ours = f"{outcome.values[name]:.4g}" if name in outcome.values else ""
        p = printed.get(name)
        if p is None:
            cells = (name, "-", "-", ours, "")
        else:
            met = "" if not ours else "met" if p.agrees(outcome.values[name]) else "missed"
            note = f"{met}; no test: {p.fitted}" if p.fitted else met
            cells = (name, p.text, p.expected, f"{ours} {p.unit}".strip(), note)
        rows.append("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in cells) + "</tr>")
    if not rows:
        return ""
    titles = ("quantity", "the document prints", "agrees if", "ours", "")
    return f"<table><tr>{''.join(f'<th>{t}</th>' for t in titles)}</tr>{''.join(rows)}</table>"


def _code_table(document: str) -> str:
    rows = "".join(
        f"<tr><td>{escape(e['item'])}</td><td>{escape(e['title'])}</td>"
        f"<td>{escape(', '.join(e['places']) or e['without_code'] or 'no place yet')}</td></tr>"
        for e in _code(document)
    )
    return (
        f"<section><h2>{document.upper()}: where in the code</h2>"
        "<table><tr><th>item</th><th>title</th><th>place, or why there is none</th></tr>"
        f"{rows}</table></section>"
    )
