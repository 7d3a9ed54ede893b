"""Test of a selection on held-out logs: effects are dropped, and replaced by rivals that predict better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.holdout import Gained, Horizons, ahead, gained, held_fit
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.search.confirm import Rival, Selection
from hovercontrol.identification.diagnose.search.fit import Tried
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A selection after its test on the held-out logs.

    Attributes
    ----------
    selection : Selection
    evidence : dict of str to Evidence
    before, after : Fit or None
        Fits of the given and of the amended model to the held-out logs; None without such logs.
    far : Horizons
        Prediction errors of the two.
    """

    selection: Selection
    evidence: dict[str, Evidence]
    before: Fit | None = None
    after: Fit | None = None
    far: Horizons = field(default_factory=Horizons)


def held_out(
    selection: Selection,
    data: Data | None,
    criteria: Criteria = CRITERIA,
    trace: list[Decision] | None = None,
    earlier: HeldOut | None = None,
) -> HeldOut:
    """Return the part of a selection that stands on held-out logs, all of them judged together.

    - An effect is dropped if the logs are predicted significantly worse with it, unless their likelihood
      rises as significantly: errors seconds ahead are also small if other coefficients compensate for what
      is missing.
    - An effect that does not predict significantly better is replaced by an alternative that passed the same
      tests. The alternative must be at least as likely on these logs, and predict significantly better than
      the first effect and than neither.
    - If a remainder is left, so that the model is wrong in other ways too, an effect is dropped that the logs
      could show and do not. An effect that removes most of the error at one horizon counts as shown, however
      few events cause it.

    Parameters
    ----------
    selection : Selection
    data : Data, optional
        The held-out logs; None if there are none.
    criteria : Criteria, optional
    trace : list of Decision, optional
        Gets a row for each decision.
    earlier : HeldOut, optional
        Test of another selection on the same logs. Its fit of the given model is used again if that is the
        same.
    """
    trace = [] if trace is None else trace
    if data is None:
        return HeldOut(selection, {n: _of_training(selection, n) for n in selection.effects})
    same = earlier is not None and earlier.selection.base is selection.base
    before = earlier.before if earlier is not None and same else None
    before = before or _of_given(selection.base.model, data)
    found = _on(selection, before)
    instead = _better(found, criteria)
    if instead is not None:
        other = _on(_with_other(selection, *instead, _held(data)), before)
        replacement = other.evidence.get(instead[1].name)
        if replacement and _mean(replacement.holdout) > criteria.better:
            found = other
    while found.selection.effects:
        rows = _rows(found, criteria)
        trace.extend(rows)
        failed = [row.effect for row in rows if not row.passed]
        if not failed:
            break
        worse = [n for n in failed if _worse(found.evidence[n], criteria)]
        least = min(worse or failed, key=lambda n: _t(found.evidence[n].gained))
        own = found.evidence[least].gained
        reason = f"{_held(data)} {_verb(data, 'is')} predicted worse with it"
        if not worse and own is not None:
            said = f"{_held(data)} {_verb(data, 'does')} not confirm it"
            reason = f"{said} (gains {own.gain:.3g} there, t = {own.t:.1f})"
        several = len(found.selection.effects) > 2  # with two effects, the fits without each exist
        found = _left(found, _less(found.selection, [least], reason))
        if several:
            break
    return found


def _of_given(model: Subject, data: Data) -> Fit:
    """Return the fit of the given model to the held-out logs, which it must be able to follow."""
    try:
        return held_fit(model, data)
    except FloatingPointError as error:
        names = ", ".join(m.name for m in data.logs)
        where = "there a value may be impossible, or a state that is not measured far from its start value"
        raise InputError(f"{_held(data)} {names}: {error}: {where}") from error


def _held(data: Data) -> str:
    return "the held-out log" if len(data.logs) == 1 else "the held-out logs"


def _verb(data: Data, one: str) -> str:
    return one if len(data.logs) == 1 else {"is": "are", "does": "do"}[one]


def without(found: HeldOut, names: Sequence[str], reason: str) -> HeldOut:
    """Return a test of a selection from which effects are taken, each a lead with the reason.

    Parameters
    ----------
    found : HeldOut
    names : sequence of str
        One of the effects, or all.
    reason : str
    """
    left = _less(found.selection, list(names), reason)
    return _left(found, left) if found.before else HeldOut(left, {})


def _left(found: HeldOut, left: Selection) -> HeldOut:
    """Return the test of the effects left of a selection; a single effect is tested again."""
    before = found.before
    assert before is not None
    if len(left.effects) < 2:
        return _on(left, before)
    try:
        after = held_fit(left.final.model, before.problem.data, before)
    except FloatingPointError:
        return _on(left, before)
    evidence = {n: found.evidence[n] for n in left.effects}
    return HeldOut(left, evidence, before, after, ahead(before, after))


def _t(own: Gained | None) -> float:
    """Return t of the gain on the held-out logs, 0 without one."""
    return own.t if own else 0.0


def _on(selection: Selection, before: Fit) -> HeldOut:
    """Return the fits and errors on the held-out logs, with all effects and without each.

    A set whose model diverges on these logs is dropped.
    """
    try:
        return _fitted(selection, before)
    except FloatingPointError:
        reason = f"the model with it diverges on {_held(before.problem.data)}"
        return _fitted(_less(selection, list(selection.effects), reason), before)


def _fitted(selection: Selection, before: Fit) -> HeldOut:
    kept = before.problem.data
    after = held_fit(selection.final.model, kept, before) if selection.effects else before
    far = ahead(before, after)
    evidence = {}
    for name in selection.effects:
        own, less = far, before
        if len(selection.effects) > 1:
            less = held_fit(selection.without[name].model, kept, after)
            own = ahead(less, after)
        evidence[name] = replace(_of_training(selection, name), holdout=own, gained=gained(less, after))
    return HeldOut(selection, evidence, before, after, far)


def _of_training(selection: Selection, name: str) -> Evidence:
    return Evidence(selection.gains[name], selection.blocks[name])


def _rows(found: HeldOut, criteria: Criteria) -> list[Decision]:
    """Return the rows of the named effects: predicted no worse with it, and shown if something else remains.

    Each row holds the number that decides.
    """
    left = not only_noise(found.selection.final, criteria)
    rows = []
    for name, e in found.evidence.items():
        worse = _worse(e, criteria)
        rule = "t of the fall of held-out errors at most horizons, at least"
        value, limit = _at_most_horizons(e.holdout), -criteria.worse
        if value < limit and not worse:
            rule, value, limit = "t of the gain on held-out logs, over", _t(e.gained), criteria.worse
        rows.append(Decision("hold out", name, rule, value, limit, not worse))
        if left and e.gained is not None:
            rows.append(_shown(name, e, e.gained, criteria))
    return rows


def _shown(name: str, e: Evidence, own: Gained, criteria: Criteria) -> Decision:
    """Return whether the held-out logs show an effect or could not; the first test that it passes, if any."""
    taken, unseen = max(e.holdout.taken, default=0.0), own.scatter <= criteria.visible
    rows = [
        Decision("hold out", name, rule, value, limit, value >= limit)
        for rule, value, limit in (
            ("t of the gain on held-out logs, at least", own.t, criteria.confirmed),
            ("mean t of the fall of held-out errors, at least", _mean(e.holdout), criteria.better),
            ("fraction of the held-out error that it removes, at least", taken, criteria.most),
        )
    ]
    rule = "standard error of the gain up to which held-out logs cannot judge"
    rows.append(Decision("hold out", name, rule, own.scatter, criteria.visible, unseen))
    return next((row for row in rows if row.passed), rows[0])


def _worse(own: Evidence, criteria: Criteria) -> bool:
    """Whether predictions are significantly worse at most horizons and the log not significantly likelier."""
    return _at_most_horizons(own.holdout) < -criteria.worse and not _t(own.gained) > criteria.worse


def _at_most_horizons(far: Horizons) -> float:
    """Return the largest value below which t lies at more than half of the horizons."""
    return sorted(far.together)[len(far.together) // 2] if far.together else 0.0


def _better(found: HeldOut, criteria: Criteria) -> tuple[str, Tried] | None:
    """Return an effect that does not predict significantly better, and the replacement that predicts best."""
    after = found.after
    assert after is not None
    gains: list[tuple[float, str, Tried]] = []
    for name, other in found.selection.alternatives:
        own = found.evidence[name].holdout
        if not own.together or _mean(own) > criteria.better:
            continue
        try:
            there = held_fit(other.fit.model, after.problem.data, after)
        except FloatingPointError:
            continue
        if there.cost > after.cost:
            continue
        gained = round(_mean(ahead(after, there)), 1)
        if gained > criteria.better:
            gains.append((gained, name, other))
    return max(gains, key=lambda g: g[0])[1:] if gains else None


def _mean(far: Horizons) -> float:
    return float(np.mean(far.together)) if far.together else 0.0


def _with_other(selection: Selection, name: str, other: Tried, held: str = "the held-out log") -> Selection:
    """Return the selection with one effect replaced by another."""
    reason = f"{other.name} predicts {held} better"
    lead = Lead(name, selection.gains[name], selection.blocks[name].t, reason)
    names = {n: other.name if n == name else n for n in selection.effects}
    late = [t for of, t in selection.alternatives if of == name and t.effect.twin(other.effect)]
    return replace(
        selection,
        final=other.fit,
        effects=tuple(names.values()),
        gains={names[n]: v for n, v in selection.gains.items()} | {other.name: other.gain},
        blocks={names[n]: v for n, v in selection.blocks.items()} | {other.name: other.blocks},
        without={names[n]: v for n, v in selection.without.items()},
        rivals=(
            *(r for r in selection.rivals if name not in (r.instead_of, r.name)),
            *(Rival(t.name, other.name, 0.0, 0.0, other.fit, True) for t in late),
        ),
        leads=(lead, *(one for one in selection.leads if one.name != other.name)),
    )


def _less(selection: Selection, worse: list[str], reason: str) -> Selection:
    """Return the selection without the effects that the held-out logs contradict."""
    blocks = selection.blocks
    leads = tuple(Lead(n, selection.gains[n], blocks[n].t, reason, blocks[n].n) for n in worse)
    alone = len(worse) == 1
    left = tuple(n for n in selection.effects if n not in worse) if alone else ()
    return replace(
        selection,
        effects=left,
        final=selection.without[worse[0]] if alone else selection.base,
        rivals=tuple(r for r in selection.rivals if r.instead_of in left),
        alternatives=tuple(a for a in selection.alternatives if a[0] in left),
        leads=(*leads, *selection.leads),
    )
