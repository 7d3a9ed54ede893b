"""The index of what was rebuilt: a page and the same as JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import hovercontrol
from hovercontrol.base.folders import write_folder
from hovercontrol.documents.item import KINDS, Outcome
from hovercontrol.documents.markers import places
from hovercontrol.documents.printed import numbered_items
from hovercontrol.documents.registry import all_items

#: The documents as their readers know them.
TITLES = {
    "c17": "Cabecinhas, Batista, Oliveira, Silvestre: Hovercraft Control With Dynamic Parameters "
    "Identification, IEEE Transactions on Control Systems Technology, 2017",
    "k06": "Kulis: Feedback Control of a Hovercraft over a Wireless Link, MSc thesis, University of "
    "Maryland, 2006",
}
#: What the verdicts mean; how many have one, in words.
VERDICTS = {
    "agrees": ("agree", "ours lies within the tolerance of every number that the document prints"),
    "differs": ("differ", "at least one number is missed; the cause stands with the item"),
    "not printed in enough detail": (
        "not printed in enough detail",
        "the document prints no number that would test ours, which is shown all the same",
    ),
    "failed": ("failed", "nothing was computed; the error stands with the item"),
}

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em;
  overflow-wrap: break-word }
h1 { line-height: 1.2 } h2 { line-height: 1.25; font-size: 1.3em }
.wide { overflow-x: auto }
table { border-collapse: collapse; width: 100%; margin: 0.5em 0 1em }
th, td { border-bottom: 1px solid #ccc; padding: 0.3em 0.8em 0.3em 0; text-align: left; vertical-align: top }
td.item, td.number { white-space: nowrap; font-variant-numeric: tabular-nums }
span.place { font-family: ui-monospace, monospace; font-size: 0.87em; overflow-wrap: anywhere }
section { border-top: 2px solid #888; margin-top: 2em }
figure { display: inline-block; margin: 0.3em 0.6em 0 0; vertical-align: top; max-width: 100% }
figcaption { color: #444; font-size: 0.87em }
img { max-width: 100%; width: 32em }
.verdict { font-weight: 600; padding: 0.1em 0.5em; border-radius: 0.3em; background: #e8e8e8 }
.agrees, .met { background: #cdebd0 } .differs, .missed { background: #f7d9b9 }
.failed { background: #f3bcbc }
.met, .missed { padding: 0.05em 0.4em; border-radius: 0.3em }
.note { color: #444; max-width: 60em }
code { background: #f0f0f0; padding: 0.1em 0.3em; border-radius: 0.2em }
@media (max-width: 40em) {
  body { font-size: 14px; margin: 1em auto } th, td { padding-right: 0.4em }
  td.number { white-space: normal }
}
dt { float: left; clear: left; margin-right: 0.6em } dd { margin: 0 0 0.4em 0; color: #444 }
"""


def write_index(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Write ``index.html`` and ``index.json`` of outcomes, with the places in the code of numbered items."""
    documents = list(dict.fromkeys(o.item.document for o in outcomes))
    content = json.dumps(index_content(outcomes), indent=1, allow_nan=False)
    page = _page(outcomes, documents)

    def write(place: Path) -> None:
        (place / "index.json").write_text(content, encoding="utf-8")
        (place / "index.html").write_text(page, encoding="utf-8")

    write_folder(folder, write)


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
    drawn = {(i.document, i.kind, i.number) for i in all_items(document)}
    return [
        {
            "document": document,
            "item": f"{n.kind} {n.number}",
            "title": n.title,
            "places": [str(p) for p in found.get(n.key, [])],
            "without_code": n.without_code,
            "drawn": n.kind != "fig" or n.key in drawn,
        }
        for n in numbered_items(document)
    ]


def _page(outcomes: Sequence[Outcome], documents: Sequence[str]) -> str:
    names = " and ".join(d.upper() for d in documents)
    counts = Counter(o.verdict for o in outcomes)
    said = ", ".join(
        f"{n} {VERDICTS[verdict][0] if n > 1 else verdict}" for verdict, n in counts.most_common()
    )
    rows = "".join(
        f'<tr><td class="item"><a href="#{o.item.folder}">{o.item.document.upper()} {escape(_called(o))}</a>'
        f"</td><td>{escape(o.item.title)}</td><td>{_badge(o)}</td></tr>"
        for o in outcomes
    )
    means = "".join(
        f'<dt><span class="verdict {v.split()[0]}">{v}</span></dt><dd>{VERDICTS[v][1]}</dd>'
        for v in VERDICTS
        if v in counts
    )
    sources = "".join(f"<p>{d.upper()}: {escape(TITLES[d])}.</p>" for d in documents)
    links = " and ".join(f'<a href="#{d}_code">{d.upper()}</a>' for d in documents)
    head = "<tr><th>item</th><th>shows</th><th>verdict</th></tr>"
    sections = "".join(_section(o) for o in outcomes)
    lists = "".join(_code_table(d) for d in documents)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{names} rebuilt</title><style>{STYLE}</style></head><body>"
        f"<h1>{names} rebuilt</h1>{sources}"
        f"<p>hovercontrol {escape(hovercontrol.__version__)} has computed {len(outcomes)} of the tables, "
        f"figures and results again: {said}. Each verdict is computed from the numbers that the document "
        "prints and the tolerance stated beside each; a number that ours was fitted to tests nothing.</p>"
        f"<dl>{means}</dl>"
        f"<p>Where each equation, table and figure stands in the code: {links}.</p>"
        f'<div class="wide"><table>{head}{rows}</table></div>{sections}{lists}</body></html>\n'
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
        parts.append(f'<p class="note">Why it differs: {escape(item.why or "not known")}.</p>')
    if item.lacks:
        parts.append(f'<p class="note">What the document leaves open: {escape(item.lacks)}.</p>')
    pictures = [f for f in outcome.files if f.endswith(".png")]
    others = [f for f in outcome.files if f not in pictures]
    for f in pictures:
        image = (
            f'<img src="{escape(f)}" alt="{escape(_plain(f))}, rebuilt: {escape(item.title)}" loading="lazy">'
        )
        parts.append(
            f'<figure><a href="{escape(f)}">{image}</a>'
            f"<figcaption>{escape(_plain(f)) if len(pictures) > 1 else ''}</figcaption></figure>"
        )
    command = f'hovercontrol analyze "{item.document} {item.name}"'
    more = "".join(f' <a href="{escape(f)}">{escape(f.rpartition("/")[2])}</a>' for f in others)
    files = f" Files:{more}." if more else ""
    parts.append(f'<p class="note">Again: <code>{escape(command)}</code>.{files}</p>')
    return "".join(parts) + "</section>"


def _plain(file: str) -> str:
    """Return a picture's name as words."""
    return file.rpartition("/")[2].removesuffix(".png").replace("_", " ")


def _numbers(outcome: Outcome) -> str:
    printed = {p.name: p for p in outcome.item.printed}
    rows, units = [], outcome.item.units()
    for name in dict.fromkeys([*printed, *outcome.values]):
        ours = f"{outcome.values[name]:.4g}" if name in outcome.values else ""
        p = printed.get(name)
        if p is None:
            cells = (name, "-", "-", f"{ours} {units.get(name, '')}".strip(), "", "")
        else:
            met = "" if not ours else "met" if p.agrees(outcome.values[name]) else "missed"
            note = f" no test, ours was fitted: {p.fitted}" if p.fitted else ""
            cells = (name, p.text, p.expected, f"{ours} {p.unit}".strip(), met, note)
        rows.append(_row(*cells))
    if not rows:
        return ""
    titles = ("quantity", "the document prints", "agrees if", "ours", "result")
    head = "".join(f"<th>{t}</th>" for t in titles)
    return f'<div class="wide"><table><tr>{head}</tr>{"".join(rows)}</table></div>'


def _row(name: str, text: str, expected: str, ours: str, met: str, note: str) -> str:
    shown = f'<span class="{met}">{met}</span>' if met else ""
    cells = "".join(f"<td>{escape(_units(c))}</td>" for c in (name, text, expected))
    return f'<tr>{cells}<td class="number">{escape(_units(ours))}</td><td>{shown}{escape(note)}</td></tr>'


def _units(text: str) -> str:
    """Return a text whose units are set as print sets them: ``kg*m^2`` with a point and a raised 2."""
    return text.replace("*", "\N{MIDDLE DOT}").replace("^2", "\N{SUPERSCRIPT TWO}")


def _code_table(document: str) -> str:
    rows = "".join(
        f'<tr><td class="item">{escape(e["item"])}</td><td>{escape(e["title"])}</td>{_place(e)}</tr>'
        for e in _code(document)
    )
    return (
        f'<section id="{document}_code"><h2>{document.upper()}: where in the code</h2><div class="wide">'
        "<table><tr><th>item</th><th>title</th><th>file and line, or why there is none</th></tr>"
        f"{rows}</table></div></section>"
    )


def _place(entry: Mapping[str, Any]) -> str:
    if entry["places"]:
        said = "" if entry["drawn"] else "not drawn again, a diagram of what stands at "
        places = escape(", ".join(entry["places"])).replace("/", "/<wbr>")
        return f'<td>{said}<span class="place">{places}</span></td>'
    return f"<td>{escape(entry['without_code'] or 'no place yet')}</td>"
