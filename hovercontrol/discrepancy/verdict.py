"""The verdict from a search and its remainders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from hovercontrol.discrepancy.evidence.remainder import Remainder
from hovercontrol.discrepancy.evidence.sensors import SlowError
from hovercontrol.discrepancy.search.confirm import Selection

Verdict = Literal["effect", "none", "ambiguous", "partial", "unexplained"]


def verdict_of(selection: Selection, remainders: Sequence[Remainder | SlowError]) -> Verdict:
    """Return the verdict; a remainder does not withdraw a name.

    ========== ==================================================================================
    none       nothing is missing
    effect     named, and nothing remains beyond noise
    partial    named, and something remains that no known effect explains
    ambiguous  one of several effects
    unexplained something is missing, nothing can be named
    ========== ==================================================================================
    """
    remains = any(r.there for r in remainders)
    if any(not r.same for r in selection.rivals):
        return "ambiguous"
    if selection.effects:
        return "partial" if remains else "effect"
    return "unexplained" if remains else "none"
