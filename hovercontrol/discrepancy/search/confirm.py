"""Joint check of effects added one by one: which are needed, which are better, which are rivals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from hovercontrol.discrepancy.evidence.blocks import Blocks
from hovercontrol.discrepancy.search.candidates import beyond, candidates, catalogue
from hovercontrol.discrepancy.search.leads import ASKED_FOR, Lead
from hovercontrol.discrepancy.search.mistaken import all_mistaken, surely
from hovercontrol.discrepancy.search.score import Scores
from hovercontrol.discrepancy.search.trace import Decision
from hovercontrol.discrepancy.search.trial import (
    TRIALS,
    Search,
    Tried,
    beside,
    brings_nothing,
    explained,
    falls_short,
    noted,
    try_effect,
    why_not,
    with_times,
)
from hovercontrol.estimation.fit import Fit
from hovercontrol.io.short_repr import short_repr

#: Maximum number of times that a better effect replaces a named one; a better one after that is a rival.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that the logs do not distinguish from a named one.

    Attributes
    ----------
    name, instead_of : str
    behind : float
        By how much its penalised cost (twice the negative log likelihood) exceeds that of the named effect.
    t : float
        Difference in cost over its standard error over blocks.
    fit : Fit
        Fit with this effect in place of the other.
    same : bool
        Whether the two are equivalent in every log (a delay of commands, a clock that is late).
    """

    name: str
    instead_of: str
    behind: float
    t: float
    fit: Fit
    same: bool = False


@dataclass(frozen=True, eq=False)
class Selection:
    """The effects that a search selected, with their evidence.

    Attributes
    ----------
    base, final : Fit
        Fits of the given and of the amended model, by the same method.
    effects : tuple of str
        Effects added, in order.
    gains : dict of str to float
        Reduction of twice the negative log likelihood by each effect, with the others in the model.
    blocks : dict of str to Blocks
    rivals : tuple of Rival
    leads : tuple of Lead
    steps : tuple of (str, float)
        Effects in the order in which they were added, with the gain of each fit.
    candidates : int
        Number of effects considered.
    without : dict of str to Fit
        Fits of the amended model without each effect.
    dropped : tuple of Lead
        Effects added and dropped again: not needed with the others in the model, or blocks do not agree.
    alternatives : tuple of (str, Tried)
        A named effect and another that passes all tests in its place.
    """

    base: Fit
    final: Fit
    effects: tuple[str, ...] = ()
    gains: dict[str, float] = field(default_factory=dict)
    blocks: dict[str, Blocks] = field(default_factory=dict)
    rivals: tuple[Rival, ...] = ()
    leads: tuple[Lead, ...] = ()
    steps: tuple[tuple[str, float], ...] = ()
    candidates: int = 0
    without: dict[str, Fit] = field(default_factory=dict)
    dropped: tuple[Lead, ...] = ()
    alternatives: tuple[tuple[str, Tried], ...] = ()

    __repr__ = short_repr


def confirmed(
    search: Search, selection: Selection, first: Sequence[Tried], safe: Selection | None = None
) -> Selection:
    """Return the selection without effects that are not needed, with better ones in place, and with rivals.

    Parameters
    ----------
    search : Search
    selection : Selection
        Effects as they were added one by one.
    first : sequence of Tried
        Effects already fitted to the given model, which need no second fit.
    safe : Selection, optional
        A selection confirmed before; it is returned if no effects beyond its own are left.
    """
    criteria, base = search.criteria, selection.base
    penalised = criteria.penalised
    effects, final = list(selection.effects), selection.final
    dropped: list[Lead] = []
    among = dict.fromkeys(effects, selection.candidates)
    swaps = 0
    while True:
        without = {
            n: base if len(effects) == 1 else search.fit(final, final.model.without_effects(n))
            for n in effects
        }
        own = {n: beside(final, without[n], n) for n in effects}
        unneeded = [n for n in effects if not noted(search, own[n], among[n])]
        if unneeded:
            least = min(unneeded, key=lambda n: own[n].gain)
            reason = why_not(own[least], among[least], criteria)
            dropped.append(Lead(least, own[least].gain, own[least].blocks.t, reason, own[least].blocks.n))
            effects.remove(least)
            final = without[least]
            continue
        asked_for = [n for n in effects if n in beyond(base.model, search.names)]
        if asked_for:  # the others were judged with it in the model
            dropped[:0] = [Lead(n, own[n].gain, own[n].blocks.t, ASKED_FOR) for n in asked_for]
            effects = [n for n in effects if n not in asked_for]
            final = search.fit(final, final.model.without_effects(asked_for)) if effects else base
            continue
        if safe is not None and set(effects) <= set(safe.effects):
            return replace(safe, dropped=(*safe.dropped, *dropped))
        rivals, others = _rivals(search, selection, own, without, {t.name: t for t in first})
        better = [(n, t) for n, t in others if penalised(t.fit) < penalised(own[n].fit)]
        if better and swaps < ROUNDS:
            name, t = better[0]
            effects[effects.index(name)] = t.name
            among[t.name] = _looked_at(search, selection, t, own[name])
            final, swaps = t.fit, swaps + 1
            continue
        mistaken = all_mistaken(search, own, without)
        for m in mistaken:
            for n in m.names:
                rule = f"gain of {m.other} in its place, at most"
                passed = m.gained <= criteria.apart or m.t <= criteria.apart_t
                search.trace.append(Decision("challenge", n, rule, m.gained, criteria.apart, passed))
        sure = next((m for m in mistaken if m.gained > criteria.apart and m.t > criteria.apart_t), None)
        if sure is None:
            break
        reason = f"{sure.other} in its place gains {sure.gained:.3g} more in twice the log likelihood"
        dropped += [Lead(n, own[n].gain, own[n].blocks.t, reason, own[n].blocks.n) for n in sure.names]
        among[sure.other] = among[sure.names[0]]
        effects = [sure.other, *(n for n in effects if n not in sure.names)]
        final = sure.fit
    return replace(
        selection,
        final=final,
        effects=tuple(effects),
        rivals=(*rivals, *(Rival(m.other, n, -m.gained, m.t, m.fit) for m in mistaken for n in m.names)),
        gains={n: own[n].gain for n in effects},
        blocks={n: own[n].blocks for n in effects},
        without=without,
        dropped=tuple(dropped),
        alternatives=tuple(others),
    )


def _rivals(
    search: Search,
    selection: Selection,
    own: Mapping[str, Tried],
    without: Mapping[str, Fit],
    first: Mapping[str, Tried],
) -> tuple[list[Rival], list[tuple[str, Tried]]]:
    """Return the rivals of each named effect, and all effects that pass the tests in its place."""
    criteria = search.criteria
    rivals: list[Rival] = []
    alternatives: list[tuple[str, Tried]] = []
    for name, mine in own.items():
        less, final = without[name], mine.fit
        scored = Scores(less, candidates(less, search.names)).best()
        others = [s for s in scored if s.candidate.name != name and s.allowed]
        best, tries = max((s.gain for s in others), default=0.0), 0
        for k, s in enumerate(others):
            if mine.effect.twin(s.candidate.trial):
                rivals.append(Rival(s.candidate.name, name, 0.0, 0.0, final, True))
                continue
            drags = s.candidate.trial.kin(mine.effect)
            share = criteria.share if drags or not explained(mine) else criteria.alike
            known = first.get(s.candidate.name) if len(own) == 1 else None
            worthy = s.gain > max(share * max(best, 0.0), criteria.least) and tries < criteria.tries
            if not worthy and not (known and drags):  # scores underrate drags near standstill
                continue
            tries += worthy
            if known is None:
                search.report(f"trying {s.candidate.name} in place of {name}")
            t = known or try_effect(search, less, s.effect, s)
            if worthy and (t is None or falls_short(t, s)) and s.gain == best:
                # compare with the next best score instead
                best = max((o.gain for o in others[k + 1 :]), default=0.0)
                tries -= 1
            if t is None or not noted(search, t, _looked_at(search, selection, t, mine)):
                continue
            t = _alike(search, t, mine)
            behind = criteria.penalised(t.fit) - criteria.penalised(final)
            if _only_imitates(t, mine, criteria.chance) or brings_nothing(t, mine, criteria):
                continue
            score = surely(t.fit, final)
            alternatives.append((name, t))
            rule = f"behind {name} in its place, less than"
            near = behind < criteria.apart or score < criteria.apart_t
            search.trace.append(Decision("challenge", t.name, rule, behind, criteria.apart, near))
            if behind < criteria.apart or score < criteria.apart_t:
                rivals.append(Rival(t.name, name, behind, score, t.fit))
    return rivals, alternatives


def _looked_at(search: Search, selection: Selection, t: Tried, named: Tried) -> int:
    """Return the number of candidates among which an effect in place of another is chosen.

    Once a drag along an axis is named, something is known to be missing there. Another drag along that axis
    is then chosen among these few, any other effect among all candidates.
    """
    if not t.effect.kin(named.effect):
        return selection.candidates
    return sum(cls.axis == t.effect.axis for cls in catalogue(search.model, search.names))


def _alike(search: Search, t: Tried, other: Tried) -> Tried:
    """Return a fit whose noise is as well fitted as the other's, so that the noise does not decide.

    The other's correlation times are tried. If the costs are then near, the fit gets its own likeliest times.
    """
    if not np.array_equal(t.fit.noise.seconds, other.fit.noise.seconds):
        again = search.fit(replace(t.fit, noise=other.fit.noise), t.fit.model)
        if again.cost < t.fit.cost:
            t = replace(t, fit=again, gain=t.gain + t.fit.cost - again.cost)
    penalised = search.criteria.penalised
    if penalised(t.fit) < penalised(other.fit) + TRIALS.near:
        t = with_times(search, t)
    return t


def _only_imitates(t: Tried, simpler: Tried, chance: float) -> bool:
    """Return whether an effect contains a simpler one and its extra parameters are not significant.

    With k extra parameters the reduction of the cost is compared with the upper `chance` quantile of
    chi-squared with k degrees of freedom. Stribeck friction with a Stribeck speed above all observed speeds
    is Coulomb friction, so it always fits as well.
    """
    more = len(t.fit.p) - len(simpler.fit.p)
    within = more > 0 and simpler.fit.cost - t.fit.cost < chi2.isf(chance, more)
    return t.effect.becomes(simpler.effect) and bool(within)
