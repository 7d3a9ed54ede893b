"""Where in the code each numbered item of the documents stands, from markers beside the code.

A marker stands in a docstring or a comment, in square brackets: the document, the kind and one or more
numbers, as in ``C17 eq 14a, 14b`` or ``K06 table 6.7``. The kinds are those of
:data:`hovercontrol.reproduce.item.KINDS`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError
from hovercontrol.reproduce.item import KINDS

#: ``[C17 eq 15, 16]``; lists of numbers of one kind.
MARKER = re.compile(rf"\[(C17|K06) ({'|'.join(KINDS)}) ([0-9A-B][0-9a-z.]*(?:, [0-9A-B][0-9a-z.]*)*)\]")

_PACKAGE = Path(__file__).parents[1]


@checked
@dataclass(frozen=True)
class Numbered:
    """A numbered item of a document.

    Parameters
    ----------
    document, kind, number : str
        ``c17``, ``eq``, ``14a``.
    title : str
        In our words.
    without_code : str
        Why no code stands for it; empty where code does.

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

    @property
    def key(self) -> tuple[str, str, str]:
        """Document, kind and number."""
        return self.document, self.kind, self.number


@checked
@dataclass(frozen=True)
class Place:
    """A marker in the code: ``file`` from the project's folder on, ``line`` from 1 on.

    Examples
    --------
    >>> Place("hovercontrol/effects/drag.py", 54).line
    54
    """

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


@checked
def numbered_items(document: str) -> list[Numbered]:
    """Return every numbered item of a document (``c17`` or ``k06``), in the order of its list.

    Raises
    ------
    InputError
        If there is no list of that document.

    Examples
    --------
    >>> next(n.title for n in numbered_items("c17") if n.key == ("c17", "eq", "11"))
    'dynamics of the hovercraft in its velocities'
    """
    path = resources.files("hovercontrol.reproduce") / "numbered" / f"{document}.csv"
    if not path.is_file():
        raise InputError(f"no list of the numbered items of {document!r}: expected c17 or k06")
    rows = csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    return [Numbered(document, r["kind"], r["number"], r["title"], r["without_code"] or "") for r in rows]


@checked
def places() -> dict[tuple[str, str, str], list[Place]]:
    """Return all markers of the package and its analyses: places by document, kind and number.

    Examples
    --------
    >>> ("c17", "eq", "14a") in places()
    True
    """
    found: dict[tuple[str, str, str], list[Place]] = {}
    for shown, path in _sources():
        for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            for document, kind, numbers in MARKER.findall(text):
                for number in numbers.split(", "):
                    found.setdefault((document.lower(), kind, number), []).append(Place(shown, line))
    return found


def _sources() -> Iterator[tuple[str, Path]]:
    """Yield the files that may have markers, with the names to show."""
    for path in sorted(_PACKAGE.rglob("*")):
        if path.suffix in (".py", ".toml"):
            yield f"hovercontrol/{path.relative_to(_PACKAGE).as_posix()}", path
    beside = _PACKAGE.parent / "analyses"  # in a checkout; in a wheel they lie inside the package
    for path in sorted(beside.glob("*.py")):
        yield f"analyses/{path.name}", path
