"""Selection of the effects that a model lacks: by scores, fits and agreement of blocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from hovercontrol.discrepancy.criteria import CRITERIA, Criteria
from hovercontrol.discrepancy.evidence.sensors import only_noise
from hovercontrol.discrepancy.search.candidates import beyond, candidates
from hovercontrol.discrepancy.search.confirm import Selection, confirmed
from hovercontrol.discrepancy.search.leads import ASKED_FOR, leads
from hovercontrol.discrepancy.search.score import Scored, Scores, at_its_time
from hovercontrol.discrepancy.search.trace import Decision
from hovercontrol.discrepancy.search.trial import (
    TRIALS,
    Search,
    Tried,
    at_likeliest_time,
    begun_again,
    brings_nothing,
    explained,
    falls_short,
    noted,
    sized,
    try_effect,
    with_times,
    without_it,
)
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.subject import Subject

#: Maximum number of low-scoring candidates fitted because blocks agree on them.
UNDERRATED = 2


def select(
    base: Fit,
    model: Subject,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
) -> Selection:
    """Return which effects a fitted model lacks.

    Parameters
    ----------
    base : Fit
        Fit of the given model.
    model : Model or BlockModel
        The given model; the prior is centred on its coefficients.
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
    criteria : Criteria, optional
    report : callable, optional
        Called with a message on each trial.
    trace : list of Decision, optional
        Gets a row for each decision.
    """
    search = Search(model, names, criteria, report, [] if trace is None else trace)
    current = base
    first: list[Tried] = []
    effects: list[str] = []
    steps: list[tuple[str, float]] = []
    tried: dict[str, Tried] = {}
    seen: list[Scored] = []
    safe: Selection | None = None

    def so_far() -> Selection:
        looked_at = len(seen) + len(effects)
        found = Selection(base, current, tuple(effects), steps=tuple(steps), candidates=looked_at)
        return confirmed(search, found, first, safe) if effects else found

    while True:
        report("scoring the catalogue")
        seen = Scores(current, candidates(current, names)).best()
        search.trace.extend(_score_rows(seen, criteria))
        if len(effects) >= max_effects:
            break
        found = _add(search, current, seen)
        good = [t for t in found if noted(search, t, len(seen))]
        hidden = [] if good else _underrated(search, current, seen, {t.name for t in found})
        good = good or [t for t in hidden if noted(search, t, len(seen))]
        first = [*found, *hidden] if current is base else first
        tried = {t.name: t for t in (*found, *hidden)}
        if not good and found and safe is None:  # may pass together with another effect though it fails alone
            enough = [t for t in found if t.gain > criteria.least + criteria.each * t.numbers]
            good = [t for t in enough if not t.effect.flexible]
            safe = so_far() if good else None
        if not good:
            break
        best = begun_again(search, current, _likeliest(search, good))
        best = at_likeliest_time(search, current, best)
        better = without_it(search, current, best)
        if better is not None:
            if current is base:
                base, first = better, []
            current, safe = better, None
            continue
        effects.append(best.name)
        steps.append((best.name, best.gain))
        current = best.fit
    selection = so_far()
    if safe is not None and len(selection.effects) < len(safe.effects):
        selection = safe
    if not only_noise(current, criteria):
        others = Scores(current, candidates(current, beyond(current.model, names))).best()
        search.trace.extend(
            Decision("score", s.candidate.name, ASKED_FOR, s.gain, passed=False) for s in others
        )
        seen = sorted([*seen, *others], key=lambda s: -s.gain)
    near = leads(seen, tried, selection.effects, selection.dropped, selection.final, criteria)
    return replace(selection, leads=near)


def _score_rows(seen: Sequence[Scored], criteria: Criteria) -> list[Decision]:
    """Return the decision on each scored candidate: whether it is worth a fit."""
    rows = []
    for s in seen:
        asked = TRIALS.promised * (criteria.least + criteria.each * len(s.parts))
        rule = "gain predicted by the score, at least" if s.allowed else "best size within its bounds"
        good = s.allowed and s.gain > asked
        rows.append(Decision("score", s.candidate.name, rule, float(s.gain), float(asked), good))
    return rows


def _underrated(search: Search, current: Fit, seen: Sequence[Scored], done: set[str]) -> list[Tried]:
    """Return fits with effects whose score underrates them, in equations with process noise left.

    Process noise that absorbed an effect lowers the score of that effect, though blocks agree on it; the best
    of these are fitted. Frictions that fade with speed are fitted too, since they are far from linear near
    standstill. Agreement of blocks is no reason to fit an effect of many numbers, which is not named while a
    remainder is left.
    """
    problem, criteria = current.problem, search.criteria
    axes = {
        problem.block.states[problem.free[i]].name
        for i, there in zip(problem.driven, criteria.left(current), strict=True)
        if there
    }
    if not axes:
        return []
    p = criteria.level / max(len(seen), 1)
    worthy = [s for s in seen if s.allowed and not s.candidate.trial.flexible]
    agreed = [s for s in worthy if s.p_value < p and s.candidate.name not in done][:UNDERRATED]
    found = []
    for s in seen:
        e = s.candidate.trial
        fading = e.fades() and e.axis in axes and e.name not in done
        if fading or s in agreed:
            search.report(f"trying {e.name}")
            t = try_effect(search, current, sized(problem.model, s.effect))
            found += [t] if t else []
    return found


def _likeliest(search: Search, good: Sequence[Tried]) -> Tried:
    """Return the likeliest of the effects that may be named, each fitted with its own correlation times.

    Ties must not depend on rounding: of effects with equal cost, the one with fewer parameters is returned,
    then the first by name.
    """
    penalised = search.criteria.penalised
    good = [t for t in good if not any(brings_nothing(t, o, search.criteria) for o in good)]
    least = min(penalised(t.fit) for t in good)
    for t in good:
        rule, behind = "cost above the likeliest candidate's, less than", penalised(t.fit) - least
        search.trace.append(Decision("fit", t.name, rule, behind, TRIALS.near, behind < TRIALS.near))
    near = [with_times(search, t) for t in good if penalised(t.fit) < least + TRIALS.near]
    least = min(penalised(t.fit) for t in near)
    level = [t for t in near if penalised(t.fit) < least + TRIALS.level]
    return min(level, key=lambda t: (t.numbers, t.name))


def _add(search: Search, current: Fit, seen: Sequence[Scored]) -> list[Tried]:
    """Return fits with the candidates of the highest scores, and with drags along the same axis as the best.

    A score only predicts a gain. A candidate whose fit gains much less does not use up one of the trials.
    """
    criteria, model = search.criteria, current.problem.model
    asked = [TRIALS.promised * (criteria.least + criteria.each * len(s.parts)) for s in seen]
    worthy = [s for s, gain in zip(seen, asked, strict=True) if s.allowed and s.gain > gain]
    if not worthy:
        return []
    found: list[Tried] = []
    best: tuple[Scored, Tried] | None = None  # the best score that a fit confirms
    overrated = 0
    for s in worthy:
        if len(found) >= criteria.tries + overrated or overrated > criteria.tries:
            break
        if best is not None and not _nearly_as_good(s, *best, criteria):
            continue
        s = at_its_time(current, s)
        e = s.effect
        if any(t.effect.twin(e) for t in found):
            continue
        search.report(f"trying {e.name}")
        t = try_effect(search, current, e, s)
        found += [t] if t else []
        if t is None or falls_short(t, s):
            overrated += 1
        else:
            best = best or (s, t)
    top = best[0] if best else worthy[0]
    done = {t.name for t in found}
    for s in seen:
        if s.candidate.trial.kin(top.candidate.trial) and s.candidate.name not in done:
            search.report(f"trying {s.candidate.name}")
            t = try_effect(search, current, sized(model, s.effect), s)
            found += [t] if t else []
    return found


def _nearly_as_good(s: Scored, top: Scored, fitted: Tried, criteria: Criteria) -> bool:
    """Return whether a candidate may fit as well as the best one, judged by its score."""
    if s.candidate.trial.kin(top.candidate.trial):
        return s.gain > criteria.share * top.gain
    return s.gain > (criteria.alike if explained(fitted) else criteria.share) * top.gain
