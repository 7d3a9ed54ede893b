"""An effect added to a model and fitted, and the tests that it must pass to be named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects import Effect
from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.diagnose.evidence.blocks import Blocks, agreement
from hovercontrol.identification.diagnose.search.candidates import candidates
from hovercontrol.identification.diagnose.search.score import Scored, Scores, likelier_time
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.fit import CONVERGENCE, Fit, estimate, first_noise, refit
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.subject import Subject


@dataclass(frozen=True)
class TrialCriteria:
    """Settings that decide when the fit of one more effect is repeated.

    No published source: set by hand, exercised by tests/identification/diagnose/test_select.py.

    Attributes
    ----------
    half : float
        Fraction of the predicted gain (the score) that a fit must reach. A fit below it is started again and
        does not count as the best of its round.
    promised : float
        Fraction of the required gain that a score must predict for a fit to be tried: a score is only
        approximate.
    near : float
        Difference of cost below which both fits get correlation times of their own.
    level : float
        Difference of cost that counts as zero, since fits stop within it.
    quiet : float
        Fraction of the process noise with which a fit restarts at the given coefficients. The equations must
        then explain what the noise absorbed.
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
        Reduction of twice the negative log likelihood, with the likeliest noise on both sides.
    blocks : Blocks
    numbers : int
        Number of unknowns of the effect.
    """

    name: str
    fit: Fit
    gain: float
    blocks: Blocks
    numbers: int

    __repr__ = short_repr

    @property
    def effect(self) -> Effect:
        """The effect in the fitted model, at the start of its fit."""
        return self.fit.problem.model.effect(self.name)


#: Fits that were made: from which fit, with which effect, and what came of it.
Made: TypeAlias = list[tuple[Fit, str, Tried | None]]


@dataclass(frozen=True, eq=False)
class Search:
    """Arguments shared by all steps of a search."""

    model: Subject
    names: Sequence[str] | None
    criteria: Criteria
    report: Callable[[str], None]
    trace: list[Decision] = field(default_factory=list)
    made: Made = field(default_factory=list)
    tables: list[Scores] = field(default_factory=list)

    def scores(self, fit: Fit) -> Scores:
        """Return the scores of all candidates on a fit; they are computed once."""
        for table in self.tables:
            if table.fit is fit:
                return table
        self.tables.append(Scores(fit, candidates(fit, self.names)))
        return self.tables[-1]

    def once(self, current: Fit, e: Effect, scored: Scored | None = None) -> Tried | None:
        """Return the fit with an effect; a fit that was made from here before is not made again."""
        for before, name, t in self.made:
            if before is current and name == e.name:
                return t
        self.report(f"trying {e.name}")
        t = try_effect(self, current, e, scored)
        self.made.append((current, e.name, t))
        return t

    def fit(self, near: Fit, model: Subject, times: bool = False) -> Fit:
        """Fit a model from the end of another fit; `times`: fit the noise's correlation times as well.

        A fit that runs away is no likelier one: of the same model, the other fit is kept.
        """
        problem = near.problem.of(model)
        prior = prior_of(problem, self.model)
        try:
            return refit(near, problem, prior, times=times)
        except FloatingPointError:
            if model.signature == near.model.signature:
                return near
            # the removed effect kept the path near the logs; restart
            return estimate(problem, prior, first_noise(problem), times=times)


def try_effect(search: Search, current: Fit, e: Effect, scored: Scored | None = None) -> Tried | None:
    """Return the fit with an effect; None if the simulation of that model diverges from the logs.

    A fit that gains less than half of its predicted gain is taken to have ended in a poor local optimum. It
    is started again at the given coefficients, with the effect at each of its trial values, until two fits
    end at the same cost. A sensor error restarts at its neutral value, since the path was fitted to the
    sensor's readings.
    """
    first = _added(search, current, e)
    done = [first] if first else []
    gain = current.cost - first.cost if first else -np.inf
    if scored is not None and scored.allowed and gain < TRIALS.half * scored.gain:
        given = as_given(search, current)
        for start in dict.fromkeys(e.begins(scored.candidate.trial)):
            fit = _added(search, current, start, given)
            found_again = fit is not None and any(abs(fit.cost - f.cost) < CONVERGENCE.settled for f in done)
            done += [fit] if fit else []
            if found_again:
                break
    if not done:
        return None
    t = _tried(e.name, min(done, key=lambda f: f.cost), current)
    if scored is not None:
        rule, half = "gain of the fit, at least half of the predicted", TRIALS.half * scored.gain
        search.trace.append(Decision("fit", e.name, rule, t.gain, half, t.gain >= half))
    return t


def _tried(name: str, fit: Fit, current: Fit) -> Tried:
    """Return the comparison of the fit with an effect and the one without it."""
    numbers = len(fit.p) - len(current.p)
    return Tried(name, fit, current.cost - fit.cost, agreement(fit, current, name), numbers)


def in_other_noise(search: Search, current: Fit, t: Tried) -> Tried | None:
    """Return a fit with its likeliest correlation times, compared with the model without it at these times.

    None if they are no likelier than those of the model without the effect, or if the effect does not score
    what is asked for under the noise that they make: a fit alone may gain by a shape that suits a few rows.
    """
    timed = with_times(search, t)
    if timed.fit.cost > t.fit.cost - CONVERGENCE.settled:
        return None
    own = replace(current, noise=timed.fit.noise)
    likelier = min(current.cost, search.fit(own, current.model).cost)
    try:
        less = refit(own, current.problem, current.prior, levels=False, times=False)
    except FloatingPointError:
        return None
    score = Scores(less, candidates(less, [t.name])).best()[0].gain - (less.cost - likelier)
    if score < TRIALS.promised * search.criteria.least:
        return None
    return replace(timed, gain=likelier - timed.fit.cost, blocks=agreement(timed.fit, current, t.name))


def _added(
    search: Search, current: Fit, e: Effect, start: Subject | None = None, levels: bool = True
) -> Fit | None:
    """Return the fit of a model with one more effect, from the end of another fit or from a given start."""
    model = (start or current.model).with_effects([e])
    problem = current.problem.of(model)
    p = problem.start if start else None
    try:
        return refit(current, problem, prior_of(problem, search.model), p=p, levels=levels, times=False)
    except FloatingPointError:
        return None


def restarted_fit(search: Search, current: Fit, t: Tried) -> Tried:
    """Return a fit, or a likelier one that starts at the given coefficients.

    Without the effect, the coefficients may have moved far to compensate for it, and may not return: where
    process noise explains an equation, its coefficients may vanish. So the restart begins with little process
    noise.
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


def retimed_fit(search: Search, current: Fit, t: Tried) -> Tried:
    """Return a fit whose effect begins at its likeliest time.

    The score chose the time under the noise of the model without the effect, not under that of this fit.
    """
    while (e := likelier_time(t.fit, t.name)) is not None:
        fit = _added(search, t.fit, e)
        if fit is None or fit.cost > t.fit.cost - 1.0:
            break
        t = replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost, blocks=agreement(fit, current, t.name))
    return t


def reduced_fit(search: Search, current: Fit, t: Tried) -> Fit | None:
    """Return the model without an effect, fitted from the end of the fit with it, if most of the gain stays.

    Then the effect only led to a likelier optimum of the model without it. The fit is made only if the size
    of the effect does not account for its gain: under fixed noise an effect of size theta and standard error
    s gains (theta/s)^2, summed over blocks, and it cannot gain more against a model whose noise is free.
    """
    with np.errstate(divide="ignore"):
        square = float((1.0 / t.blocks.std**2).sum())  # unknown for an effect that no parameter scales
    if square > TRIALS.half * t.gain:
        return None
    less = search.fit(t.fit, current.model)
    return less if current.cost - less.cost > TRIALS.half * t.gain else None


def as_given(search: Search, current: Fit) -> Subject:
    """Return the given model, at its given coefficients, with the effects added so far."""
    have = {o.name for o in search.model.effects}
    return search.model.with_effects([o for o in current.model.effects if o.name not in have])


def with_times(search: Search, t: Tried) -> Tried:
    """Return a fit with its likeliest correlation times; unchanged if no process noise is left."""
    if not np.any(search.criteria.left(t.fit)):
        return t
    fit = search.fit(t.fit, t.fit.model, times=True)
    return replace(t, fit=fit, gain=t.gain + t.fit.cost - fit.cost)


def beside(fit: Fit, less: Fit, name: str) -> Tried:
    """Return the contribution of a fitted effect, with the others in the model.

    Parameters
    ----------
    fit, less : Fit
        Fits with and without the effect.
    name : str
    """
    e = fit.problem.model.effect(name)
    numbers = sum(e.parameter(k) in fit.problem.names for k in e.numbers)
    return Tried(name, fit, less.cost - fit.cost, agreement(fit, less, name), numbers)
