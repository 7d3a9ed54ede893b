"""Names that may stand for an effect of no catalogue: another law of drag, a mass that grows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hovercontrol.discrepancy.search.candidates import beyond, candidates
from hovercontrol.discrepancy.search.score import Scores
from hovercontrol.discrepancy.search.trial import Search, Tried, try_effect
from hovercontrol.estimation.fit import Fit


@dataclass(frozen=True, eq=False)
class Mistaken:
    """Names that may stand for an effect of no catalogue.

    Attributes
    ----------
    names : tuple of str
        The first is the one that it was tried in place of.
    other : str
    fit : Fit
        With it, without them.
    gained : float
        How much likelier it is, in twice the log likelihood, numbers penalised alike.
    t : float
        The same in standard errors over blocks.
    """

    names: tuple[str, ...]
    other: str
    fit: Fit
    gained: float
    t: float


def all_mistaken(search: Search, own: Mapping[str, Tried], without: Mapping[str, Fit]) -> list[Mistaken]:
    """Return the effects of no catalogue that are likelier in place of names, the likeliest first.

    Parameters
    ----------
    search : Search
    own : mapping of str to Tried
        The names, each beside the others.
    without : mapping of str to Fit
        The model less each of them.
    """
    found = []
    penalised = search.criteria.penalised
    for name, mine in own.items():
        for other in beyond(mine.fit.model, search.names):
            taken = search.model.effect_class(other).mistaken_for
            if name not in taken:
                continue
            less, final = without[name], mine.fit
            best = Scores(less, candidates(less, [other])).best()[0]
            search.report(f"trying {other} in place of {name}")
            t = try_effect(search, less, best.effect, best)
            if t is None:
                continue
            names, fit = [name], t.fit
            for also in (n for n in own if n in taken and n != name):  # two may stand for one
                fewer = search.fit(fit, fit.model.without_effects(also))
                if penalised(fewer) < penalised(fit):
                    names, fit = [*names, also], fewer
            gained = penalised(final) - penalised(fit)
            if gained > 0.0:
                found.append(Mistaken(tuple(names), other, fit, gained, surely(final, fit)))
    likeliest = {m.other: m for m in sorted(found, key=lambda m: m.gained)}
    return sorted(likeliest.values(), key=lambda m: -m.gained)


def surely(one: Fit, other: Fit) -> float:
    """Return how much less likely one fit is than another, in standard errors over blocks [Vuong 1989]."""
    d = one.block_costs - other.block_costs
    return float(d.sum() / max(np.sqrt(d.size) * d.std(ddof=1), 1e-300)) if d.size > 1 else 0.0
