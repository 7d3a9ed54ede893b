"""What a search amounts to, and what speaks against its names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from hovercontrol.discrepancy.candidates import Scores, Signatures, candidates
from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.holdout import Gap, may_rise
from hovercontrol.discrepancy.probes import Sign
from hovercontrol.discrepancy.selection import Selection
from hovercontrol.discrepancy.weighing import EACH, EXPLAINED, LEAST

Verdict = Literal["effect", "none", "ambiguous", "unexplained"]

#: Rise of twice the negative log likelihood on the hold-out log that no effect survives.
VETO = 12.0


def verdict_of(selection: Selection, signs: Sequence[Sign]) -> Verdict:
    """Return the verdict on a search, given the signs against its names."""
    if signs or (not selection.process and selection.final.chi2_per_dof > EXPLAINED):
        return "unexplained"
    if selection.rivals:
        return "ambiguous"
    return "effect" if selection.effects else "none"


def signs_against(
    selection: Selection, held: Data | None, length: float, before: Gap | None, after: Gap | None
) -> tuple[Sign, ...]:
    """Return what speaks against the names of a search.

    Its gaps on the hold-out log, over windows of `length` seconds, are `before` and `after`.
    """
    found = _slow(selection) + _weak(selection)
    return found + _veto(selection, held, length, before, after) if held and before and after else found


def stopped(selection: Selection, names: Sequence[str] | None, max_effects: int) -> list[str]:
    """Return a warning if it was the limit on effects that ended the search."""
    if len(selection.effects) < max_effects:
        return []
    final = selection.final
    best = Scores(final, Signatures(final, candidates(final, names))).best()
    bar = 1.0 if selection.process else max(1.0, final.chi2_per_dof)
    more = [s.gain for s in best if s.allowed and s.gain > bar * (LEAST + EACH * len(s.candidate.amplitudes))]
    if not more:
        return []
    count = f"{max_effects} effect{'s' if max_effects > 1 else ''}"
    return [
        f"stopped at {count} (--max-effects {max_effects}): another would take {max(more):.3g} more from "
        "twice the negative log likelihood; allow more effects"
    ]


def _slow(selection: Selection) -> tuple[Sign, ...]:
    """Return a sign if long windows leave what short ones do not show."""
    if not selection.slow:
        return ()
    text = (
        f"stretches of {selection.final.windowed.length:g} s are explained, longer ones are not: something "
        "small that lasts is missing"
    )
    count = int(selection.final.windowed.seen.sum())
    return (Sign("slow", text, (selection.slow - 1.0) * count, 1),)


def _weak(selection: Selection) -> tuple[Sign, ...]:
    """Return a sign if the logs want an effect whose size they do not tell: another may be meant."""
    return tuple(
        Sign("weak", f"{name} would take some of the misfit, but these logs do not tell its size", gain, 1)
        for name, gain in selection.gains.items()
        if name in selection.effects and gain < LEAST
    )


def _veto(selection: Selection, held: Data, length: float, before: Gap, after: Gap) -> tuple[Sign, ...]:
    """Return a sign if the amended model is worse on the hold-out log than the given one."""
    worse = after.chi2 - before.chi2
    least = VETO * max(1.0, after.chi2 / max(after.count, 1))
    if not selection.effects or worse < least or worse < least + may_rise(selection.final, held, length):
        return ()
    names = " and ".join(selection.effects)
    text = (
        f"{names} would fit the training logs, but the hold-out log is predicted worse with it "
        "than the training logs leave open"
    )
    return (Sign("hold-out", text, worse, len(selection.effects)),)
