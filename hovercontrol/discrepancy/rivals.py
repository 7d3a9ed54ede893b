"""What is named, once more: not needed, better told by one, or not to be told from another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hovercontrol.discrepancy.candidates import zoom
from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.search import Search
from hovercontrol.discrepancy.selection import Rival
from hovercontrol.discrepancy.weighing import (
    APART,
    DOUBTFUL,
    EACH,
    LEAST,
    are_kin,
    by_chance,
    charged,
    less,
    wald,
)
from hovercontrol.errors import InputError

#: How far a rival's score may lie behind the named effect's to be fitted in short windows, and the misfit it
#: may leave there to be fitted in long ones; in parts of the named effect's.
NEAR, CLOSE = 0.4, 0.05

#: Effects at most that are fitted in the place of a named one.
MOST_RIVALS = 8

#: Effects at most that are fitted to stand for several.
FEW = 3

#: A rival that is ahead by this takes the name.
LEAD = 1.0


def drop(search: Search) -> None:
    """Leave out what is not needed any more, and note what each effect brings."""
    found = search.found
    while found.effects:
        found.gains = {name: wald(found.final, name) for name in found.effects}
        weakest = min(found.gains, key=found.gains.__getitem__)
        if found.gains[weakest] > LEAST:
            return
        without = search.fit(less(found.final.model, weakest), found.final)
        bar = LEAST + EACH * len(found.final.model.effect(weakest).numbers)
        bar += by_chance(found.final, without)
        if not found.final.noise.has_process and without.cost - found.final.cost > bar:
            return  # far from linear: it says more than its standard errors tell
        found.effects.remove(weakest)
        found.final = without


def simplify(search: Search) -> None:
    """Take one effect instead of several if it says nearly as much: two may share what one does alone."""
    found = search.found
    if len(found.effects) < 2:
        return
    search.progress("looking for one effect instead of several")
    final = found.final
    bare = less(final.model, *found.effects)
    try:
        alone = search.fit(bare, final)
    except InputError:  # without them it runs away in such windows: none alone will do
        return
    scores = search.scores(alone)
    for scored in search.worth(scores, 1.0)[:FEW]:
        if scored.gain < 0.5 * (alone.cost - final.cost):
            return
        one = search.fit(bare.with_effects([zoom(alone, scored).effect]), alone)
        if one.cost < final.cost + LEAST + by_chance(final, one):
            found.effects[:], found.final = [scored.candidate.name], one
            drop(search)
            return


def swap(search: Search) -> None:
    """Put other effects in the place of each; take a better one, note those that cannot be told apart."""
    found = search.found
    for name in list(found.effects):
        search.progress(f"looking for rivals of {name}")
        final = found.final
        bare_model = less(final.model, name)
        length = final.windowed.length
        slight = found.gains.get(name, np.inf) < DOUBTFUL  # short windows would not see it
        short = length if slight or final.noise.has_process else search.rungs[0]
        bare = search.fit(bare_model, final, length=short)
        whole = final if short == length else search.fit(final.model, final, length=short)
        scores = search.scores(bare)
        best = scores.best()
        top = next((s for s in best if s.candidate.name == name), None)
        if top is None:
            continue
        taken, left = bare.cost - whole.cost, MOST_RIVALS
        for scored in best:
            other_name = scored.candidate.name
            if other_name == name or other_name in found.effects or not scored.allowed or not left:
                continue
            far = top.gain - scored.gain > max(3 * APART, NEAR * top.gain)
            if far and not are_kin(scored.candidate.trial, top.candidate.trial):
                continue
            left -= 1
            near = search.fit(bare_model.with_effects([zoom(bare, scored).effect]), bare)
            if near.cost - whole.cost > APART + CLOSE * taken:
                continue
            other = near if short == length else search.fit(near.model, near, length=length)
            if abs(other.cost - found.final.cost) < DOUBTFUL:
                other = _as_fine(search, other, found.final)
                found.final = _as_fine(search, found.final, other)
            behind = charged(other) - charged(found.final)
            correlation = scores.correlation(scored.columns, top.columns)
            if behind < -APART:
                found.effects[found.effects.index(name)] = other_name
                found.final, name = other, other_name
                found.rivals = [r for r in found.rivals if r.instead_of in found.effects]
            elif behind < APART:
                found.rivals.append(Rival(other_name, name, float(behind), correlation, other.model))


def _as_fine(search: Search, one: Fit, other: Fit) -> Fit:
    """Return a fit in sub-steps no longer than another's: a coarse step costs likelihood."""
    finer = -(-other.windowed.pieces // one.windowed.pieces)
    return search.fit(one.model, one, finer=finer) if finer > 1 else one


def lead(search: Search, name: str) -> None:
    """Name the likeliest of an effect and its rivals, if the logs tell its size."""
    found = search.found
    first = min((r for r in found.rivals if r.instead_of == name), key=lambda r: r.behind, default=None)
    if first is None or first.behind > -LEAD:
        return
    ahead = search.fit(first.model, found.final)
    gain, won = wald(ahead, first.name), charged(found.final) - charged(ahead)
    if gain < LEAST or won <= 0.0:
        return
    second = Rival(name, first.name, won, first.correlation, found.final.model)
    others = [
        replace(r, instead_of=first.name if r.instead_of == name else r.instead_of, behind=r.behind + won)
        for r in found.rivals
        if r is not first
    ]
    found.rivals[:] = [second, *(r for r in others if r.behind < APART)]
    found.effects[found.effects.index(name)] = first.name
    del found.gains[name]
    found.final, found.gains[first.name] = ahead, gain
