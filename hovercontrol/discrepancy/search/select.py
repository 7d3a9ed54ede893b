"""Which effects a model lacks: by score, by fits, by what blocks agree on; and what is level with them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hovercontrol.discrepancy.criteria import CRITERIA, Criteria
from hovercontrol.discrepancy.evidence.blocks import Blocks, agreement
from hovercontrol.discrepancy.search.candidates import LATE, candidates
from hovercontrol.discrepancy.search.score import Scored, Scores, at_its_time
from hovercontrol.effects import Effect, Shape
from hovercontrol.estimation.fit import Fit, estimate, first_noise, refit
from hovercontrol.estimation.prior import prior_of
from hovercontrol.estimation.problem import Problem
from hovercontrol.estimation.subject import Subject

#: Times at most that better effects are looked for in place of the named ones.
ROUNDS = 2

#: Part of what a score promised that a fit must gain to be believed.
HALF = 0.5

#: Differences of cost that correlation times of process noise may make: nearer fits get their own.
NEAR = 300.0


@dataclass(frozen=True, eq=False)
class Tried:
    """An effect added to a model and fitted.

    Attributes
    ----------
    name : str
    fit : Fit
    gain : float
        Fall of twice the negative log likelihood, noise at its likeliest on both sides.
    blocks : Blocks
    numbers : int
        How many unknowns it has.
    """

    name: str
    fit: Fit
    gain: float
    blocks: Blocks
    numbers: int


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that the logs cannot tell from a named one.

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


@dataclass(frozen=True)
class Lead:
    """A candidate that came near and is not named.

    Attributes
    ----------
    name : str
    gain : float
    blocks_t : float
    reason : str
    """

    name: str
    gain: float
    blocks_t: float
    reason: str


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


@dataclass(frozen=True, eq=False)
class _Search:
    """What every step of a search is given."""

    model: Subject
    names: Sequence[str] | None
    criteria: Criteria
    tell: Callable[[str], None]

    def fit(self, near: Fit, model: Subject, times: bool = False) -> Fit:
        """Fit a model from where another ended; correlation times of process noise stay unless asked."""
        problem = Problem(model, near.problem.data, pieces=near.problem.pieces)
        prior = prior_of(problem, self.model)
        try:
            return refit(near, problem, prior, times=times)
        except FloatingPointError:  # what it lacks now it had used to stay on the logs: begin afresh
            return estimate(problem, prior, first_noise(problem), times=times)


def select(
    base: Fit,
    model: Subject,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    tell: Callable[[str], None] = lambda what: None,
) -> Selection:
    """Return which effects a fitted model lacks.

    Parameters
    ----------
    base : Fit
        Of the model as given.
    model : Model or BlockModel
        As given: about its coefficients the prior lies.
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
    criteria : Criteria, optional
    tell : callable, optional
        Called with what is being tried.
    """
    search = _Search(model, names, criteria, tell)
    current = base
    effects: list[str] = []
    steps: list[tuple[str, float]] = []
    tried: dict[str, Tried] = {}
    seen: list[Scored] = []
    first: list[Tried] = []
    provisional = False
    while True:
        tell("scoring the catalogue")
        seen = Scores(current, candidates(current, names)).best()
        if len(effects) >= max_effects:
            break
        found = _add(search, current, seen)
        first = found if current is base else first
        tried = {t.name: t for t in found}
        good = [t for t in found if passes(t, len(seen), criteria)]
        if not good:
            hidden = _unscored(search, current, seen, {t.name for t in found})
            good = [t for t in hidden if passes(t, len(seen), criteria)]
            tried |= {t.name: t for t in hidden}
        if not good and found and not provisional:  # beside another one it may be what it is alone not
            provisional = True
            good = [t for t in found if t.gain > criteria.least + criteria.each * t.numbers]
        if not good:
            break
        best = _begun_again(search, current, _likeliest(search, good))
        effects.append(best.name)
        steps.append((best.name, best.gain))
        current = best.fit
    selection = Selection(
        base, current, tuple(effects), steps=tuple(steps), candidates=len(seen) + len(effects)
    )
    if effects:
        selection = _confirmed(search, selection, first)
    return replace(selection, leads=_leads(seen, tried, selection, criteria))


def _unscored(search: _Search, current: Fit, seen: Sequence[Scored], done: set[str]) -> list[Tried]:
    """Return fits with frictions that fade with speed, in equations in which something remains.

    Near standstill they are far from linear: no score says what they would gain.
    """
    problem = current.problem
    left = current.noise.process > search.criteria.negligible * problem.accelerations
    axes = {
        problem.block.states[problem.free[i]].name
        for i, there in zip(problem.driven, left, strict=True)
        if there
    }
    found = []
    for s in seen:
        e = s.candidate.trial
        shapes = [k for k, n in e.numbers.items() if isinstance(n, Shape) and n.of == "speed"]
        if not shapes or getattr(e, "axis", "") not in axes or e.name in done:
            continue
        search.tell(f"trying {e.name}")
        t = _tried(search, current, _sized(problem.model, s.effect))
        found += [t] if t else []
    return found


def _likeliest(search: _Search, good: Sequence[Tried]) -> Tried:
    """Return the likeliest of effects that may be named, each with correlation times of its own."""
    each = search.criteria.each
    least = min(t.fit.cost + each * t.numbers for t in good)
    near = [_timed(search, t) for t in good if t.fit.cost + each * t.numbers < least + NEAR]
    return min(near, key=lambda t: t.fit.cost + each * t.numbers)


def _begun_again(search: _Search, current: Fit, t: Tried) -> Tried:
    """Return a fit, or the likelier one that begins at the given coefficients.

    The model without an effect may have gone far to make up for it, and not come back.
    """
    given = _as_given(search, current)
    fit = _added(search, t.fit, t.fit.model.effect(t.name), given)
    if fit is None or fit.cost > t.fit.cost - 1.0:
        return t
    again = replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost, blocks=agreement(fit, current, t.name))
    return _timed(search, again)


def _as_given(search: _Search, current: Fit) -> Subject:
    """Return the given model with the effects that were added to it so far."""
    have = {o.name for o in search.model.effects}
    return search.model.with_effects([o for o in current.model.effects if o.name not in have])


def _timed(search: _Search, t: Tried) -> Tried:
    """Return a fit with its correlation times at their likeliest, where process noise is left."""
    if not np.any(t.fit.noise.process > search.criteria.negligible * t.fit.problem.accelerations):
        return t
    fit = search.fit(t.fit, t.fit.model, times=True)
    return replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost)


def passes(t: Tried, looked_at: int, criteria: Criteria) -> bool:
    """Tell whether an effect brings what is asked for: gain, agreement of blocks, one size everywhere."""
    return not why_not(t, looked_at, criteria)


def why_not(t: Tried, looked_at: int, criteria: Criteria) -> str:
    """Return why an effect is not named; empty if it may be."""
    asked = criteria.least + criteria.each * t.numbers
    if t.gain < asked:
        return f"gains {t.gain:.3g} in twice the log likelihood, {asked:g} are asked for"
    b = t.blocks
    if not np.any(t.fit.noise.process > criteria.negligible * t.fit.problem.accelerations):
        return ""  # all that remains is noise of the measurements
    p = criteria.level / max(looked_at, 1)
    if b.p_value > p:
        return f"blocks of the logs do not agree on it (t = {b.t:.1f}, {b.same_sign} of {b.n} with its sign)"
    if b.spread > criteria.spread and b.n >= criteria.blocks:
        return f"its size differs from block to block by {100 * b.spread:.0f} %"
    return ""


def _add(search: _Search, current: Fit, seen: Sequence[Scored]) -> list[Tried]:
    """Return fits with the candidates that score best, and with drags along the same axis as the best."""
    criteria, model = search.criteria, current.problem.model
    worthy = [s for s in seen if s.allowed and s.gain > criteria.least + criteria.each * len(s.parts)]
    if not worthy:
        return []
    top = worthy[0]
    near = [s for s in worthy if s is top or s.gain > criteria.share * top.gain]
    starts = [at_its_time(current, s).effect for s in near[: criteria.tries]]
    names = {e.name for e in starts}
    kin = [
        _sized(model, s.effect)
        for s in seen
        if same_axis(s.candidate.trial, top.candidate.trial) and s.candidate.name not in names
    ]
    found: list[Tried] = []
    for e in [*starts, *kin]:
        if any(twins(t.name, e.name) for t in found):
            continue
        if found and _explained(found[0]) and not same_axis(e, top.candidate.trial):
            share = next(s.gain for s in seen if s.candidate.name == e.name) / top.gain
            if share < criteria.alike:
                continue
        search.tell(f"trying {e.name}")
        promised = next((s for s in seen if s.candidate.name == e.name), None)
        t = _tried(search, current, e, promised)
        found += [t] if t else []
    return found


def _sized(model: Subject, e: Effect) -> Effect:
    """Return a drag as large as half of what the model has along its axis, if its score says less.

    Near standstill dry friction hides what a drag would score: the model's own takes its place.
    """
    own = [o for o in model.effects if same_axis(o, e) and "value" in o.numbers and "value" in e.numbers]
    alike = [o for o in own if o.numbers["value"].unit == e.numbers["value"].unit]
    if not alike:
        return e
    value = max(abs(e.values["value"]), 0.5 * max(abs(o.values["value"]) for o in alike))
    return type(e)(**{**e.values, "value": value})


def _explained(t: Tried) -> bool:
    """Whether an effect leaves process noise a small part of what it was."""
    return bool(np.all(t.fit.noise.process <= 0.02 * t.fit.problem.accelerations))


def _tried(search: _Search, current: Fit, e: Effect, scored: Scored | None = None) -> Tried | None:
    """Return the fit with an effect; None where that model runs away from the logs.

    A fit that gains less than half of what its score promised has lost its way: it begins again at the given
    coefficients, with the effect at each of its trial values.
    """
    fits = [_added(search, current, e)]
    gain = max((current.cost - f.cost for f in fits if f), default=-np.inf)
    if scored is not None and scored.allowed and gain < HALF * scored.gain:
        given = _as_given(search, current)
        fits += [_added(search, current, start, given) for start in dict.fromkeys([e, *_trials(scored)])]
    done = [f for f in fits if f]
    if not done:
        return None
    fit = min(done, key=lambda f: f.cost)
    numbers = len(fit.p) - len(current.p)
    return Tried(e.name, fit, current.cost - fit.cost, agreement(fit, current, e.name), numbers)


def _trials(scored: Scored) -> list[Effect]:
    """Return an effect at the trial values of the shape that scales it."""
    trial, shapes = scored.candidate.trial, scored.candidate.amplitudes
    if len(shapes) != 1 or not isinstance(type(trial).numbers[shapes[0]], Shape):
        return []
    size = trial.values[shapes[0]]
    return [type(trial)(**{**trial.values, shapes[0]: size * part}) for part in (0.4, 1.0, 2.5)]


def _added(search: _Search, current: Fit, e: Effect, start: Subject | None = None) -> Fit | None:
    """Return the fit of a model with one more effect, from where another ended or from given coefficients."""
    model = (start or current.model).with_effects([e])
    problem = Problem(model, current.problem.data, pieces=current.problem.pieces)
    prior = prior_of(problem, search.model)
    try:
        return refit(current, problem, prior, p=problem.start if start else None, times=False)
    except FloatingPointError:
        return None


def same_axis(one: Effect, other: Effect) -> bool:
    """Whether two effects are drags along the same axis, which widths of friction blend."""
    return getattr(one, "axis", None) == getattr(other, "axis", 0)


def twins(one: str, other: str) -> bool:
    """Whether two effects only say how late something is, which every log shows alike."""
    return one != other and {one, other} <= LATE


def without_effects(model: Subject, *names: str) -> Subject:
    """Return a model less some of its effects, all else as it is."""
    return replace(model, effects=tuple(e for e in model.effects if e.name not in names))


def _confirmed(search: _Search, selection: Selection, first: Sequence[Tried]) -> Selection:
    """Drop what is not needed, put better ones in, and say what is level with each.

    `first` were fitted beside the model as given: they need not be again.
    """
    criteria = search.criteria
    effects, final = list(selection.effects), selection.final
    rivals: list[Rival] = []
    gains: dict[str, float] = {}
    without: dict[str, Fit] = {}
    done = {t.name: t for t in first}
    for _ in range(ROUNDS):
        rivals, gains, without, changed = [], {}, {}, False
        for name in list(effects):
            alone = len(effects) == 1
            less = selection.base if alone else search.fit(final, without_effects(final.model, name))
            own = Tried(
                name, final, less.cost - final.cost, agreement(final, less, name), _numbers(final, name)
            )
            gains[name], without[name] = own.gain, less
            if not passes(own, selection.candidates, criteria):
                effects.remove(name)
                final, changed = less, True
                break
            others = [
                s
                for s in Scores(less, candidates(less, search.names)).best()
                if s.candidate.name != name and s.allowed
            ]
            best = max((s.gain for s in others), default=0.0)
            tried: list[Tried] = []
            for s in others:
                same = twins(name, s.candidate.name)
                if same:
                    rivals.append(Rival(s.candidate.name, name, 0.0, 0.0, final, same))
                    continue
                kin = same_axis(s.candidate.trial, final.problem.model.effect(name))
                share = criteria.share if kin or not _explained(own) else criteria.alike
                near = s.gain > max(share * max(best, 0.0), criteria.least)
                if not near or len(tried) >= criteria.tries:
                    continue
                known = done.get(s.candidate.name) if alone else None
                if known is None:
                    search.tell(f"trying {s.candidate.name} in place of {name}")
                t = known or _tried(search, less, s.effect, s)
                tried += [t] if t else []
            for t in tried:
                if (t.fit.cost + criteria.each * t.numbers) < final.cost + criteria.each * own.numbers + NEAR:
                    t = _timed(search, t)
                behind = (t.fit.cost + criteria.each * t.numbers) - (final.cost + criteria.each * own.numbers)
                d = t.fit.block_costs - final.block_costs
                score = float(d.sum() / max(np.sqrt(d.size) * d.std(ddof=1), 1e-300)) if d.size > 1 else 0.0
                ok = passes(t, selection.candidates, criteria)
                if behind < 0.0 and ok:
                    effects[effects.index(name)] = t.name
                    final, changed = t.fit, True
                    break
                if ok and (behind < criteria.apart or score < criteria.apart_t):
                    rivals.append(Rival(t.name, name, behind, score, t.fit))
            if changed:
                break
        if not changed:
            break
        gains, without = {}, {}
    for name in effects:  # the last round may have changed them
        if name not in without:
            without[name] = (
                selection.base if len(effects) == 1 else search.fit(final, without_effects(final.model, name))
            )
            gains[name] = without[name].cost - final.cost
    rivals = [r for r in rivals if r.instead_of in effects]
    blocks = {name: agreement(final, without.get(name, selection.base), name) for name in effects}
    gains = {name: gains[name] for name in effects}
    return replace(
        selection,
        final=final,
        effects=tuple(effects),
        rivals=tuple(rivals),
        gains=gains,
        blocks=blocks,
        without=without,
    )


def _numbers(fit: Fit, name: str) -> int:
    e = fit.problem.model.effect(name)
    return sum(e.parameter(k) in fit.problem.names for k in e.numbers)


def _leads(
    seen: Sequence[Scored], tried: dict[str, Tried], selection: Selection, criteria: Criteria
) -> tuple[Lead, ...]:
    """Return the candidates that came nearest beside what is named, with the reason why not."""
    found: list[Lead] = []
    left = selection.final.noise.process > criteria.negligible * selection.final.problem.accelerations
    nearest = 3 if np.any(left) and not selection.effects else 0  # are told however little they gain
    for s in seen:
        if s.candidate.name in selection.effects or (s.gain < criteria.least and len(found) >= nearest):
            continue
        t = tried.get(s.candidate.name)
        if t is not None:
            reason = why_not(t, len(seen), criteria) or "another one takes more"
            found.append(Lead(t.name, t.gain, t.blocks.t, reason))
            continue
        score_t = float(np.sqrt(max(s.chi2, 0.0)))
        if not s.allowed:
            reason = "fits best with a sign or size that its bounds forbid"
        elif s.gain < criteria.least + criteria.each * len(s.parts):
            asked = criteria.least + criteria.each * len(s.parts)
            reason = f"gains {s.gain:.3g} in twice the log likelihood, {asked:g} are asked for"
        elif s.p_value > criteria.level / max(len(seen), 1):
            reason = f"blocks of the logs do not agree on it (t = {score_t:.1f})"
        else:
            reason = "another one takes more"
        found.append(Lead(s.candidate.name, s.gain, score_t, reason))
    return tuple(found[:8])
