"""Screening of laws: all forms on one table, and the few that are worth a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.discrepancy.criteria import Criteria
from hovercontrol.discrepancy.laws.symmetry import broken_by, symmetries
from hovercontrol.discrepancy.search.candidates import Candidate
from hovercontrol.discrepancy.search.fit import TRIALS
from hovercontrol.discrepancy.search.score import Scores
from hovercontrol.effects.law import Law
from hovercontrol.estimation.fit import Fit

#: Two columns with a correlation beyond this are the same law in these logs.
SAME = 0.98

#: Laws that are tried alone, and the best partner of so many of them.
ALONE, PARTNERS = 6, 3


@dataclass(frozen=True, eq=False)
class Screened:
    """A law worth a fit.

    Attributes
    ----------
    name : str
    gain : float
        On left-out blocks, alone or with its partner.
    same : tuple of str
        Laws that these logs do not tell from it.
    broken : dict of str to int
        The number of symmetries of the model that it, and each of `same`, breaks.
    """

    name: str
    gain: float
    same: tuple[str, ...]
    broken: dict[str, int]


def law_scores(fit: Fit, names: Sequence[str]) -> Scores:
    """Return the table of products with a column for each law.

    Parameters
    ----------
    fit : Fit
    names : sequence of str
        Of laws.
    """
    model = fit.problem.model
    have = {e.name for e in model.effects}
    trials = [model.effect_class(n)(1.0) for n in names if n not in have]
    return Scores(fit, [Candidate(e.name, e, ("value",)) for e in trials])


def screened(fit: Fit, names: Sequence[str], criteria: Criteria) -> list[Screened]:
    """Return the laws worth a fit: the best alone, and the best partners of these.

    Laws that the logs do not tell apart are one. It goes by the name of the one that breaks fewest symmetries
    of the model, then the simplest.

    Parameters
    ----------
    fit : Fit
    names : sequence of str
        Of laws.
    criteria : Criteria
    """
    scores = law_scores(fit, names)
    signs, alike = symmetries(fit.problem.model), np.abs(scores.correlations()) > SAME
    laws = [type(c.trial) for c in scores.tried]
    broken = {cls.name: broken_by(cls, signs) for cls in laws if issubclass(cls, Law)}
    gains = np.array([scores.left_out_gain(i) for i in range(len(laws))])
    least = TRIALS.promised * criteria.least
    found: dict[str, Screened] = {}

    def add(i: int, gain: float) -> int:
        group = [j for j in range(len(laws)) if alike[i, j] or i == j]
        best = min(group, key=lambda j: (broken[laws[j].name], _complexity(laws[j]), -gains[j]))
        own = [laws[j].name for j in group]
        name = laws[best].name
        found.setdefault(
            name, Screened(name, gain, tuple(n for n in own if n != name), {n: broken[n] for n in own})
        )
        return best

    order = [int(i) for i in np.argsort(-gains, kind="stable")]
    leaders: list[int] = []
    for i in order:
        if len(found) >= ALONE or gains[i] < least:
            break
        leaders.append(add(i, float(gains[i])))
    for i in list(dict.fromkeys(leaders))[:PARTNERS]:
        both = [
            scores.left_out_gain_of((*scores.columns_of(i), *scores.columns_of(j)))
            if not alike[i, j] and i != j
            else 0.0
            for j in order
        ]
        best = int(np.argmax(both))
        if both[best] > gains[i] + least:
            add(order[best], both[best])
    return sorted(found.values(), key=lambda s: -s.gain)


def _complexity(cls: type) -> int:
    return cls.complexity() if issubclass(cls, Law) else 0
