"""What was added one by one, checked together: what is needed, what does as well, what is level."""

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
from hovercontrol.discrepancy.search.trial import (
    TRIALS,
    Search,
    Tried,
    beside,
    bristles_bring_nothing,
    explained,
    falls_short,
    passes,
    same_axis_drag,
    try_effect,
    twins,
    why_not,
    with_times,
)
from hovercontrol.estimation.fit import Fit
from hovercontrol.io.short_repr import short_repr

#: Times at most that a better effect takes the place of a named one; one that is better still is a rival.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that the logs do not distinguish from a named one.

    Attributes
    ----------
    name, instead_of : str
    behind : float
        How much less likely it is, in twice the log likelihood, numbers penalised alike.
    t : float
        That over its standard error over blocks.
    fit : Fit
        With this effect in the other's place.
    same : bool
        Whether every log must show both alike (a delay of commands, a clock that is late).
    """

    name: str
    instead_of: str
    behind: float
    t: float
    fit: Fit
    same: bool = False


@dataclass(frozen=True, eq=False)
class Selection:
    """What a search found.

    Attributes
    ----------
    base, final : Fit
        The given model and the amended one, fitted alike.
    effects : tuple of str
        What was added, in order.
    gains : dict of str to float
        Fall of twice the negative log likelihood that each brings beside the others.
    blocks : dict of str to Blocks
    rivals : tuple of Rival
    leads : tuple of Lead
    steps : tuple of (str, float)
        What was added in which order, with its score.
    candidates : int
        How many effects were looked at.
    without : dict of str to Fit
        The amended model less each effect, fitted.
    dropped : tuple of Lead
        What was added and is not needed beside the others, or not agreed on.
    alternatives : tuple of (str, Tried)
        In place of which effect another might be named as well, were it likelier.
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
    """Drop what is not needed, put better effects in, and say what is level with each.

    Parameters
    ----------
    search : Search
    selection : Selection
        As effects were added one by one.
    first : sequence of Tried
        Fitted beside the model as given: they need not be again.
    safe : Selection, optional
        Confirmed before; returned where no more than its effects are left.
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
        unneeded = [n for n in effects if not passes(own[n], among[n], criteria)]
        if unneeded:
            least = min(unneeded, key=lambda n: own[n].gain)
            reason = why_not(own[least], among[least], criteria)
            dropped.append(Lead(least, own[least].gain, own[least].blocks.t, reason, own[least].blocks.n))
            effects.remove(least)
            final = without[least]
            continue
        asked_for = [n for n in effects if n in beyond(base.model, search.names)]
        if asked_for:  # the others were judged beside it
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
    """Return what is level with each named effect, and all that might be named in its place."""
    criteria = search.criteria
    rivals: list[Rival] = []
    alternatives: list[tuple[str, Tried]] = []
    for name, mine in own.items():
        less, final = without[name], mine.fit
        scored = Scores(less, candidates(less, search.names)).best()
        others = [s for s in scored if s.candidate.name != name and s.allowed]
        best, tries = max((s.gain for s in others), default=0.0), 0
        for k, s in enumerate(others):
            if twins(final.problem.model.effect(name), s.candidate.trial):
                rivals.append(Rival(s.candidate.name, name, 0.0, 0.0, final, True))
                continue
            drags = same_axis_drag(s.candidate.trial, final.problem.model.effect(name))
            share = criteria.share if drags or not explained(mine) else criteria.alike
            known = first.get(s.candidate.name) if len(own) == 1 else None
            worthy = s.gain > max(share * max(best, 0.0), criteria.least) and tries < criteria.tries
            if not worthy and not (known and drags):  # a score does not do justice to drags near standstill
                continue
            tries += worthy
            if known is None:
                search.report(f"trying {s.candidate.name} in place of {name}")
            t = known or try_effect(search, less, s.effect, s)
            if worthy and (t is None or falls_short(t, s)) and s.gain == best:
                # the next best one is the measure
                best = max((o.gain for o in others[k + 1 :]), default=0.0)
                tries -= 1
            if t is None or not passes(t, _looked_at(search, selection, t, mine), criteria):
                continue
            t = _alike(search, t, mine)
            behind = criteria.penalised(t.fit) - criteria.penalised(final)
            if _only_imitates(t, mine, criteria.chance) or bristles_bring_nothing(t, mine, criteria):
                continue
            score = surely(t.fit, final)
            alternatives.append((name, t))
            if behind < criteria.apart or score < criteria.apart_t:
                rivals.append(Rival(t.name, name, behind, score, t.fit))
    return rivals, alternatives


def _looked_at(search: Search, selection: Selection, t: Tried, named: Tried) -> int:
    """Return among how many candidates an effect is that might be named in another's place.

    That something is missing along an axis is known once one of its drags is named: which, among these few.
    """
    own, other = (o.fit.problem.model.effect(o.name) for o in (t, named))
    if not same_axis_drag(own, other):
        return selection.candidates
    return sum(cls.axis == own.axis for cls in catalogue(search.model, search.names))


def _alike(search: Search, t: Tried, other: Tried) -> Tried:
    """Return a fit under noise as good as the other's, if it is near: else the noise would decide."""
    if not np.array_equal(t.fit.noise.seconds, other.fit.noise.seconds):
        again = search.fit(replace(t.fit, noise=other.fit.noise), t.fit.model)
        if again.cost < t.fit.cost:
            t = replace(t, fit=again, gain=t.gain + t.fit.cost - again.cost)
    penalised = search.criteria.penalised
    if penalised(t.fit) < penalised(other.fit) + TRIALS.near:
        t = with_times(search, t)
    return t


def _only_imitates(t: Tried, simpler: Tried, chance: float) -> bool:
    """Return whether an effect is the simpler one with more numbers, which gain no more than by chance.

    Stribeck friction whose speed lies beyond all that were seen is Coulomb friction: it is always level.
    """
    rich, simple = (type(o.fit.problem.model.effect(o.name)) for o in (t, simpler))
    more = len(t.fit.p) - len(simpler.fit.p)
    within = more > 0 and simpler.fit.cost - t.fit.cost < chi2.isf(chance, more)
    return rich.axis == simple.axis and issubclass(simple, rich.contains) and bool(within)
