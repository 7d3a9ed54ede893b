"""Diagnosis of a model against logs: missing effects, their share of the error, and the remainder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import overload

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.base.arguments import at_least
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.identification.diagnose.checks import as_logs, check_fitted, check_logs
from hovercontrol.identification.diagnose.checks.stand_ins import origins, switched_off
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.diagnosis import Diagnosis, numbers_of
from hovercontrol.identification.diagnose.evidence.holdout import gap
from hovercontrol.identification.diagnose.evidence.laws import regime
from hovercontrol.identification.diagnose.evidence.remainder import missing_forces, remainders
from hovercontrol.identification.diagnose.evidence.sensors import slow_errors
from hovercontrol.identification.diagnose.experiment.predict import Search
from hovercontrol.identification.diagnose.experiment.propose import next_experiment
from hovercontrol.identification.diagnose.fmu import diagnose_fmu
from hovercontrol.identification.diagnose.fmu_diagnosis import FmuDiagnosis
from hovercontrol.identification.diagnose.laws.local import with_functions
from hovercontrol.identification.diagnose.laws.scan import yardsticks
from hovercontrol.identification.diagnose.laws.search import with_laws
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.candidates import left_out
from hovercontrol.identification.diagnose.search.fit import Made
from hovercontrol.identification.diagnose.search.searched import searched
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.diagnose.unknown.forms import likeliest, named_forms, rivals_of
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.diagnose.unknown.tables import constants, tabulated, with_constants
from hovercontrol.identification.diagnose.verdict import verdict_of
from hovercontrol.identification.engine.data import Data, gather
from hovercontrol.identification.engine.feedback import fed_back
from hovercontrol.identification.engine.fit import Fit, scored
from hovercontrol.identification.engine.subject import Subject, named, unknowns, with_known_period
from hovercontrol.logs import Log


@overload
def diagnose(
    model: AnyModel,
    logs: Sequence[Log],
    holdout: Log | Sequence[Log] | None = None,
    *,
    fixed: Sequence[str] = (),
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> Diagnosis: ...


@overload
def diagnose(
    model: FmuPlant,
    logs: Sequence[Log],
    holdout: Log | Sequence[Log] | None = None,
    *,
    fixed: Sequence[str] = (),
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> FmuDiagnosis: ...


@checked
def diagnose(
    model: AnyModel | FmuPlant,
    logs: Sequence[Log],
    holdout: Log | Sequence[Log] | None = None,
    *,
    fixed: Sequence[str] = (),
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> Diagnosis | FmuDiagnosis:
    """Find which effects a model lacks, how much of the error they explain, and what remains.

    An effect is named if it raises the likelihood under process noise and no held-out log is predicted worse
    with it. If a remainder is left, it must also have the same coefficient on disjoint blocks; where too few
    blocks inform on it, the held-out logs must show it by themselves. A remainder does not withdraw a name:
    it is measured, and the verdict is ``"partial"`` (:func:`.verdict.verdict_of`).

    Parameters
    ----------
    model : Model, BlockModel, Block or FmuPlant
        Its parameters may be wrong: all are fitted. For a Block, the effects that any machine may have are
        considered, as for a BlockModel without a catalogue. For an FMU (:func:`hovercontrol.fmu_plant`), all
        before its inputs and after its outputs (:mod:`hovercontrol.identification.diagnose.fmu`).
    logs : sequence of Log
        Measured logs. They need the model's inputs and, for a craft, pose, body velocities or both; for any
        other machine, some of its outputs or states.
    holdout : Log or sequence of Log, optional
        Logs held out of the fit, judged together. An effect is dropped if they are predicted worse with it
        and are not likelier.
    fixed : sequence of str, optional
        Parameters of the model that keep their values: a known gravity, a mass that was weighed, the period
        of a sampled Block.
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
        Maximum number of effects to add.
    seed : int, optional
        Seed of the random manoeuvres among those from which the next experiment is chosen. Nothing else is
        random.
    progress : callable, optional
        Called with the fraction done (0 to 1) and a message.

    Returns
    -------
    Diagnosis, or of an FMU :class:`~hovercontrol.identification.diagnose.fmu_diagnosis.FmuDiagnosis`

    Raises
    ------
    InputError
        If there is no log, a log fails the checks (:func:`.checks.check_logs`), or the seed is negative.

    Examples
    --------
    >>> import numpy as np
    >>> from hovercontrol.craft.effects import effect
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.05)
    >>> truth = c17_simulation().with_effects([effect("slope", x=0.1)])
    >>> thrust, rudder = np.repeat(rng.uniform(1, 4, 20), 20), np.repeat(rng.uniform(-0.4, 0.4, 20), 20)
    >>> run = truth.plant().compile(friction="smooth").simulate(t, [thrust, rudder])
    >>> seen = {k: y + 1e-3 * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs)}
    >>> found = diagnose(c17_simulation(), [Log("demo", t, {**seen, "thrust": thrust, "rudder": rudder})])
    >>> found.verdict, [e.effect for e in found.effects][:1]
    ('effect', ['slope'])
    """
    at_least("diagnose: seed", seed)
    if not logs:
        raise InputError("diagnosis needs at least one log")
    held = as_logs(holdout)
    report = progress or (lambda part, what: None)
    if isinstance(model, FmuPlant):
        model = replace(model, fit=tuple(name for name in model.fit if name not in fixed))
        return diagnose_fmu(model, logs, held, names, max_effects, report)
    subject, assumed = with_known_period(as_model(model), None, fixed)
    kept = named(subject, fixed)
    with threadpool_limits(1, "blas"):  # with many small matrices its threads would wait for each other
        return _diagnosed(subject, assumed, logs, held, kept, names, max_effects, seed, report)


def _diagnosed(
    model: Subject,
    assumed: Sequence[str],
    logs: Sequence[Log],
    holdout: Sequence[Log],
    fixed: Sequence[str],
    names: Sequence[str] | None,
    max_effects: int,
    seed: int,
    report: Callable[[float, str], None],
) -> Diagnosis:
    report(0.0, "reading the measurements")
    computed = with_constants(model)
    warnings = [*assumed, *left_out(computed, names), *check_logs(computed, logs, holdout)]
    data = gather(computed, logs)
    model, functions = _filled(model, data, fixed, report)
    free = [name for name in unknowns(model) if name not in fixed]
    report(0.05, "fitting the model as it is")
    try:
        base = base_fit(model, data, free)
        fed = fed_back(base, CRITERIA.level)
        if fed:  # segments that begin anew, and noise levels by turns, would bias what feedback ties together
            base = base_fit(model, data.joined, free)
            base = scored(base, base.prior)
    except FloatingPointError as error:
        raise InputError(f"{model.name!r}: {error}: try other start values") from error
    warnings += check_fitted(base)
    done = [0]

    def said(what: str) -> None:
        done[0] += 1
        report(0.1 + 0.7 * (1 - 0.85 ** done[0]), what)

    kept = gather(model, holdout) if holdout else None
    kept = kept.joined if kept and fed else kept
    trace: list[Decision] = []
    made: Made = []
    held = searched(
        base, model, kept, names=names, max_effects=max_effects, report=said, trace=trace, made=made
    )
    if names is None:
        held = with_laws(held, model, kept, max_effects=max_effects, report=said, trace=trace, made=made)
        held = with_functions(held, model, kept, report=said, trace=trace)
    selection = held.selection
    report(0.92, "measuring the remainder")
    base, final = selection.base, selection.final  # a search may find a likelier fit of the given model
    remains = remainders(base, final)
    slow = slow_errors(final)
    verdict = verdict_of(selection, [*remains, *slow], open_=any(rivals_of(f) for f in functions))
    effects = numbers_of(final, selection.effects)
    report(0.96, "searching for the next experiment")
    lacking = [r.equation.removesuffix("'") for r in remains if r.there]
    tellable = yardsticks(final, lacking)
    experiment, advice = next_experiment(selection, effects, functions, lacking, Search(seed))
    warnings += switched_off(model, final.model, selection.effects)
    warnings += origins(model, selection.effects)
    missing = missing_forces(base)
    train_before = gap(base)
    before = gap(held.before) if held.before else None
    found = Diagnosis(
        verdict=verdict,
        effects=effects,
        rivals=selection.rivals,
        evidence=held.evidence,
        remainders=remains,
        slow_errors=slow,
        leads=selection.leads,
        yardsticks=tellable,
        functions=functions,
        model=model,
        amended=final.model,
        refitted=base.model,
        before=before,
        after=gap(held.after) if held.after else None,
        ahead=held.far.each,
        train_before=train_before,
        train_after=gap(final) if selection.effects else train_before,
        selection=selection,
        held_before=held.before,
        held_after=held.after,
        missing=missing,
        missing_after=missing_forces(final) if selection.effects else missing,
        regime=regime(missing) if verdict != "none" else "nowhere beyond the noise",
        rows_dropped=_dropped(data, base),
        rows_down_weighted=int(base.problem.data.down_weighted.any(axis=2).sum()),
        warnings=tuple(warnings),
        experiment=experiment,
        advice=advice,
        trace=tuple(trace),
    )
    report(1.0, "done")
    return found


def _filled(
    model: Subject, data: Data, fixed: Sequence[str], report: Callable[[float, str], None]
) -> tuple[Subject, tuple[FittedFunction, ...]]:
    """Return a model with the likeliest form in place of each unknown function, and these functions."""
    if not isinstance(model, BlockModel) or not constants(model):
        return model, ()
    names = [name for name in unknowns(model) if name not in fixed]
    try:
        fit, tables = tabulated(model, data.joined, names, lambda what: report(0.02, what))
    except FloatingPointError as error:
        raise InputError(f"{model.name!r}: {error}: try other start values") from error
    functions = named_forms(model, fit, tables, lambda what: report(0.03, what))
    return likeliest(model, functions, tables), functions


def _dropped(data: Data, fit: Fit) -> int:
    """Return the number of rows with a sample left out, by the reader or as an outlier."""
    out = (np.isfinite(data.rows.values) & ~fit.problem.seen).any(axis=2)
    return int(out.sum()) + sum(span.rows for m in data.logs for span in m.rejected)
