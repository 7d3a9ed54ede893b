"""Where in the code each numbered item of the documents stands, from markers beside the code.

A marker stands in a docstring or a comment, in square brackets: the document, the kind and one or more
numbers, as in ``C17 eq 14a, 14b`` or ``K06 table 6.7``. The kinds are those of
:data:`hovercontrol.documents.item.KINDS`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hovercontrol.base.boundary import checked
from hovercontrol.documents.item import KINDS

#: ``[C17 eq 15, 16]``; lists of numbers of one kind.
MARKER = re.compile(rf"\[(C17|K06) ({'|'.join(KINDS)}) ([0-9A-B][0-9a-z.]*(?:, [0-9A-B][0-9a-z.]*)*)\]")

_PACKAGE = Path(__file__).parents[1]


@checked
@dataclass(frozen=True)
class Place:
    """A marker in the code: ``file`` from the project's folder on, ``line`` from 1 on.

    Examples
    --------
    >>> Place("hovercontrol/craft/effects/drag.py", 54).line
    54
    """

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


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
