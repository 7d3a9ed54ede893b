"""The Jinja2 templates of the report, and helpers to fill them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

#: Names longer than this many characters may break at their underscores.
LONG = 12

LEGEND = {
    "measured": "measured",
    "before": "the given model, its coefficients fitted again",
    "after": "the amended model",
    "start": "start of a run",
}


class Table(NamedTuple):
    """A table of text: headings, rows, and the first cells of rows to be marked as new."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    new: Sequence[str] = ()


def table(head: Sequence[str], rows: Iterable[Sequence[str]], new: Sequence[str] = ()) -> Table:
    """Return a table without empty columns.

    Examples
    --------
    >>> table(["name", "unit"], [["a", ""], ["b", ""]])
    Table(head=['name'], rows=[('a',), ('b',)], new=())
    """
    rows = [tuple(row) for row in rows]
    kept = [k for k in range(len(head)) if k == 0 or any(row[k] for row in rows)]
    return Table([head[k] for k in kept], [tuple(row[k] for k in kept) for row in rows], new)


def legend(*kinds: str, **others: str) -> dict[str, str]:
    """Return the legend text of each colour; `others` are given with their text."""
    return {**{k: LEGEND[k] for k in kinds}, **others}


def render(name: str, **values: object) -> Markup:
    """Return a rendered template; text is escaped unless it is marked as HTML.

    Parameters
    ----------
    name : str
        Name of a file in ``templates``.
    **values : object
        Variables of the template; a missing one is an error.

    Examples
    --------
    >>> print(render("floor_map.html", picture="<svg/>", kind="after", top="1.0", unit="m/s²"))
    <svg/><p class="legend shades">0 <span class="shade after"></span> 1.0 m/s²</p>
    """
    return Markup(_environment().get_template(name).render(values))


def figures(pictures: Iterable[str]) -> Markup:
    """Return figures side by side, as many as fit in a row."""
    return Markup(_environment().get_template("parts.html").module.figures(list(pictures)))  # type: ignore[attr-defined]


@cache
def _environment() -> Environment:
    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates", encoding="utf-8"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    made.filters |= {"tied": _tied, "breakable": _breakable}
    return made


def _breakable(cell: str) -> Markup:
    """Return a name that may break at its underscores if it is long."""
    name = escape(cell)
    return Markup(name.replace("_", Markup("_<wbr/>"))) if len(cell) > LONG else name


def _tied(cell: str) -> str:
    """Return text with no-break spaces around ±, before a percent sign and after "<"."""
    return re.sub(r" (?=[%±])|(?<=[<±]) ", "\u00a0", cell)
