"""The few pieces of HTML that sections are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(head: Sequence[str], rows: Iterable[Sequence[str]], new: Sequence[str] = ()) -> str:
    """Return a table that scrolls sideways where it is too wide.

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
    heading = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = [
        f"<tr{' class=new' if row[0] in new else ''}>{''.join(f'<td>{escape(c)}</td>' for c in row)}</tr>"
        for row in rows
    ]
    return f'<div class="scroll"><table><tr>{heading}</tr>{"".join(lines)}</table></div>'


def items(title: str, parts: Sequence[str], kind: str = "") -> str:
    """Return a list under a heading; nothing if it is empty."""
    if not parts:
        return ""
    lines = "".join(f"<li>{escape(part)}</li>" for part in parts)
    return f"<h3>{escape(title)}</h3><ul class='{kind}'>{lines}</ul>"


def folded(title: str, content: str) -> str:
    """Return what is shown on request."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text; nothing if there is none."""
    mark = f' class="{kind}"' if kind else ""
    return f"<p{mark}>{escape(text)}</p>" if text else ""


def grid(plots: Iterable[str]) -> str:
    """Return pictures side by side, as many as fit."""
    return '<div class="grid">' + "".join(f"<figure>{p}</figure>" for p in plots if p) + "</div>"
