"""HTML of paragraphs, lists, tables and legends."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

#: Characters from which on a name may break at its underscores.
LONG = 12


def table(head: Sequence[str], rows: Iterable[Sequence[str]], new: Sequence[str] = ()) -> str:
    """Return a table without empty columns; where it finds no room it scrolls, with a shadow at the edge.

    Parameters
    ----------
    head : sequence of str
    rows : iterable of sequence of str
        Text, one cell for each heading.
    new : sequence of str, optional
        First cells of rows that are marked as new.

    Examples
    --------
    >>> table(["name"], [["<a>"]])
    '<div class="scroll"><table><tr><th>name</th></tr><tr><td>&lt;a&gt;</td></tr></table></div>'
    """
    rows = [tuple(row) for row in rows]
    kept = [k for k in range(len(head)) if k == 0 or any(row[k] for row in rows)]
    head, rows = [head[k] for k in kept], [tuple(row[k] for k in kept) for row in rows]
    heading = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = []
    for name, *cells in rows:
        mark = " class=new" if name in new else ""
        rest = "".join(f"<td>{escape(_tied(cell))}</td>" for cell in cells)
        lines.append(f"<tr{mark}>{_named(name)}{rest}</tr>")
    return f'<div class="scroll"><table><tr>{heading}</tr>{"".join(lines)}</table></div>'


def items(title: str, parts: Sequence[str], kind: str = "") -> str:
    """Return a list under a heading; nothing if it is empty."""
    if not parts:
        return ""
    lines = "".join(f"<li>{escape(part)}</li>" for part in parts)
    mark = f' class="{kind}"' if kind else ""
    return f"<h3>{escape(title)}</h3><ul{mark}>{lines}</ul>"


def folded(title: str, content: str) -> str:
    """Return a folded section."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text; nothing if there is none."""
    mark = f' class="{kind}"' if kind else ""
    return f"<p{mark}>{escape(text)}</p>" if text else ""


def grid(plots: Iterable[str]) -> str:
    """Return pictures side by side, as many as fit."""
    return '<div class="grid">' + "".join(f"<figure>{p}</figure>" for p in plots if p) + "</div>"


def _named(cell: str) -> str:
    """Return the first cell of a row, in which a long name may break."""
    name = escape(cell)
    return f"<td>{name.replace('_', '_<wbr/>') if len(cell) > LONG else name}</td>"


def _tied(cell: str) -> str:
    """Return a cell in which no line breaks before a percent sign or an interval, or behind a sign."""
    return re.sub(r" (?=[%±])|(?<=<) ", "\u00a0", cell)


LEGEND = {
    "measured": "measured",
    "before": "the given model, its coefficients fitted again",
    "after": "the amended model",
    "start": "start of a run",
}


def legend(*kinds: str, **others: str) -> str:
    """Return which colour is what; `others` have words of their own."""
    words = {**{k: LEGEND[k] for k in kinds}, **others}
    spans = "".join(f'<span class="{k}">{escape(text)}</span>' for k, text in words.items())
    return f'<p class="legend">{spans}</p>'
