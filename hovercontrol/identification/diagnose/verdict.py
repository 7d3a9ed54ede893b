"""The verdict of a diagnosis, from the effects selected and the remainders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from hovercontrol.identification.diagnose.evidence.remainder import Remainder
from hovercontrol.identification.diagnose.evidence.sensors import SlowError
from hovercontrol.identification.diagnose.search.confirm import Selection

Verdict = Literal["effect", "none", "ambiguous", "partial", "unexplained"]


def verdict_of(
    selection: Selection, remainders: Sequence[Remainder | SlowError], *, open_: bool = False
) -> Verdict:
    """Return the verdict on a selection; see :func:`verdict`.

    Parameters
    ----------
    open_ : bool, optional
        Whether an unknown function may have one of several forms.
    """
    rivals = open_ or any(not r.same for r in selection.rivals)
    return verdict(bool(selection.effects), rivals, any(r.there for r in remainders))


def verdict(named: bool, rivals: bool, remains: bool) -> Verdict:
    """Return the verdict. A remainder does not withdraw a named effect.

    =========== =================================================================================
    none        no effect is missing
    effect      effects are named, and only noise remains
    partial     effects are named, and an unmodelled residual is left
    ambiguous   one of several effects is missing, or an unknown function has one of several forms; the
                logs do not distinguish them
    unexplained something is missing, but no effect can be named
    =========== =================================================================================
    """
    if rivals:
        return "ambiguous"
    if named:
        return "partial" if remains else "effect"
    return "unexplained" if remains else "none"
