"""Challenge of confirmed effects: each against others in its place, and against what it may be taken for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from hovercontrol.craft.effects import Effect
from hovercontrol.identification.diagnose.evidence.holdout import Blockwise
from hovercontrol.identification.diagnose.search.candidates import candidates, effects_outside_catalogue
from hovercontrol.identification.diagnose.search.confirm import (
    Confirmed,
    Rival,
    Selection,
    confirmed,
    lead_of,
)
from hovercontrol.identification.diagnose.search.fit import (
    TRIALS,
    Search,
    Tried,
    beside,
    try_effect,
    with_times,
)
from hovercontrol.identification.diagnose.search.leads import ASKED_FOR, Lead
from hovercontrol.identification.diagnose.search.rules import candidate_count, is_redundant, passes_all_tests
from hovercontrol.identification.diagnose.search.score import Scored, Scores
from hovercontrol.identification.diagnose.search.sets import singles
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.fit import Fit

#: Maximum number of times that a better effect replaces a named one; a better one after that is a rival.
ROUNDS = 2


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


def challenged(search: Search, selection: Selection) -> Selection:
    """Return a selection that is confirmed, with better effects in place, and with rivals.

    Parameters
    ----------
    search : Search
    selection : Selection
        Effects as they were added.
    """
    criteria, base = search.criteria, selection.base
    effects, final, dropped = list(selection.effects), selection.final, list[Lead]()
    counts = dict(selection.among)
    for swaps in range(2 * ROUNDS + 2):
        now = confirmed(search, base, final, effects, counts)
        effects, final, dropped = list(now.own), now.final, [*dropped, *now.dropped]
        rivals, others = _rivals(search, selection, now)
        cheaper = _cheaper(search, selection, now, others)
        if cheaper and swaps < ROUNDS:
            name, t = cheaper[0]
            effects[effects.index(name)], final = t.name, t.fit
            counts[t.name] = candidate_count(search, t, [now.own[name]], selection.candidates)
            continue
        mistaken = _all_mistaken(search, now)
        sure = next((m for m in mistaken if m.gained > criteria.apart and m.t > criteria.apart_t), None)
        if sure is None:
            break
        reason = f"{sure.other} in its place gains {sure.gained:.3g} more in twice the log likelihood"
        dropped += [lead_of(now.own[n], reason) for n in sure.names]
        effects, final = [sure.other, *(n for n in effects if n not in sure.names)], sure.fit
        counts[sure.other] = selection.candidates
    asked_for = [n for n in effects if n in effects_outside_catalogue(base.model, search.names)]
    if asked_for:  # the others were judged with it in the model
        dropped[:0] = [lead_of(now.own[n], ASKED_FOR) for n in asked_for]
        effects = [n for n in effects if n not in asked_for]
        final = search.fit(final, final.model.without_effects(asked_for)) if effects else base
        now = confirmed(search, base, final, effects, counts)
        dropped += now.dropped
        rivals = [r for r in rivals if r.instead_of in now.own]
        others = [(n, t) for n, t in others if n in now.own]
    return replace(
        selection,
        final=now.final,
        effects=tuple(now.own),
        rivals=(*rivals, *(Rival(m.other, n, -m.gained, m.t, m.fit) for m in mistaken for n in m.names)),
        gains={n: t.gain for n, t in now.own.items()},
        blocks={n: t.blocks for n, t in now.own.items()},
        without=now.without,
        dropped=tuple(dropped),
        alternatives=tuple(others),
    )


def _cheaper(
    search: Search, selection: Selection, now: Confirmed, others: Sequence[tuple[str, Tried]]
) -> list[tuple[str, Tried]]:
    """Return the effects that are likelier than the named one, or that the named one only imitates."""
    chance = _chance(search, selection)
    return [
        (n, t)
        for n, t in others
        if _cost(search, t.fit) < _cost(search, now.own[n].fit) or _only_imitates(now.own[n], t, chance)
    ]


def _cost(search: Search, fit: Fit) -> float:
    return search.criteria.penalised(fit)


def _rivals(
    search: Search, selection: Selection, now: Confirmed
) -> tuple[list[Rival], list[tuple[str, Tried]]]:
    """Return the rivals of each named effect, and all effects that pass the tests in its place."""
    criteria, chance = search.criteria, _chance(search, selection)
    rivals: list[Rival] = []
    alternatives: list[tuple[str, Tried]] = []
    for name, mine in now.own.items():
        less = now.without[name]
        for e, s, level in _contenders(search, less, mine):
            if mine.effect.twin(s.candidate.trial):
                rivals.append(Rival(s.candidate.name, name, 0.0, 0.0, mine.fit, True))
                continue
            t = search.once(less, e, s)
            if t is not None and level:
                t = beside(alike(search, t, mine).fit, less, t.name)
            if t is None or not passes_all_tests(
                search, t, candidate_count(search, t, [mine], selection.candidates)
            ):
                continue
            t = t if level else alike(search, t, mine)
            if _only_imitates(t, mine, chance) or is_redundant(t, mine, criteria):
                continue
            behind, score = _cost(search, t.fit) - _cost(search, mine.fit), surely(t.fit, mine.fit)
            near = behind < criteria.apart or score < criteria.apart_t
            rule = f"behind {name} in its place, less than"
            search.trace.append(Decision("challenge", t.name, rule, behind, criteria.apart, near))
            alternatives.append((name, t))
            if near:
                rivals.append(Rival(t.name, name, behind, score, t.fit))
    return rivals, alternatives


def _contenders(search: Search, less: Fit, named: Tried) -> list[tuple[Effect, Scored, bool]]:
    """Return the effects that may fit as well in place of a named one, each as its fit begins.

    The last of each says whether it was as likely where the named one was added.

    First those that are the same in every log, which need no fit. Then those that were as likely where the
    named one was added: beside what has been dropped since, they may promise little. Then the candidates by
    cross-validated gain.
    """
    criteria = search.criteria
    alone = singles(search.scores(less))
    asked = max(TRIALS.promised * criteria.least, criteria.share * max((s.gain for s in alone), default=0.0))
    others = {one.names[0]: one for one in alone if one.names[0] != named.name}
    same = [s for one in others.values() for s in one.members if named.effect.twin(s.candidate.trial)]
    level = {
        name: (t.fit.model.effect(name), others[name].members[0])
        for before, name, t in search.made
        for where, chosen, first in search.made
        if t and first and where is before and chosen == named.name
        if name in others and others[name].members[0] not in same
        if abs(_cost(search, t.fit) - _cost(search, first.fit)) < criteria.apart
    }
    good = [one.members[0] for name, one in others.items() if one.gain > asked and name not in level]
    good = [s for s in good if s not in same][: criteria.tries]
    return [
        *((s.effect, s, False) for s in same),
        *((*own, True) for own in level.values()),
        *((s.effect, s, False) for s in good),
    ]


def alike(search: Search, t: Tried, other: Tried) -> Tried:
    """Return a fit whose noise is as well fitted as the other's, so that the noise does not decide.

    The other's correlation times are tried. If the costs are then near, the fit gets its own likeliest times.
    """
    if not np.array_equal(t.fit.noise.seconds, other.fit.noise.seconds):
        again = search.fit(replace(t.fit, noise=other.fit.noise), t.fit.model)
        if again.cost < t.fit.cost:
            t = replace(t, fit=again, gain=t.gain + t.fit.cost - again.cost)
    if _cost(search, t.fit) < _cost(search, other.fit) + TRIALS.near:
        t = with_times(search, t)
    return t


def _chance(search: Search, selection: Selection) -> float:
    """Return the level of the test of extra parameters: any of the candidates could be the larger effect."""
    return search.criteria.chance / max(selection.candidates, 1)


def _only_imitates(t: Tried, simpler: Tried, chance: float) -> bool:
    """Return whether an effect contains a simpler one and its extra parameters are not significant.

    With k extra parameters the reduction of the cost is compared with the upper `chance` quantile of
    chi-squared with k degrees of freedom. Stribeck friction with a Stribeck speed above all observed speeds
    is Coulomb friction, so it always fits as well.
    """
    more = len(t.fit.p) - len(simpler.fit.p)
    within = more > 0 and simpler.fit.cost - t.fit.cost < chi2.isf(chance, more)
    return t.effect.becomes(simpler.effect) and bool(within)


def _all_mistaken(search: Search, now: Confirmed) -> list[Mistaken]:
    """Return effects outside the catalogue that are likelier than named ones, the likeliest first.

    Each becomes a row of the trace of every effect that it would replace.
    """
    found = [
        m
        for name in now.own
        for other in effects_outside_catalogue(now.final.model, search.names)
        for m in _mistaken(search, now, name, other)
        if m.gained > 0.0
    ]
    criteria = search.criteria
    for m in found:
        rule, passed = f"gain of {m.other} in its place, at most", m.gained <= criteria.apart
        rows = (Decision("challenge", n, rule, m.gained, criteria.apart, passed) for n in m.names)
        search.trace.extend(rows)
    likeliest = {m.other: m for m in sorted(found, key=lambda m: m.gained)}
    return sorted(likeliest.values(), key=lambda m: -m.gained)


def _mistaken(search: Search, now: Confirmed, name: str, other: str) -> Iterator[Mistaken]:
    """Return the fit with an effect outside the catalogue in place of a named one that may stand for it."""
    taken = search.model.effect_class(other).mistaken_for
    if name not in taken:
        return
    less = now.without[name]
    best = Scores(less, candidates(less, [other])).best()[0]
    search.report(f"trying {other} in place of {name}")
    t = try_effect(search, less, best.effect, best)
    if t is None:
        return
    names, fit = [name], t.fit
    for also in (n for n in now.own if n in taken and n != name):  # two named effects may stand for one
        fewer = search.fit(fit, fit.model.without_effects(also))
        if _cost(search, fewer) < _cost(search, fit):
            names, fit = [*names, also], fewer
    gained = _cost(search, now.own[name].fit) - _cost(search, fit)
    yield Mistaken(tuple(names), other, fit, gained, surely(now.own[name].fit, fit))


def surely(one: Blockwise, other: Blockwise) -> float:
    """Return the excess cost of one fit over another, in standard errors over blocks.

    The test is that of Vuong, Econometrica 57 (1989): with d_w the difference in cost of block w of W,
    ``t = sum d_w / (W^(1/2) std(d_w))``.
    """
    d = one.block_costs - other.block_costs
    return float(d.sum() / max(np.sqrt(d.size) * d.std(ddof=1), 1e-300)) if d.size > 1 else 0.0
