"""An effect added to a model and fitted; what is asked of it before it is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.discrepancy.criteria import Criteria
from hovercontrol.discrepancy.evidence.blocks import Blocks, agreement
from hovercontrol.discrepancy.evidence.sensors import only_noise
from hovercontrol.discrepancy.search.score import Scored, likelier_time
from hovercontrol.effects import Effect, Shape
from hovercontrol.estimation.fit import CONVERGENCE, Fit, estimate, first_noise, refit
from hovercontrol.estimation.prior import prior_of
from hovercontrol.estimation.subject import Subject
from hovercontrol.io.short_repr import short_repr


@dataclass(frozen=True)
class TrialCriteria:
    """When the fit of one more effect is repeated.

    No published source: set by hand, exercised by tests/discrepancy/test_select.py.

    Attributes
    ----------
    half : float
        Part of the gain predicted by the score that a fit must reach; else it is started again, and does not
        count as the best of its round.
    promised : float
        Part of the gain asked for that a score must promise for a fit: a score is no more than near it.
    near : float
        Difference of cost below which both fits get correlation times of their own.
    level : float
        Difference of cost that counts as none: fits stop within it.
    quiet : float
        Part of its process noise with which a fit begins again at the given coefficients: its equations must
        then explain what the noise took.
    """

    half: float = 0.5
    promised: float = 0.75
    near: float = 300.0
    level: float = 0.1
    quiet: float = 0.1


#: The values in use.
TRIALS = TrialCriteria()


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
    bristles : bool
        Whether it is a friction with bristles, whose five numbers fit a part of much else.
    """

    name: str
    fit: Fit
    gain: float
    blocks: Blocks
    numbers: int
    bristles: bool = False

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Search:
    """What every step of a search is given."""

    model: Subject
    names: Sequence[str] | None
    criteria: Criteria
    report: Callable[[str], None]

    def fit(self, near: Fit, model: Subject, times: bool = False) -> Fit:
        """Fit a model from where another ended; correlation times of process noise stay unless asked."""
        problem = near.problem.of(model)
        prior = prior_of(problem, self.model)
        try:
            return refit(near, problem, prior, times=times)
        except FloatingPointError:  # what it lacks now it had used to stay on the logs: begin afresh
            return estimate(problem, prior, first_noise(problem), times=times)


def passes(t: Tried, looked_at: int, criteria: Criteria) -> bool:
    """Return whether an effect brings what is asked for: gain, agreement of blocks, one size everywhere."""
    return not why_not(t, looked_at, criteria)


def why_not(t: Tried, looked_at: int, criteria: Criteria) -> str:
    """Return why an effect is not named; empty if it may be."""
    asked = criteria.least + criteria.each * t.numbers
    if t.gain < asked:
        return f"gains {t.gain:.3g} in twice the log likelihood, {asked:g} are asked for"
    b = t.blocks
    if only_noise(t.fit, criteria):
        return ""
    if t.bristles:
        return "its bristles do not explain all"
    p = criteria.level / max(looked_at, 1)
    if b.p_value > p:
        return f"blocks of the logs do not agree on it (t = {b.t:.1f}, {b.same_sign} of {b.n} with its sign)"
    if b.spread > criteria.spread(looked_at) and b.n >= criteria.blocks:
        return f"its size differs from block to block by {100 * b.spread:.0f} %"
    return ""


def falls_short(t: Tried, scored: Scored) -> bool:
    """Return whether a fit gains less than half of what its score promised."""
    return t.gain < TRIALS.half * scored.gain


def try_effect(search: Search, current: Fit, e: Effect, scored: Scored | None = None) -> Tried | None:
    """Return the fit with an effect; None where that model runs away from the logs.

    A fit that gains less than half of what its score promised has lost its way: it begins again at the given
    coefficients, with the effect at each of its trial values, until two fits end at the same cost. A sensor's
    error begins again without any: the path was fitted to what the sensor shows. If blocks agree on it and
    still it gains less, it gets correlation times of its own.
    """
    first = _added(search, current, e)
    done = [first] if first else []
    gain = current.cost - first.cost if first else -np.inf
    if scored is not None and scored.allowed and gain < TRIALS.half * scored.gain:
        given = as_given(search, current)
        starts = [_neutral(e)] if type(e).kind() == "measurement" else [e, *_trials(scored)]
        for start in dict.fromkeys(starts):
            fit = _added(search, current, start, given)
            found_again = fit is not None and any(abs(fit.cost - f.cost) < CONVERGENCE.settled for f in done)
            done += [fit] if fit else []
            if found_again:
                break
    if not done:
        return None
    t = _tried(e.name, min(done, key=lambda f: f.cost), current)
    short = scored is not None and scored.allowed and falls_short(t, scored)
    return _in_other_noise(search, current, t) if short and t.blocks.p_value < search.criteria.level else t


def _tried(name: str, fit: Fit, current: Fit) -> Tried:
    """Return what the fit with an effect brings over the one without it."""
    numbers = len(fit.p) - len(current.p)
    bristles = len(fit.problem.bristles) > len(current.problem.bristles)
    return Tried(name, fit, current.cost - fit.cost, agreement(fit, current, name), numbers, bristles)


def _in_other_noise(search: Search, current: Fit, t: Tried) -> Tried:
    """Return a fit with its correlation times at their likeliest, beside the model without it under the same.

    Noise of the times that fit a model without an effect may do as well as the effect.
    """
    timed = with_times(search, t)
    if timed.fit.cost > t.fit.cost - CONVERGENCE.settled:
        return t
    less = search.fit(replace(current, noise=timed.fit.noise), current.model)
    gain = min(current.cost, less.cost) - timed.fit.cost
    return replace(timed, gain=gain, blocks=agreement(timed.fit, current, t.name))


def _neutral(e: Effect) -> Effect:
    """Return an effect with the numbers that scale it at their neutral values."""
    neutral = {k: n.neutral for k, n in type(e).numbers.items() if not np.isnan(n.neutral)}
    return e.within_bounds(**{**e.values, **neutral})


def _trials(scored: Scored) -> list[Effect]:
    """Return an effect at the trial values of the shape that scales it."""
    trial, shapes = scored.candidate.trial, scored.candidate.amplitudes
    if len(shapes) != 1 or not isinstance(type(trial).numbers[shapes[0]], Shape):
        return []
    size = trial.values[shapes[0]]
    return [trial.within_bounds(**{**trial.values, shapes[0]: size * part}) for part in (0.4, 1.0, 2.5)]


def _added(
    search: Search, current: Fit, e: Effect, start: Subject | None = None, levels: bool = True
) -> Fit | None:
    """Return the fit of a model with one more effect, from where another ended or from given coefficients."""
    model = (start or current.model).with_effects([e])
    problem = current.problem.of(model)
    p = problem.start if start else None
    try:
        return refit(current, problem, prior_of(problem, search.model), p=p, levels=levels, times=False)
    except FloatingPointError:
        return None


def begun_again(search: Search, current: Fit, t: Tried) -> Tried:
    """Return a fit, or the likelier one that begins at the given coefficients.

    The model without an effect may have gone far to make up for it, and not come back: where process noise
    took what an equation says, its coefficients are free to vanish. So there is little at first.
    """
    given, e = as_given(search, current), t.fit.model.effect(t.name)
    if np.any(search.criteria.left(t.fit)):
        quiet = replace(t.fit.noise, process=TRIALS.quiet * t.fit.noise.process)
        fit = _added(search, replace(t.fit, noise=quiet), e, given, levels=False)
        fit = fit and _added(search, replace(fit, noise=t.fit.noise), e)
    else:
        fit = _added(search, t.fit, e, given)
    if fit is None or fit.cost > t.fit.cost - 1.0:
        return t
    again = replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost, blocks=agreement(fit, current, t.name))
    return with_times(search, again)


def at_likeliest_time(search: Search, current: Fit, t: Tried) -> Tried:
    """Return a fit whose effect begins when it is likeliest: its score said so under the noise without it."""
    while (e := likelier_time(t.fit, t.name)) is not None:
        fit = _added(search, t.fit, e)
        if fit is None or fit.cost > t.fit.cost - 1.0:
            break
        t = replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost, blocks=agreement(fit, current, t.name))
    return t


def without_it(search: Search, current: Fit, t: Tried) -> Fit | None:
    """Return the model without an effect, fitted from where the fit with it ended, if most of the gain stays.

    Then the effect was no more than the way to a likelier optimum. It is asked where the effect's size does
    not bear out its gain: the square of a size over its standard error is what it gains under the same noise,
    and it cannot gain more beside a model whose noise is free.
    """
    with np.errstate(divide="ignore"):
        square = float((1.0 / t.blocks.std**2).sum())  # not known of an effect that no number scales
    if square > TRIALS.half * t.gain:
        return None
    less = search.fit(t.fit, current.model)
    return less if current.cost - less.cost > TRIALS.half * t.gain else None


def as_given(search: Search, current: Fit) -> Subject:
    """Return the given model with the effects that were added to it so far."""
    have = {o.name for o in search.model.effects}
    return search.model.with_effects([o for o in current.model.effects if o.name not in have])


def with_times(search: Search, t: Tried) -> Tried:
    """Return a fit with its correlation times at their likeliest, where process noise is left."""
    if not np.any(search.criteria.left(t.fit)):
        return t
    fit = search.fit(t.fit, t.fit.model, times=True)
    return replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost)


def sized(model: Subject, e: Effect) -> Effect:
    """Return a drag as large as half of what the model has along its axis, if its score says less.

    Near standstill dry friction hides what a drag would score: the model's own takes its place.
    """
    own = [o for o in model.effects if same_axis_drag(o, e) and "value" in o.numbers and "value" in e.numbers]
    alike = [o for o in own if o.numbers["value"].unit == e.numbers["value"].unit]
    if not alike:
        return e
    value = max(abs(e.values["value"]), 0.5 * max(abs(o.values["value"]) for o in alike))
    return e.within_bounds(**{**e.values, "value": value})


def explained(t: Tried) -> bool:
    """Whether an effect leaves process noise a small part of what it was."""
    return bool(np.all(t.fit.noise.process <= 0.02 * t.fit.problem.accelerations))


def same_axis_drag(one: Effect, other: Effect) -> bool:
    """Whether two effects are drags along the same axis, which widths of friction blend."""
    return one.axis == other.axis != ""


def bristles_bring_nothing(t: Tried, other: Tried, criteria: Criteria) -> bool:
    """Whether friction has bristles where another one along its axis, without, leaves only noise."""
    own, simple = (o.fit.model.effect(o.name) for o in (t, other))
    contained = same_axis_drag(own, simple) and isinstance(simple, type(own).contains)
    return t.bristles and contained and only_noise(other.fit, criteria)


def twins(one: Effect, other: Effect) -> bool:
    """Whether two effects only say how late something is, which every log shows alike."""
    return one.name != other.name and one.shifts_time and other.shifts_time


def beside(fit: Fit, less: Fit, name: str) -> Tried:
    """Return what a fitted effect brings beside the others of its model.

    Parameters
    ----------
    fit, less : Fit
        With and without it.
    name : str
    """
    e = fit.problem.model.effect(name)
    numbers = sum(e.parameter(k) in fit.problem.names for k in e.numbers)
    bristles = len(fit.problem.bristles) > len(less.problem.bristles)
    return Tried(name, fit, less.cost - fit.cost, agreement(fit, less, name), numbers, bristles)
