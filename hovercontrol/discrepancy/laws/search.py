"""The search for laws that are in no catalogue.

The catalogue is searched first. Where it leaves more than noise, all forms of the grammar are screened on one
table (:mod:`.screen`), and the few best are searched beside the catalogue by the same steps: fit, confirm,
challenge, hold out.

A law stands in place of what the catalogue named, where it is surely likelier, and not beside it: beside a
true name a form may stand for what has none. A law that promises less than half of what the names took is not
fitted.

Among hundreds of forms one may stand for what has no form there: a load that swings makes thrust seem weaker
in surge than in sway. So where a law leaves more than noise, the held-out logs, on which the choice did not
depend, must show it by themselves (:func:`.searched.shown`), and it must take at least half
(`criteria.most`) of the mean square of what is missing in its equation; else it is a lead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hovercontrol.discrepancy.criteria import CRITERIA, Criteria
from hovercontrol.discrepancy.evidence.of_effects import Evidence
from hovercontrol.discrepancy.evidence.remainder import remainders
from hovercontrol.discrepancy.evidence.sensors import only_noise
from hovercontrol.discrepancy.laws.grammar import law_names
from hovercontrol.discrepancy.laws.screen import LikelyLaw, screened
from hovercontrol.discrepancy.search.candidates import catalogue
from hovercontrol.discrepancy.search.challenge import surely
from hovercontrol.discrepancy.search.confirm import Rival, Selection
from hovercontrol.discrepancy.search.fit import TRIALS, Search, try_effect
from hovercontrol.discrepancy.search.hold_out import HeldOut, held_out
from hovercontrol.discrepancy.search.leads import Lead
from hovercontrol.discrepancy.search.searched import shown
from hovercontrol.discrepancy.search.select import select
from hovercontrol.discrepancy.search.trace import Decision
from hovercontrol.effects.law import is_law
from hovercontrol.estimation.data import Data
from hovercontrol.estimation.subject import Subject


def with_laws(
    found: HeldOut,
    model: Subject,
    data: Data | None,
    *,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
) -> HeldOut:
    """Return a search that went on with laws; the given one if no law is named.

    Parameters
    ----------
    found : HeldOut
        What the search of the catalogue found.
    model : Model or BlockModel
        The given model.
    data : Data, optional
        The held-out logs; None if there are none.
    max_effects, criteria, report, trace
        As for :func:`.select`.
    """
    selection, base = found.selection, found.selection.base
    if only_noise(selection.final, criteria):
        return found
    names = law_names(base.problem.model)
    report(f"screening {len(names)} laws")
    screening = screened(base, names, criteria, model)
    few = screening.laws
    rows = [] if trace is None else trace
    rule, least = "gain of the law on left-out blocks, at least", criteria.least
    rows.extend(Decision("score", s.name, rule, s.gain, least, s.gain >= least) for s in few)
    taken = base.cost - selection.final.cost
    if not few or few[0].gain < TRIALS.half * taken:
        return found
    known = [cls.name for cls in catalogue(base.problem.model) if cls.name not in selection.effects]
    asked = [*known, *(s.name for s in few)]
    strict = _among(criteria, len(asked), len(known) + screening.tests)
    more = select(
        base, model, names=asked, max_effects=max_effects, criteria=strict, report=report, trace=trace
    )
    if not any(is_law(n) for n in more.effects) or not _replaces(selection, more, criteria, rows):
        return found
    report("predicting the held-out logs with the laws")
    search = Search(model, None, strict, report, rows)
    again = held_out(_with_same(search, more, few), data, strict, trace)
    named = [n for n in again.selection.effects if is_law(n)]
    if only_noise(again.selection.final, criteria):
        return again if named else found
    share = {r.equation: r.share_explained for r in remainders(base, again.selection.final)}
    half = {n: share.get(f"{again.selection.final.model.effect(n).equation}'", 0.0) for n in named}
    doubtful = [n for n in named if half[n] < criteria.most or not shown(again.evidence[n], criteria)]
    if named and not doubtful:
        return again
    leads = tuple(_unshown(again.evidence[n], n) for n in doubtful)
    return replace(found, selection=replace(selection, leads=(*leads, *selection.leads)))


def _unshown(own: Evidence, name: str) -> Lead:
    """Return a law that the held-out logs do not show by themselves, as one that is not named."""
    gain = own.gained.gain if own.gained else 0.0
    reason = (
        f"more is missing than this law, and held-out logs do not show it by themselves (gain {gain:.3g})"
    )
    return Lead(name, own.gain, own.blocks.t, reason, own.blocks.n)


def _replaces(named: Selection, more: Selection, criteria: Criteria, rows: list[Decision]) -> bool:
    """Return whether laws are surely likelier than what the catalogue named; as in a challenge."""
    if not named.effects:
        return True
    gained = criteria.penalised(named.final) - criteria.penalised(more.final)
    passed = gained > criteria.apart and surely(named.final, more.final) > criteria.apart_t
    rule = f"gain in place of {', '.join(named.effects)}, over"
    rows += [Decision("challenge", n, rule, gained, criteria.apart, passed) for n in more.effects]
    return passed


def _among(criteria: Criteria, asked: int, tests: float) -> Criteria:
    """Return criteria whose levels are shared among all that was screened, not only what is asked for."""
    part = min(asked / tests, 1.0)
    return replace(criteria, level=criteria.level * part, other_sign=criteria.other_sign * part)


def _with_same(search: Search, selection: Selection, few: list[LikelyLaw]) -> Selection:
    """Return a selection whose laws have as rivals those that the logs do not tell from them.

    One that breaks more symmetries of the model is told and no more. Any other is fitted in the law's place,
    and makes the verdict ambiguous unless it is clearly less likely.
    """
    criteria = search.criteria
    by_name = {s.name: s for s in few}
    have = {(r.name, r.instead_of) for r in selection.rivals}
    more: list[Rival] = []
    for n in (n for n in selection.effects if n in by_name):
        mine, less = selection.final, selection.without[n]
        for other, breaks_more in by_name[n].same.items():
            if (other, n) in have:
                continue
            if breaks_more:
                more.append(Rival(other, n, 0.0, 0.0, mine, same=True))
                continue
            t = try_effect(search, less, search.model.effect_class(other).small())
            if t is None:
                continue
            behind, score = criteria.penalised(t.fit) - criteria.penalised(mine), surely(t.fit, mine)
            if behind < criteria.apart or score < criteria.apart_t:
                more.append(Rival(other, n, behind, score, t.fit))
    return replace(selection, rivals=(*selection.rivals, *more))
