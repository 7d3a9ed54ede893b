"""What an FMU lacks: effects before its inputs, after its outputs and in its derivatives, by likelihood.

Each candidate is screened by its linear response beside the sensitivities of the fit. The best are fitted
with all parameters. What an effect needs to be named is what other models ask for
(:mod:`hovercontrol.identification.diagnose.criteria`), with the likelihood of the whitened residuals
(:mod:`hovercontrol.fmi.replay.whitening`): residuals that depend on their past are an autoregression, as
process noise would make them, so that a disturbed plant does not call for an effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.craft.effects import Effect
from hovercontrol.fmi.replay.candidates import Candidate, candidates
from hovercontrol.fmi.replay.held_out import held_out, shares_of
from hovercontrol.fmi.replay.output_error import FmuFit, fit_fmu
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows, trials_of
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.evidence.holdout import fall_of_errors
from hovercontrol.identification.diagnose.fmu_diagnosis import FmuDiagnosis, FmuNamed
from hovercontrol.identification.diagnose.fmu_fits import (
    EFFORT,
    Scored,
    agreement,
    completed,
    fitted,
    numbers_of,
    screened,
    without,
)
from hovercontrol.identification.diagnose.search.challenge import surely
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.rules import tests_of
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.diagnose.verdict import verdict
from hovercontrol.logs.log import Log


@dataclass(frozen=True, eq=False)
class _Tried:
    """A candidate beside other effects: the fits without and with it."""

    candidate: Candidate
    less: FmuFit
    fit: FmuFit

    @property
    def name(self) -> str:
        return self.candidate.name

    @property
    def gain(self) -> float:
        return self.less.cost - self.fit.cost

    @property
    def blocks(self) -> Blocks:
        return agreement(self.fit, self.less, self.candidate)


@dataclass(eq=False)
class _Search:
    """What all steps share: the candidates that are wanted, the trace, the leads."""

    wanted: set[str] | None
    said: Callable[[str], None]
    trace: list[Decision] = field(default_factory=list)
    leads: dict[str, Lead] = field(default_factory=dict)
    looked_at: int = 1
    _screened: list[tuple[FmuFit, list[Scored]]] = field(default_factory=list)
    _fits: list[tuple[FmuFit, str, FmuFit | None]] = field(default_factory=list)

    def asked_for(self, candidate: Candidate) -> bool:
        """Whether a candidate may be named."""
        return self.wanted is None or candidate.name in self.wanted

    def best(self, fit: FmuFit) -> list[Scored]:
        """Return the candidates that may improve a fit, the best first, and where a fit of each begins."""
        for known, found in self._screened:
            if known is fit:
                return found
        every = candidates(fit.model, fit.unknowns.logs)
        every = [c for c in every if self.asked_for(c)]
        self.looked_at = max(self.looked_at, len(every))
        self.said("screening effects")
        found = screened(fit, every)[: EFFORT.fitted]
        rule = "fall of the sum of squares, at least"
        self.trace += [Decision("score", c.name, rule, gain, EFFORT.screened) for gain, c, _ in found]
        self._screened.append((fit, found))
        return found

    def fit(self, less: FmuFit, candidate: Candidate, begin: Effect) -> FmuFit | None:
        """Return the fit with a candidate added; each is made once."""
        for known, name, made in self._fits:
            if known is less and name == candidate.name:
                return made
        self.said(f"fitting {candidate.name}")
        found = fitted(less, candidate, begin)
        self._fits.append((less, candidate.name, found))
        return found

    def passes(self, t: _Tried) -> bool:
        """Return whether an effect passes all tests, each of which becomes a row of the trace."""
        numbers, left = len(t.fit.p) - len(t.less.p), any(t.fit.whitening.coloured)
        rows = tests_of(t.name, t.gain, numbers, t.blocks, self.looked_at, CRITERIA, left)
        self.trace += [row for row, _ in rows]
        why = next((reason for row, reason in rows if not row.passed), "")
        if why:
            self.lead(t, why)
        return not why

    def lead(self, t: _Tried, reason: str) -> None:
        """Keep an effect that is not named, with the reason."""
        self.leads[t.name] = Lead(t.name, t.gain, t.blocks.t, reason, t.blocks.n)


def diagnose_fmu(
    model: FmuPlant,
    logs: Sequence[Log],
    holdout: Sequence[Log] = (),
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    progress: Callable[[float, str], None] | None = None,
) -> FmuDiagnosis:
    """Find which effects an FMU lacks; see :func:`~hovercontrol.identification.diagnose.diagnose.diagnose`.

    Raises
    ------
    InputError
        If a log does not fit the FMU, a name is unknown, or the FMU cannot be run.
    """
    report = progress or (lambda part, what: None)
    rows = trials_of(model, logs)
    if max_effects < 1:
        raise InputError(f"max_effects: expected 1 or more, found {max_effects}")
    done = [0]

    def said(what: str) -> None:
        done[0] += 1
        report(0.9 * done[0] / (5 + done[0]), what)

    search = _Search(_wanted(model, rows, names), said)
    with threadpool_limits(1, "blas"):
        base = fit_fmu(model, rows, said)
        now, named = base, list[_Tried]()
        while len(named) < max_effects:
            step = _step(search, now)
            if step is None:
                break
            now = completed(step.fit)
            named.append(step)
        now, named = _confirmed(search, base, now, named)
        said("predicting the held-out logs")
        before = {log.name: held_out(base.model, log) for log in holdout}
        now, named, after = _held(search, base, now, named, holdout, before)
        effects = tuple(_named(search, t, now) for t in named)
    signals = (*model.outputs, *model.states)
    channels = [signals[i].name for i in rows[0].places]
    remains = tuple(c for c, told in zip(channels, now.whitening.coloured, strict=True) if told)
    report(1.0, "done")
    return FmuDiagnosis(
        verdict(bool(effects), any(e.rivals for e in effects), bool(remains)),
        effects,
        tuple(sorted(search.leads.values(), key=lambda lead: -lead.gain)),
        model,
        now.model,
        dict(zip(channels, base.rms.tolist(), strict=True)),
        dict(zip(channels, now.rms.tolist(), strict=True)),
        remains,
        {name: shares_of(fit) for name, fit in before.items()},
        {name: shares_of(fit) for name, fit in after.items()},
        base,
        now,
        tuple(search.trace),
    )


def _wanted(model: FmuPlant, rows: Sequence[Rows], names: Sequence[str] | None) -> set[str] | None:
    if names is None:
        return None
    known = candidates(model, rows)
    every = {n for c in known for n in (c.name, c.cls.name)}
    for name in names:
        check_known(name, every, f"unknown effect {name!r}")
    return {c.name for c in known if {c.name, c.cls.name} & set(names)}


def _step(search: _Search, fit: FmuFit) -> _Tried | None:
    """Return the likeliest further effect that passes all tests; None if there is none."""
    tried = []
    for _, candidate, begin in search.best(fit):
        trial = search.fit(fit, candidate, begin)
        if trial is not None and search.passes(_Tried(candidate, fit, trial)):
            tried.append(_Tried(candidate, fit, trial))
    if not tried:
        return None
    best = min(tried, key=lambda t: CRITERIA.penalised(t.fit))
    for t in tried:  # a late command in place of a late clock, of which a log's first values are not known
        twins = best.candidate.tried[0].twin(t.candidate.tried[0])
        near = CRITERIA.penalised(t.fit) - CRITERIA.penalised(best.fit) < CRITERIA.apart
        best = t if twins and near and t.candidate.place == "before" else best
    return best


def _less(base: FmuFit, final: FmuFit, out: Sequence[_Tried], named: Sequence[_Tried]) -> FmuFit:
    """Return the fit without some of the named effects."""
    return base if len(out) == len(named) else without(final, [t.candidate for t in out])


def _confirmed(
    search: _Search, base: FmuFit, final: FmuFit, named: list[_Tried]
) -> tuple[FmuFit, list[_Tried]]:
    """Return the effects that pass all tests with the others in the model.

    The one that brings least of those that fail is taken out, and the others are tested again.
    """
    while named:
        own = [_Tried(t.candidate, _less(base, final, [t], named), final) for t in named]
        poor = [t for t in own if not search.passes(t)]
        if not poor:
            return final, own
        least = min(poor, key=lambda t: t.gain)
        final, named = least.less, [t for t in own if t is not least]
    return base, []


def _held(
    search: _Search,
    base: FmuFit,
    final: FmuFit,
    named: list[_Tried],
    holdout: Sequence[Log],
    before: Mapping[str, FmuFit],
) -> tuple[FmuFit, list[_Tried], Mapping[str, FmuFit]]:
    """Return the effects with which the held-out logs are not predicted significantly worse."""
    if not (named and holdout):
        return final, named, before
    after, worse = {log.name: held_out(final.model, log) for log in holdout}, list[_Tried]()
    for t in named:
        alone = len(named) == 1
        less = before if alone else {log.name: held_out(t.less.model, log) for log in holdout}
        falls = [_fall(less[name], after[name]) for name in after]
        rule = "t of the fall of held-out errors, at least"
        good = float(np.mean(falls)) >= -CRITERIA.worse
        search.trace.append(Decision("hold out", t.name, rule, float(np.mean(falls)), -CRITERIA.worse, good))
        if not good:
            search.lead(t, "the held-out logs are predicted worse with it")
            worse.append(t)
    if not worse:
        return final, named, after
    final = _less(base, final, worse, named)
    final, named = _confirmed(search, base, final, [t for t in named if t not in worse])
    return final, named, {log.name: held_out(final.model, log) for log in holdout}


def _fall(less: FmuFit, more: FmuFit) -> float:
    """Return the fall of squared errors on a log, in standard errors over its blocks."""
    count = len(more.block_log)
    errors = [np.concatenate(fit.residuals) for fit in (less, more)]
    block = np.repeat(np.arange(count), [len(b) for b in np.array_split(errors[0], count)])
    return fall_of_errors(errors[0], errors[1], block)


def _named(search: _Search, t: _Tried, final: FmuFit) -> FmuNamed:
    """Return a named effect with its numbers in the final fit, and the effects that may stand for it.

    A rival passes all tests in its place, and its penalised cost is higher by little or trails by few
    standard errors over blocks.
    """
    mine, rivals = t.candidate.tried[0], []
    every = candidates(final.model, final.unknowns.logs)
    same = tuple(c.name for c in every if mine.twin(c.tried[0]) and search.asked_for(c))
    for _, candidate, begin in search.best(t.less):
        if candidate.name in (t.name, *same):
            continue
        trial = search.fit(t.less, candidate, begin)
        if trial is None:
            continue
        behind, score = CRITERIA.penalised(trial) - CRITERIA.penalised(final), surely(trial, final)
        near = behind < CRITERIA.apart or score < CRITERIA.apart_t
        rule = f"behind {t.name} in its place, less than"
        search.trace.append(Decision("challenge", candidate.name, rule, behind, CRITERIA.apart, near))
        if near and search.passes(_Tried(candidate, t.less, trial)):
            rivals.append(candidate.name)
    numbers, std = numbers_of(final, t.candidate)
    c = t.candidate
    return FmuNamed(c.place, c.cls.name, numbers, std, t.gain, t.blocks, tuple(rivals), same)
