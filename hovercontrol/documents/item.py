"""An item of a document that is rebuilt: what is printed of it, what measures it, the verdict on both."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr

Verdict = Literal["agrees", "differs", "not printed in enough detail", "failed"]

#: Kinds of numbered items, by what markers and the command line call them.
KINDS = {
    "eq": "equation",
    "lemma": "lemma",
    "theorem": "theorem",
    "proposition": "proposition",
    "table": "table",
    "fig": "figure",
}


@checked
@dataclass(frozen=True)
class Printed:
    """A number that a document prints, and the range in which ours agrees with it.

    Parameters
    ----------
    name : str
        Of the measured value that is compared.
    text : str
        What the document says, in its own figures.
    low, high : float
        Ours agrees between them, both included.
    unit : str, optional
    fitted : str, optional
        What of ours was chosen so that the value comes out; then the number tests nothing.
    value : float, optional
        As printed, in `unit`.

    Examples
    --------
    >>> Printed("error", "0.02 m", low=0.015, high=0.025, unit="m").high
    0.025
    """

    name: str
    text: str
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    fitted: str = ""
    value: float = math.nan

    def agrees(self, value: float) -> bool:
        """Return whether a measured value lies in the range."""
        return self.low <= value <= self.high

    @property
    def expected(self) -> str:
        """The range in words: ``0.57 to 0.63 m``."""
        unit = f" {self.unit}" if self.unit else ""
        if math.isinf(self.low):
            return f"at most {self.high:.4g}{unit}"
        if math.isinf(self.high):
            return f"at least {self.low:.4g}{unit}"
        return f"{self.low:.4g} to {self.high:.4g}{unit}"


@checked
@dataclass(frozen=True)
class Item:
    """A table, figure or equation of a document, and what rebuilds it.

    Parameters
    ----------
    document : str
        ``c17`` or ``k06``.
    kind : str
        One of :data:`KINDS`.
    number : str
        As the document has it (``2``, ``6.23``).
    title : str
        What it shows, in our words.
    measure : callable
        Draws into a folder and returns the measured values by name; units in the names of those that the
        document does not print.
    printed : tuple of Printed, optional
    lacks : str, optional
        What the document does not print of what the item takes.
    why : str, optional
        What is known about the cause where ours differs.
    units : callable, optional
        Returns the units of measured values by name, where neither their names nor `printed` tell them.

    Examples
    --------
    >>> Item("c17", "table", "1", "tracking errors", lambda folder: {"error": 0.0}).number
    '1'
    """

    document: str
    kind: str
    number: str
    title: str
    measure: Callable[[Path], Mapping[str, float]]
    printed: tuple[Printed, ...] = ()
    lacks: str = ""
    why: str = ""
    units: Callable[[], Mapping[str, str]] = dict

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"{self.name}: the kind must be one of {', '.join(KINDS)}, found {self.kind!r}")

    @property
    def name(self) -> str:
        """``table 2``, ``fig 6.23``: what the command line calls it."""
        return f"{self.kind} {self.number}"

    @property
    def folder(self) -> str:
        """Name of the folder of its files: ``c17_table_2``."""
        return f"{self.document}_{self.kind}_{self.number}".replace(".", "_")


@checked
@dataclass(frozen=True)
class Outcome:
    """What rebuilding an item gave.

    Parameters
    ----------
    item : Item
    values : mapping of str to float
        Measured, in the units of what is printed.
    files : tuple of str, optional
        Relative to the folder of the index.
    seconds : float, optional
        What it took [s].
    failure : str, optional
        Why nothing came of it.

    Examples
    --------
    >>> item = Item("c17", "table", "1", "errors", lambda folder: {}, (Printed("error", "0.1 m", high=0.1),))
    >>> Outcome(item, {"error": 0.02}).verdict, Outcome(item, {"error": 0.2}).verdict
    ('agrees', 'differs')
    """

    item: Item
    values: Mapping[str, float] = field(default_factory=dict)
    files: tuple[str, ...] = ()
    seconds: float = 0.0
    failure: str = ""

    __repr__ = short_repr

    @property
    def verdict(self) -> Verdict:
        """``agrees`` if each printed number is met and one of them at least was not fitted.

        ``differs`` if one is missed; where nothing that is printed tests ours, ``not printed in enough
        detail``; ``failed`` if nothing was measured.
        """
        if self.failure:
            return "failed"
        if any(not p.agrees(self.values[p.name]) for p in self.item.printed):
            return "differs"
        if any(not p.fitted for p in self.item.printed):
            return "agrees"
        return "not printed in enough detail"
