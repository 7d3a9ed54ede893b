"""A search judged by held-out logs; with too few blocks to agree, the held-out logs decide alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.search.candidates import catalogue
from hovercontrol.identification.diagnose.search.fit import Made
from hovercontrol.identification.diagnose.search.hold_out import HeldOut, held_out
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.select import select
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject


def searched(
    base: Fit,
    model: Subject,
    data: Data | None,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
    made: Made | None = None,
) -> HeldOut:
    """Return the effects that a fitted model lacks, as judged by the held-out logs.

    If the held-out logs take a part of a set, the search goes on from what stays.

    The blocks of the training logs must agree on an effect. Logs with few events have few informative
    blocks, and fewer than `criteria.blocks` cannot decide: 5 of 5 may agree at t = 4 and still miss the level
    required among sixty candidates. If no effect passes, and too few blocks inform on one that gains enough,
    the search is repeated by likelihood alone. Each effect must then be shown by the held-out logs, on which
    the choice did not depend (:func:`shown`).

    Parameters
    ----------
    base : Fit
        Fit of the given model.
    model : Model or BlockModel
        The given model.
    data : Data, optional
        The held-out logs; None if there are none.
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
    criteria : Criteria, optional
    report : callable, optional
        Called with a message on each step.
    trace : list of Decision, optional
        Gets a row for each decision.
    made : list, optional
        Gets the fits with one effect more than `base`.
    """
    known = [cls.name for cls in catalogue(base.problem.model, names)]
    vetoed: dict[str, Lead] = {}
    found: HeldOut | None = None
    while True:
        selection = select(
            base, model, names=[n for n in known if n not in vetoed] if vetoed else names,
            max_effects=max_effects, criteria=criteria, report=report, trace=trace, made=made,
            begin=found.selection if found else None,
        )  # fmt: skip
        report("predicting the held-out logs")
        found = held_out(selection, data, criteria, trace)
        stays = found.selection.effects
        vetoed |= {lead.name: lead for lead in found.selection.leads if lead.name in selection.effects}
        if not stays or len(stays) == len(selection.effects):
            break
    leads = (*vetoed.values(), *(lead for lead in found.selection.leads if lead.name not in vetoed))
    found = replace(found, selection=replace(found.selection, leads=leads))
    if data is None or found.selection.effects or only_noise(base, criteria):
        return found
    if not any(n.gain > criteria.least and 0 < n.blocks_n < criteria.blocks for n in found.selection.leads):
        return found
    alone = replace(criteria, level=math.inf)
    report("few events: searching by likelihood, for the held-out logs to judge")
    weaker = select(
        base, model, names=names, max_effects=max_effects, criteria=alone, report=report, trace=trace
    )
    if not weaker.effects:
        return found
    again = held_out(weaker, data, alone, trace, found)
    named = again.selection.effects
    return again if named and all(shown(again.evidence[n], criteria) for n in named) else found


def shown(own: Evidence, criteria: Criteria) -> bool:
    """Whether the held-out logs alone show an effect.

    Twice their log likelihood must rise by `criteria.least`. In addition, t over their blocks must exceed
    `criteria.confirmed`, or a fraction above `criteria.most` of the squared error at one horizon must vanish.
    """
    if own.gained is None or own.gained.gain < criteria.least:
        return False
    return own.gained.t > criteria.confirmed or max(own.holdout.taken, default=0.0) > criteria.most
