"""Effects outside the catalogue that named ones may stand for: another law of drag, a mass that grows."""

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
    """Named effects that may stand for one outside the catalogue.

    Attributes
    ----------
    names : tuple of str
        The named effects; the first is the one that `other` was tried in place of.
    other : str
    fit : Fit
        Fit with `other` and without `names`.
    gained : float
        Reduction of the penalised cost (twice the negative log likelihood) by the replacement.
    t : float
        Reduction of the cost over its standard error over blocks.
    """

    names: tuple[str, ...]
    other: str
    fit: Fit
    gained: float
    t: float


def all_mistaken(search: Search, own: Mapping[str, Tried], without: Mapping[str, Fit]) -> list[Mistaken]:
    """Return effects outside the catalogue that are likelier than named ones, the likeliest first.

    Parameters
    ----------
    search : Search
    own : mapping of str to Tried
        The named effects, each compared with the others in the model.
    without : mapping of str to Fit
        Fits of the model without each of them.
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
            for also in (n for n in own if n in taken and n != name):  # two named effects may stand for one
                fewer = search.fit(fit, fit.model.without_effects(also))
                if penalised(fewer) < penalised(fit):
                    names, fit = [*names, also], fewer
            gained = penalised(final) - penalised(fit)
            if gained > 0.0:
                found.append(Mistaken(tuple(names), other, fit, gained, surely(final, fit)))
    likeliest = {m.other: m for m in sorted(found, key=lambda m: m.gained)}
    return sorted(likeliest.values(), key=lambda m: -m.gained)


def surely(one: Fit, other: Fit) -> float:
    """Return the excess cost of one fit over another, in standard errors over blocks.

    The test is that of Vuong, Econometrica 57 (1989): with d_w the difference in cost of block w of W,
    ``t = sum d_w / (W^(1/2) std(d_w))``.
    """
    d = one.block_costs - other.block_costs
    return float(d.sum() / max(np.sqrt(d.size) * d.std(ddof=1), 1e-300)) if d.size > 1 else 0.0
