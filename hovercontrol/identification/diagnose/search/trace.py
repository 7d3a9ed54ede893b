"""The decisions of a search, one row each, so that "why not this effect?" is looked up."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr


@checked
@dataclass(frozen=True)
class Decision:
    """One decision of a search: a rule applied to an effect.

    Attributes
    ----------
    step : {"score", "fit", "confirm", "challenge", "hold out"}
    effect : str
    rule : str
        What is asked, as text that ends before the limit: ``"gain in twice the log likelihood, at least"``.
    value : float
        The number that was compared; NaN if the rule compares none.
    limit : float
        The number that it was compared with; NaN if there is none.
    passed : bool

    Examples
    --------
    >>> Decision("confirm", "slope", "gain in twice the log likelihood, at least", 310.0, 28.0, True).passed
    True
    """

    step: str
    effect: str
    rule: str
    value: float = math.nan
    limit: float = math.nan
    passed: bool = True

    __repr__ = short_repr

    def result(self) -> dict[str, Any]:
        """Return the entry of ``result.json``."""
        return dict(vars(self))


def decisions_about(trace: Iterable[Decision], effect: str) -> list[Decision]:
    """Return the decisions about one effect, in their order.

    Parameters
    ----------
    trace : iterable of Decision
    effect : str

    Examples
    --------
    >>> rows = [Decision("score", "slope", ""), Decision("score", "wind", ""), Decision("fit", "slope", "")]
    >>> [row.step for row in decisions_about(rows, "slope")]
    ['score', 'fit']
    """
    return [row for row in trace if row.effect == effect]
