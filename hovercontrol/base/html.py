"""HTML for notebooks: tables and folded parts; colours follow the page, light or dark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

#: Rows of a table that are shown; the rest is folded away.
ROWS = 14

_CELL = "padding:.15em .7em;text-align:left;vertical-align:top"


class Markup(str):
    """Text that is HTML already."""


def show(value: object) -> str:
    """Return a cell's HTML: numbers short, text escaped.

    Examples
    --------
    >>> show(0.12345678), show("a<b"), show(float("inf")), show(Markup("<b>x</b>"))
    ('0.1235', 'a&lt;b', 'inf', '<b>x</b>')
    """
    if isinstance(value, Markup):
        return value
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}"
    return escape("" if value is None else str(value))


def card(kind: str, name: str, remark: str, *parts: str) -> str:
    """Return a whole: what it is, its name, a line on it, and its parts."""
    line = f" <span style='opacity:.75'>{escape(remark)}</span>" if remark else ""
    head = f"<div style='margin:.3em 0'>{escape(kind)} <b>{escape(name)}</b>{line}</div>"
    return f"<div style='font-size:.95em;max-width:70em'>{head}{''.join(parts)}</div>"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """Return a table; empty without rows, its end folded away where it is long."""
    every = [
        "<tr>" + "".join(f"<td style='{_CELL}'>{show(cell)}</td>" for cell in row) + "</tr>" for row in rows
    ]
    if not every:
        return ""
    heads = "".join(f"<th style='{_CELL}'>{escape(h)}</th>" for h in headings)
    top = f"<table style='border-collapse:collapse'><thead><tr>{heads}</tr></thead><tbody>"
    text = f"{top}{''.join(every[:ROWS])}</tbody></table>"
    if len(every) > ROWS:
        text += fold(f"{len(every) - ROWS} more", f"{top}{''.join(every[ROWS:])}</tbody></table>")
    title = f"<div style='opacity:.75;margin-top:.5em'>{escape(caption)}</div>" if caption else ""
    return title + text


def fold(title: str, body: str, *, unfolded: bool = False) -> str:
    """Return a part that opens at a click; HTML does it alone."""
    flag = " open" if unfolded else ""
    return f"<details{flag}><summary style='cursor:pointer'>{escape(title)}</summary>{body}</details>"


def lines(*texts: str) -> str:
    """Return sentences, one below the other."""
    return "".join(f"<div>{escape(text)}</div>" for text in texts if text)
