"""Selection of the effects that a model lacks, in five steps: score, fit, confirm, challenge, hold out.

Each round scores all candidates on one table (:mod:`.score`), chooses the few best sets by their gain on
left-out segments (:mod:`.sets`), fits these, and goes on from the likeliest: the table is made again there.
What was added is then confirmed (:mod:`.confirm`) and challenged (:mod:`.challenge`); :mod:`.hold_out`
follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.craft.effects import Effect
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.search.candidates import candidates, effects_outside_catalogue
from hovercontrol.identification.diagnose.search.challenge import challenged
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.search.fit import (
    TRIALS,
    Made,
    Search,
    Tried,
    in_other_noise,
    reduced_fit,
    restarted_fit,
    retimed_fit,
    try_effect,
    with_times,
)
from hovercontrol.identification.diagnose.search.leads import ASKED_FOR, leads
from hovercontrol.identification.diagnose.search.rules import (
    candidate_count,
    is_redundant,
    passes,
    passes_all_tests,
)
from hovercontrol.identification.diagnose.search.score import Scored, Scores, likeliest_onset
from hovercontrol.identification.diagnose.search.sets import best_set, singles
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject


@dataclass(frozen=True, eq=False)
class Added:
    """A set of effects added to a fit, one after the other; the last one with the fit before it."""

    earlier: tuple[Tried, ...]
    before: Fit
    last: Tried
    among: int = 0


def select(
    base: Fit,
    model: Subject,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
    made: Made | None = None,
    begin: Selection | None = None,
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
    made : list, optional
        Fits from `base` that an earlier search made; gets those that this one makes.
    begin : Selection, optional
        Effects from which the search goes on; default: none.
    """
    kept = [] if made is None else made
    search = Search(model, names, criteria, report, [] if trace is None else trace, [*kept])
    first = base
    current, steps = base, list[tuple[str, float]]()
    tried: dict[str, Tried] = {}
    counts: dict[str, int] = {}
    if begin is not None:
        current, steps = begin.final, [(n, begin.gains[n]) for n in begin.effects]
        counts = {n: begin.among.get(n, begin.candidates) for n in begin.effects}
    while True:
        report("scoring the catalogue")
        scores = search.scores(current)
        seen = scores.best()
        if len(steps) >= max_effects:
            break
        search.trace.extend(_forbidden(seen))
        found = _fitted(search, current, scores, max_effects - len(steps))
        tried = {a.last.name: a.last for a in found}
        best = _likeliest(search, found, len(seen))
        if best is None:
            break
        steps += [(t.name, t.gain) for t in best.earlier]
        counts |= {t.name: len(seen) for t in best.earlier} | {best.last.name: best.among}
        t = retimed_fit(search, best.before, restarted_fit(search, best.before, best.last))
        better = reduced_fit(search, best.before, t)
        if better is None:
            steps.append((t.name, t.gain))
        elif best.before is base:
            base = better
        current = t.fit if better is None else better
    looked_at = len(seen) + len(steps)
    selection = Selection(
        base, current, tuple(n for n, _ in steps), steps=tuple(steps), among=counts, candidates=looked_at
    )
    if steps:
        selection = challenged(search, selection)
    if not only_noise(current, criteria):
        others = Scores(current, candidates(current, effects_outside_catalogue(current.model, names))).best()
        rows = (Decision("score", s.candidate.name, ASKED_FOR, s.gain, passed=False) for s in others)
        search.trace.extend(rows)
        seen = sorted([*seen, *others], key=lambda s: -s.gain)
    kept[:] = [one for one in search.made if one[0] is first]
    near = leads(seen, tried, selection.effects, selection.dropped, selection.final, criteria)
    return replace(selection, leads=near, undecided=_undecided(search, selection.final))


def _undecided(search: Search, final: Fit) -> tuple[Tried, ...]:
    """Return fits from the final one with an effect that is not named and not refuted.

    By likelihood it misses what is asked by less than rivals may differ.
    """
    criteria = search.criteria
    made = [t for before, _, t in search.made if before is final and t is not None]
    asked = criteria.least - criteria.apart
    return tuple(t for t in made if t.gain >= asked + criteria.each * t.numbers)


def _forbidden(seen: Sequence[Scored]) -> list[Decision]:
    """Return a row for each candidate that fits best with a sign or size that its bounds forbid."""
    rule = "a size within its bounds"
    return [Decision("score", s.candidate.name, rule, s.gain, passed=False) for s in seen if not s.allowed]


def _fitted(search: Search, current: Fit, scores: Scores, most: int) -> list[Added]:
    """Return the fits with the best effects alone and, if none of them passes, with a set that gains more.

    The cross-validated gain is a linear prediction. An effect is fitted if it promises enough, and not
    much less than the best one whose fit keeps its promise: a wrong scale of a motor's tachometer promised
    415 and kept nothing, where the dead zone that was there promised 17.
    """
    criteria, found = search.criteria, list[Added]()
    least, best, broken = TRIALS.promised * criteria.least, 0.0, 0
    alone = singles(scores)
    for one in alone:
        s, asked = one.members[0], max(least, criteria.share * best)
        rule, worthy = "cross-validated gain, at least", one.gain >= asked
        search.trace.append(Decision("score", one.names[0], rule, one.gain, asked, worthy))
        same = any(a.last.effect.twin(s.candidate.trial) for a in found)
        if not worthy or same or len(found) >= criteria.tries + broken or broken > criteria.tries:
            continue
        added = _added_in_turn(search, current, one.members)
        found += [added] if added else []
        kept = added is not None and added.last.gain >= TRIALS.half * one.gain
        broken += not kept
        best = max(best, one.gain) if kept else best
    looked_at = len(scores.best())
    if not any(passes(a.last, looked_at, criteria) for a in found):
        found += _hidden(search, current, scores, found)
    passed = any(passes(a.last, looked_at, criteria) for a in found)
    several = best_set(scores, alone, criteria, most) if best and not passed else None
    added = _added_in_turn(search, current, several.members) if several else None
    found += [added] if added else []
    if any(passes(a.last, looked_at, criteria) for a in found) or not np.any(criteria.left(current)):
        return found
    return [*found, *_in_own_noise(search, current, [one.members[0] for one in alone])]


def _in_own_noise(search: Search, current: Fit, alone: Sequence[Scored]) -> list[Added]:
    """Return the fits with the best effects alone, each with its own correlation times of the noise.

    Slow process noise may stand for an effect. A bias of a pendulum's angle gained 16 beside the noise that
    had taken its place, and 95 beside white noise, which is what acted.
    """
    tried = (search.once(current, s.effect, s) for s in alone[: search.criteria.tries] if s.gain > 0.0)
    timed = (in_other_noise(search, current, t) for t in tried if t is not None and t.gain > 0.0)
    return [Added((), current, t) for t in timed if t is not None]


def _hidden(search: Search, current: Fit, scores: Scores, found: Sequence[Added]) -> list[Added]:
    """Return fits with drags that the table cannot show: those of the best fit's axis, and those that fade.

    Near standstill a drag is far from linear in its size and speed: dry friction follows the sign of a
    velocity. In logs of K06's reverse trial, dry friction of 0.16 N promised nothing and its fit gained
    most; Stribeck friction in yaw promises nothing where process noise took its place.
    """
    problem, criteria = current.problem, search.criteria
    driven = zip(problem.driven, criteria.left(current), strict=True)
    axes = {problem.block.states[problem.free[i]].name for i, there in driven if there}
    top = max(found, key=lambda a: a.last.gain).last.effect if found else None
    done = {a.last.name for a in found}
    fits: list[Added] = []
    for s in scores.best():
        e = s.candidate.trial
        near_rest = (e.fades() or e.friction_width()) and e.axis in axes
        if e.name in done or not (near_rest or (s.allowed and top is not None and top.kin(e))):
            continue
        t = search.once(current, _sized(current, s.effect))
        fits += [Added((), current, t)] if t else []
    return fits


def _sized(current: Fit, e: Effect) -> Effect:
    """Return a drag of at least half the size of the model's own along its axis, in the same unit.

    Dry friction without one has at least the size of what is missing along its axis. A fit from the table's
    size, near zero for a drag that the table cannot show, ends where it began.
    """
    if "value" not in e.numbers:
        return e
    own = [o for o in current.problem.model.effects if o.kin(e) and "value" in o.numbers]
    alike = [o for o in own if o.numbers["value"].unit == e.numbers["value"].unit]
    sizes = [0.5 * abs(o.values["value"]) for o in alike]
    if not alike and e.friction_width():
        missing = dict(zip(current.noise.driven, current.noise.process.tolist(), strict=True))
        sizes = [missing.get(e.axis, 0.0)]
    value = max(abs(e.values["value"]), *sizes, 0.0)
    return e.within_bounds(**{**e.values, "value": value})


def _added_in_turn(search: Search, current: Fit, members: Sequence[Scored]) -> Added | None:
    """Return the fit with the members of a set added one after the other, the best first.

    None where a member makes the fit less likely: then it has not reached its optimum.
    """
    earlier: list[Tried] = []
    before = current
    for k, s in enumerate(members):
        e = likeliest_onset(before, s) if k == 0 else s
        t = search.once(before, e.effect, e) if k == 0 else try_effect(search, before, e.effect)
        if t is None:
            return None
        if k == len(members) - 1:
            return Added(tuple(earlier), before, t)
        if t.gain < 0.0:
            return None
        earlier.append(t)
        before = t.fit
    return None


def _likeliest(search: Search, found: Sequence[Added], looked_at: int) -> Added | None:
    """Return the likeliest of the sets whose last effect passes all tests, each fitted with its own noise.

    Ties must not depend on rounding: of sets with equal cost, the one with fewer parameters is returned, then
    the first by name.
    """
    criteria, penalised = search.criteria, search.criteria.penalised
    known = [a.last for a in found if passes(a.last, looked_at, criteria)]
    found = [replace(a, among=candidate_count(search, a.last, known, looked_at)) for a in found]
    good = [a for a in found if passes_all_tests(search, a.last, a.among)]
    good = [a for a in good if not any(is_redundant(a.last, o.last, criteria) for o in good)]
    if not good:
        return None
    least = min(penalised(a.last.fit) for a in good)
    for a in good:
        rule, behind = "cost above the likeliest candidate's, less than", penalised(a.last.fit) - least
        search.trace.append(Decision("fit", a.last.name, rule, behind, TRIALS.near, behind < TRIALS.near))
    near = [a for a in good if penalised(a.last.fit) < least + TRIALS.near]
    near = [replace(a, last=with_times(search, a.last)) for a in near]
    least = min(penalised(a.last.fit) for a in near)
    level = [a for a in near if penalised(a.last.fit) < least + TRIALS.level]
    return min(level, key=lambda a: (len(a.last.fit.p), a.last.name))
