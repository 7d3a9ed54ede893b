"""The search for laws that are in no catalogue, where the catalogue leaves something.

The catalogue is searched first. Where something remains, all forms of the grammar are screened on one table
(:mod:`.screen`), and the few best are searched beside the catalogue by the same steps: fit, confirm,
challenge, hold out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hovercontrol.discrepancy.criteria import CRITERIA, Criteria
from hovercontrol.discrepancy.evidence.sensors import only_noise
from hovercontrol.discrepancy.laws.grammar import law_names
from hovercontrol.discrepancy.laws.screen import LikelyLaw, screened
from hovercontrol.discrepancy.search.candidates import catalogue
from hovercontrol.discrepancy.search.confirm import Rival, Selection
from hovercontrol.discrepancy.search.hold_out import HeldOut, held_out
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
    selection = found.selection
    if only_noise(selection.final, criteria) or len(selection.effects) >= max_effects:
        return found
    names = law_names(selection.final.problem.model)
    report(f"screening {len(names)} laws")
    screening = screened(selection.final, names, criteria)
    few = screening.laws
    rows = trace if trace is not None else []
    rule, least = "gain of the law on left-out blocks, at least", criteria.least
    rows.extend(Decision("score", s.name, rule, s.gain, least, s.gain >= least) for s in few)
    if not few:
        return found
    known = [cls.name for cls in catalogue(selection.final.problem.model)]
    asked = [*known, *(s.name for s in few)]
    strict = _among(criteria, len(asked), len(known) + screening.tests)
    more = select(
        selection.base,
        model,
        names=[*selection.effects, *asked],
        max_effects=max_effects,
        criteria=strict,
        report=report,
        trace=trace,
        begun=selection,
    )
    if not any(is_law(n) for n in more.effects):
        return found
    report("predicting the held-out logs with the laws")
    again = held_out(_with_same(more, few), data, strict, trace)
    return again if any(is_law(n) for n in again.selection.effects) else found


def _among(criteria: Criteria, asked: int, tests: float) -> Criteria:
    """Return criteria whose levels are shared among all that was screened, not only what is asked for."""
    part = min(asked / tests, 1.0)
    return replace(criteria, level=criteria.level * part, other_sign=criteria.other_sign * part)


def _with_same(selection: Selection, few: list[LikelyLaw]) -> Selection:
    """Return a selection whose laws have as rivals those that the logs do not tell from them.

    One that breaks more symmetries of the model is told and no more; any other makes the verdict ambiguous.
    """
    by_name = {s.name: s for s in few}
    more = [
        Rival(other, n, 0.0, 0.0, selection.final, same=breaks_more)
        for n in selection.effects
        if n in by_name
        for other, breaks_more in by_name[n].same.items()
    ]
    return replace(selection, rivals=(*selection.rivals, *more))
