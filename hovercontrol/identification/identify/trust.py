"""Trust in fitted coefficients, tested by other estimates: with a missing effect, and over a longer time.

Standard errors are valid if the model is complete. The coefficients of an incomplete model compensate for the
missing effects and are biased. Two further estimates ("readings") of a coefficient show this:

- The coefficients with a missing effect. One filter run scores the catalogue. The effect with the largest
  cross-validated gain, which did not determine its size, is added and fitted.
- The coefficients over longer times. A fit with random forces depends mostly on changes from row to row,
  which a small delay biases. One Gauss-Newton step on rows that are 0.5 or 2 s apart depends on changes over
  that time. If the model is complete, both estimate the same coefficients. Their difference is compared with
  its own scatter over blocks (Hausman, Econometrica 46 (1978)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect
from hovercontrol.identification.diagnose.coefficients import Reading
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.search.candidates import candidates
from hovercontrol.identification.diagnose.search.fit import Search, Tried, try_effect
from hovercontrol.identification.diagnose.search.score import Scored, Scores, likeliest_onset
from hovercontrol.identification.diagnose.search.sets import singles
from hovercontrol.identification.engine.feedback import fed_back
from hovercontrol.identification.engine.fit import Fit, refit
from hovercontrol.identification.engine.passes import inverse
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.scoring import NO_LEVELS, scores
from hovercontrol.identification.engine.subject import unknowns


@dataclass(frozen=True)
class TrustCriteria:
    """Thresholds for other readings of a coefficient.

    Attributes
    ----------
    fitted : int
        Number of candidates that are added and fitted, each to the given model.
    together : int
        Number of effects that are then added one after the other to the best of these.
    numbers : int
        Maximum number of parameters of a candidate effect: LuGre friction, with five, also fits parts of many
        other effects.
    horizons : tuple of float
        Times [s] over which the coefficients are estimated again: longer than the lag of an actuator and
        shorter than slow drifts.
    level : float
        Probability of one or more false detections in all coefficients and horizons together.
    moved : float
        Number of standard errors by which a reading must differ for a coefficient to be called biased.
    surely : float
        Number of standard errors by which a fixed parameter must change when it is estimated, to be called
        wrong.
    """

    fitted: int = 2
    together: int = 2
    numbers: int = 3
    horizons: tuple[float, ...] = (0.5, 2.0)
    level: float = 0.01
    moved: float = 1.0
    surely: float = 3.0


#: The values in use.
TRUST = TrustCriteria()


@dataclass(frozen=True, eq=False)
class Trust:
    """Other readings of fitted coefficients.

    Attributes
    ----------
    readings : mapping of str to tuple of Reading
        Readings by coefficient; only those that differ by more than its standard error.
    effects : tuple of Effect
        Missing effects that were fitted, the most likely first, as fitted.
    gain : float
        Reduction of twice the negative log likelihood by the most likely one.
    """

    readings: Mapping[str, tuple[Reading, ...]]
    effects: tuple[Effect, ...] = ()
    gain: float = 0.0


def trust(
    fit: Fit, std: Array, fixed: Sequence[str] = (), report: Callable[[str], None] = lambda what: None
) -> Trust:
    """Return other readings of the coefficients of a fit.

    Parameters
    ----------
    std : ndarray, shape (P,)
        Standard errors of the coefficients.
    fixed : sequence of str, optional
        Parameters that keep their values in every reading.
    report : callable, optional
        Called with a text on the current step.
    """
    search = Search(fit.problem.model, None, CRITERIA, report)
    found = _fitted(search, fit, fixed)
    report("reading over longer times")
    readings: dict[str, list[Reading]] = {}
    for cause, other in found:
        errors = np.sqrt(np.maximum(np.diag(other.covariance), 0.0))
        at = {name: j for j, name in enumerate(other.problem.names)}
        for j, name in enumerate(fit.problem.names):
            value, error = float(other.p[at[name]]), float(errors[at[name]])
            if abs(value - fit.p[j]) > TRUST.moved * std[j]:
                readings.setdefault(name, []).append(Reading(value, error, f"with {' and '.join(cause)}"))
    for name, reading in _over_longer_times(fit, std):
        readings.setdefault(name, []).append(reading)
    have = {e.name for e in fit.problem.model.effects}
    added = {e.name: e for _, f in reversed(found) for e in f.model.effects if e.name not in have}
    effects = tuple(added[n] for n in dict.fromkeys(n for cause, _ in found for n in cause) if n in added)
    gain = fit.cost - found[0][1].cost if found else 0.0
    return Trust({name: tuple(own) for name, own in readings.items()}, effects, gain)


def _fitted(search: Search, fit: Fit, fixed: Sequence[str]) -> list[tuple[tuple[str, ...], Fit]]:
    """Return fits of extended models, the most likely first, with the names of their additions.

    First the model's fixed parameters, such as the width of dry friction, are fitted too. Then effects of the
    catalogue are added.
    """
    free = _with_all_numbers(search, fit, fixed)
    kept, fit = free if free else ((), fit)
    search.report("scoring the catalogue")
    single = _tried(search, fit, TRUST.fitted)
    least = min((CRITERIA.penalised(t.fit) for t in single), default=0.0)
    found = [((*kept, t.name), t.fit) for t in single if CRITERIA.penalised(t.fit) <= least + CRITERIA.apart]
    for _ in range(TRUST.together - 1):
        if not found or not np.any(CRITERIA.left(found[0][1])):
            break
        cause, best = found[0]
        more = _tried(search, best, 1)
        if not more:
            break
        found[0] = ((*cause, more[0].name), more[0].fit)
    return found or ([free] if free else [])


def _with_all_numbers(search: Search, fit: Fit, fixed: Sequence[str]) -> tuple[tuple[str, ...], Fit] | None:
    """Return the fixed parameters that change when all are fitted, and that fit; None if it gains little."""
    model = fit.problem.model
    free = [name for name in unknowns(model) if name not in fixed]
    kept = [name for name in free if name not in fit.problem.names]
    if not kept:
        return None
    search.report("fitting what was kept")
    problem = Problem(model, fit.problem.data, free)
    try:
        full = refit(fit, problem, prior_of(problem, model))
    except FloatingPointError:
        return None
    if fit.cost - full.cost < CRITERIA.least + CRITERIA.each * len(kept):
        return None
    std = np.sqrt(np.maximum(np.diag(full.covariance), 1e-300))
    away = {n: abs(full.p[j] - problem.start[j]) / std[j] for j, n in enumerate(problem.names) if n in kept}
    return tuple(n for n in kept if away[n] > TRUST.surely), full


def _tried(search: Search, fit: Fit, count: int) -> list[Tried]:
    """Return fits with the candidates of largest cross-validated gain, which did not set their size."""
    found: list[Tried] = []
    missed = 0
    for s in _worthy(fit):
        if len(found) == count or missed > count:
            break
        s = likeliest_onset(fit, s)
        if any(t.effect.twin(s.effect) for t in found):
            continue
        t = try_effect(search, fit, s.effect, s)
        if t is None or t.gain < CRITERIA.least + CRITERIA.each * t.numbers:
            missed += 1
        else:
            found.append(t)
    return sorted(found, key=lambda t: CRITERIA.penalised(t.fit))


def _worthy(fit: Fit) -> list[Scored]:
    """Return the candidates with sufficient cross-validated gain, each at its best trial, best first."""
    known = [c for c in candidates(fit) if _is_candidate(fit.problem, type(c.trial))]
    found = singles(Scores(fit, known))
    return [
        one.members[0]
        for one in found
        if one.gain >= CRITERIA.least + CRITERIA.each * max(len(one.members[0].candidate.amplitudes), 1)
    ]


def _is_candidate(problem: Problem, cls: type[Effect]) -> bool:
    """Return whether an effect is a candidate.

    An effect with many parameters (:data:`TRUST`) is not. The scale of the only measured channel is not
    either, because no log can distinguish it from the model's gains.
    """
    gauge = len(problem.rows.channels) == 1 and cls.name == f"{problem.rows.channels[0]}_scale"
    return len(cls.numbers) <= TRUST.numbers and not gauge


def _over_longer_times(fit: Fit, std: Array) -> list[tuple[str, Reading]]:
    """Return readings on rows further apart that differ significantly, if the fit has random forces.

    There are none under feedback (:mod:`hovercontrol.identification.engine.feedback`).
    """
    if not np.any(CRITERIA.left(fit)) or not len(fit.p) or fed_back(fit, TRUST.level):
        return []
    found: dict[str, Reading] = {}
    slope, tests = fit.problem.slope(fit.p), len(fit.p) * len(TRUST.horizons)
    for horizon in TRUST.horizons:
        horizon *= fit.problem.tempo
        if (read := _read_over(fit, horizon)) is None:
            continue
        step, own, difference, dof = read
        # Two-sided t test at the level `level` / `tests` (Bonferroni), in units of the standard error.
        asked = float(stats.t.isf(0.5 * TRUST.level / tests, dof))
        for j, name in enumerate(fit.problem.names):
            moved = abs(step[j]) * slope[j] > TRUST.moved * std[j]
            if moved and abs(step[j]) > asked * difference[j] and abs(step[j]) > asked * own[j]:
                value = float(fit.p[j] + step[j] * slope[j])
                found[name] = Reading(value, float(own[j] * slope[j]), f"over {horizon:g} s")
    return list(found.items())


def _read_over(fit: Fit, horizon: float) -> tuple[Array, Array, Array, int] | None:
    """Return the step of the unknowns on rows a time apart, its standard error, and that of the difference.

    With f_b and G_b the score and the information of block b, in the fit and (primed) on the rows further
    apart, f and G their sums, with the prior's gradient and precision included, and B the number of blocks::

        step       = G'^-1 f',
        psi_b      = G'^-1 (f'_b - G'_b step) - G^-1 f_b,
        difference = sqrt(B / (B - 1) sum psi_b psi_b^T).

    The last value is the number of degrees of freedom, B - 1, where B counts the blocks with rows left.
    Returns None for fewer than two blocks.
    """
    problem, prior = fit.problem, fit.prior
    pull = prior.slope(problem.inside(fit.p))
    thin = problem.without(problem.seen & ~_apart(problem, horizon)[..., None])
    known = np.diag(fit.S.sum(axis=0))
    G, f = map(problem.rows.by_block, scores(thin, fit.noise, fit.p, fit.path, NO_LEVELS, known))
    B = int((np.trace(G, axis1=1, axis2=2) > 0.0).sum())
    if B < 2:
        return None
    C = inverse(G.sum(axis=0) + np.diag(prior.precision))
    before = inverse(fit.S.sum(axis=0) + np.diag(prior.precision))
    step = C @ (f.sum(axis=0) - pull)
    own = (f - G @ step - pull / B) @ C
    difference = own - (fit.g - pull / B) @ before
    wide = B / max(B - 1, 1)
    noise = np.maximum(np.diag(C), wide * (own**2).sum(axis=0))
    return step, np.sqrt(noise), np.sqrt(wide * (difference**2).sum(axis=0)), B - 1


def _apart(problem: Problem, horizon: float) -> NDArray[np.bool_]:
    """Return the measured rows to keep so that they are at least `horizon` apart, shape (K, W)."""
    time, measured = problem.rows.time, np.asarray(problem.seen.any(axis=2))
    kept = np.zeros(time.shape, dtype=bool)
    for w in range(time.shape[1]):
        rows = np.flatnonzero(measured[:, w])
        last = -np.inf
        for k in rows.tolist():
            if time[k, w] - last > horizon * (1.0 - 1e-6):
                kept[k, w], last = True, time[k, w]
    return kept
