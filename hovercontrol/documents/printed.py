"""What the documents print: each numbered item with its title and numbers, from ``DOCUMENT/printed.csv``.

The table has a row for each printed number of an item, and one row for an item that has none. Title and
``without_code`` stand in an item's first row. A bound that is empty is infinite.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.short_repr import short_repr
from hovercontrol.documents.item import Item, Printed

#: What computes an item: it draws into a folder and returns the numbers by name.
Measure = Callable[[Path], Mapping[str, float]]


@checked
@dataclass(frozen=True)
class Numbered:
    """A numbered item of a document.

    Parameters
    ----------
    document, kind, number : str
        ``c17``, ``eq``, ``14a``.
    title : str
        What it shows, in our words.
    without_code : str
        Why no code stands for it; empty where code does.
    printed : tuple of Printed
        Its numbers that are compared with ours.

    Examples
    --------
    >>> Numbered("c17", "eq", "14a", "what u tells").without_code
    ''
    """

    document: str
    kind: str
    number: str
    title: str
    without_code: str = ""
    printed: tuple[Printed, ...] = field(default=())

    __repr__ = short_repr

    @property
    def key(self) -> tuple[str, str, str]:
        """Document, kind and number."""
        return self.document, self.kind, self.number


@checked
def numbered_items(document: str) -> list[Numbered]:
    """Return every numbered item of a document (``c17`` or ``k06``), in the order of its table.

    Raises
    ------
    InputError
        If there is no table of that document.

    Examples
    --------
    >>> next(n.title for n in numbered_items("c17") if n.key == ("c17", "eq", "11"))
    'dynamics of the hovercraft in its velocities'
    """
    return list(_table(document).values())


@lru_cache(maxsize=8)
def _table(document: str) -> dict[str, Numbered]:
    path = resources.files("hovercontrol.documents") / document / "printed.csv"
    if not path.is_file():
        raise InputError(f"no table of the numbered items of {document!r}: expected c17 or k06")
    first: dict[str, dict[str, str]] = {}
    numbers: dict[str, list[Printed]] = {}
    for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
        name = f"{row['kind']} {row['number']}"
        first.setdefault(name, row)
        if row["name"]:
            numbers.setdefault(name, []).append(_printed(row))
    return {
        name: Numbered(
            document, r["kind"], r["number"], r["title"], r["without_code"], tuple(numbers.get(name, ()))
        )
        for name, r in first.items()
    }


def _printed(row: Mapping[str, str]) -> Printed:
    low, high, value = (
        float(row[key] or default)
        for key, default in (("low", -math.inf), ("high", math.inf), ("value", math.nan))
    )
    return Printed(row["name"], row["text"], low, high, row["unit"], row["fitted"], value)


@checked
def printed(document: str, item: str) -> dict[str, Printed]:
    """Return the numbers that a document prints of an item, by name.

    Parameters
    ----------
    document : str
        ``c17`` or ``k06``.
    item : str
        ``table 1``, ``fig 6.23``.

    Raises
    ------
    InputError
        If the document has no such item.

    Examples
    --------
    >>> printed("c17", "fig 12")["half width of the last lap"].value  # metres
    1.15
    """
    return {p.name: p for p in _numbered(document, item).printed}


def _numbered(document: str, item: str) -> Numbered:
    table = _table(document)
    check_known(item, table, f"{document}: no numbered item {item!r}")
    return table[item]


@checked
def rebuilds(
    document: str,
    item: str,
    *,
    lacks: str = "",
    why: str = "",
    units: Callable[[], Mapping[str, str]] = dict,
) -> Callable[[Measure], Measure]:
    """Return a decorator for the function that computes an item of a document.

    Parameters
    ----------
    document, item : str
        Such as ``c17`` and ``table 1``; title and printed numbers are those of the table.
    lacks, why : str, optional
    units : callable, optional
        As for :class:`~hovercontrol.documents.item.Item`.

    Returns
    -------
    callable
        It gives a function the attribute ``item`` and returns it.

    Raises
    ------
    InputError
        If the document has no such item.

    Examples
    --------
    >>> @rebuilds("c17", "fig 1")
    ... def craft(folder):
    ...     return {}
    >>> craft.item.title
    'sketch of the craft and its frames'
    """
    found = _numbered(document, item)

    def mark(measure: Measure) -> Measure:
        item = Item(*found.key, found.title, measure, found.printed, lacks, why, units)
        measure.__dict__["item"] = item
        measure.__doc__ = measure.__doc__ or f"Rebuild {document.upper()} {item.name}: {item.title}."
        return measure

    return mark
