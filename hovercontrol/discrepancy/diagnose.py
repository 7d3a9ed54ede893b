"""Find where model and measurement disagree, name the missing effect, add it, show the gap shrink."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.discrepancy.checks import check_excitation, check_logs
from hovercontrol.discrepancy.data import gather
from hovercontrol.discrepancy.diagnosis import Diagnosis, numbers_of
from hovercontrol.discrepancy.experiment import BADLY, Experiment, only_late, same_time, separate, sharpen
from hovercontrol.discrepancy.fit import TINY, Fit, fit, noise_of
from hovercontrol.discrepancy.gains import held_back
from hovercontrol.discrepancy.holdout import gap, gap_of
from hovercontrol.discrepancy.ladder import ladder, paced, rungs
from hovercontrol.discrepancy.laws import regime
from hovercontrol.discrepancy.levels import unlike
from hovercontrol.discrepancy.localize import localize
from hovercontrol.discrepancy.navigation import Navigated
from hovercontrol.discrepancy.outliers import cleaned, left_out
from hovercontrol.discrepancy.probes import probe
from hovercontrol.discrepancy.select import select
from hovercontrol.discrepancy.selection import Rival, Selection
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.verdict import signs_against, stopped, verdict_of
from hovercontrol.discrepancy.weighing import less
from hovercontrol.errors import InputError
from hovercontrol.logs import Log

#: chi2 per degree of freedom from which on probes for the unknown are worth their time.
PROBED = 1.04


def diagnose(
    model: Subject,
    logs: Sequence[Log],
    holdout: Log | None = None,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> Diagnosis:
    """Find what a model lacks.

    Parameters
    ----------
    model : Model or BlockModel
        Its coefficients may be off: all are fitted again.
    logs : sequence of Log
        Measured; with the model's inputs, and pose, body velocities or both.
    holdout : Log, optional
        A log that takes no part, on which the gap is shown.
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
        Most effects that are added.
    seed : int, optional
        Of the manoeuvres drawn at random among those from which the next experiment is chosen: all that is
        random here.
    progress : callable, optional
        Called with the part done (0 to 1) and a word on what is being done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If there is no log, or one from which nothing right can follow (:func:`.checks.check_logs`).

    Examples
    --------
    >>> import numpy as np
    >>> from hovercontrol.effects import effect
    >>> from hovercontrol.vehicles import c17_simulation
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.05)
    >>> truth = c17_simulation().with_effects([effect("slope", x=0.1)])
    >>> thrust, rudder = np.repeat(rng.uniform(1, 4, 20), 20), np.repeat(rng.uniform(-0.4, 0.4, 20), 20)
    >>> run = truth.plant().compile(friction="smooth").simulate(t, [thrust, rudder])
    >>> seen = {k: y + 1e-3 * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs)}
    >>> found = diagnose(c17_simulation(), [Log("demo", t, {**seen, "thrust": thrust, "rudder": rudder})])
    >>> found.verdict, [e.effect for e in found.effects][:1]
    ('effect', ['slope'])
    """
    if not logs:
        raise InputError("diagnosis needs at least one log")
    with threadpool_limits(1, "blas"):  # its threads would wait for each other at many small matrices
        return _diagnosed(
            model, logs, holdout, names, max_effects, seed, progress or (lambda part, what: None)
        )


def _diagnosed(
    model: Subject,
    logs: Sequence[Log],
    holdout: Log | None,
    names: Sequence[str] | None,
    max_effects: int,
    seed: int,
    tell: Callable[[float, str], None],
) -> Diagnosis:
    warnings = check_logs(model, logs, holdout)
    tell(0.0, "reading what was measured")
    data, told = paced(model, gather(model, logs))
    given = data
    warnings += [f"{m.name}: {m.drift}" for m in data.logs if isinstance(m, Navigated)]
    warnings += unlike(data.channels, data.scales)
    warnings += check_excitation(told, data)
    selection = select(model, data, names=names, max_effects=max_effects, tell=tell)
    _finish(model, selection)
    final = selection.final
    warnings += held_back(final, model)
    data = final.windowed.data
    tell(0.88, "looking for what is not in the catalogue")
    doubtful = selection.process or final.chi2_per_dof > PROBED
    signs = tuple(probe(final)) if doubtful else ()
    tell(0.92, "measuring the gap")
    length = ladder(data)[:2][-1]
    like = (final.windowed.length, final.noise) if selection.process else (length, None)
    bare = fit(selection.base.model, data, *like, prior_model=model) if selection.effects else final
    held, out = None, left_out(logs, given, data)
    if holdout is not None:
        as_read = gather(model, [holdout])
        held = cleaned(final.model, as_read, rungs(model, data)[:2])
        out += left_out([holdout], as_read, held, held_out=True)
    before = gap(bare.model, held, length) if held else None
    after = gap(final.model, held, length) if held and final is not bare else before
    signs += signs_against(selection, held, length, before, after)
    verdict = verdict_of(selection, signs)
    named = verdict in ("effect", "ambiguous")
    warnings += stopped(selection, names, max_effects) if verdict == "unexplained" else []
    tell(0.96, "looking where it is")
    plain = not selection.process and bare.windowed.length <= length
    alone = bare if plain else fit(bare.model, data, length, near=bare, frozen=True)
    near = alone  # without process noise, in windows short enough to see when
    if named:  # fitted without the effects the other coefficients would hide what they do
        near = fit(less(final.model, *selection.effects), data, length, frozen=True)
    elif selection.process:
        near = fit(bare.model, data, length, prior_model=model)
    noise = noise_of(near, rough=True)
    missing = tuple(localize(near, noise))
    experiment, advice = _next(selection, seed) if named else (None, "")
    amended = final if named or verdict == "none" else bare
    train_before = gap_of(alone)
    train_after = gap(final.model, data, length) if amended is not bare else train_before
    found = Diagnosis(
        verdict=verdict,
        effects=numbers_of(final, selection.effects) if named else (),
        rivals=tuple(selection.rivals) if named else (),
        signs=signs,
        model=model,
        amended=amended.model,
        refitted=bare.model,
        before=before,
        after=after if named or verdict == "none" else before,
        train_before=train_before,
        train_after=train_after,
        selection=selection,
        noise=noise,
        missing=missing,
        regime=regime(missing),
        rows_dropped=sum(int((~np.isfinite(m.values)).any(axis=0).sum()) for m in data.logs),
        warnings=tuple(warnings),
        experiment=experiment,
        advice=advice,
        rival_gaps={r.name: gap(r.model, held, length) for r in selection.rivals} if named and held else {},
        held=held,
        left_out=out,
    )
    tell(1.0, "done")
    return found


def _finish(model: Subject, selection: Selection) -> None:
    """Fit once more, less what stands out beside the amended model: what the given one lacks is as steep.

    The amended model is fitted to the very end: widths of friction may lie in flat valleys.
    """
    base, final = selection.base, selection.final
    data = final.windowed.data
    clean = cleaned(final.model, data, rungs(model, data)[:2]) if selection.effects else data
    if clean is not data:
        selection.base = fit(
            base.model, clean, base.windowed.length, base.noise, prior_model=model, near=base
        )
    selection.final = fit(
        final.model, clean, final.windowed.length, final.noise, prior_model=model, near=final, small=TINY
    )


def _next(selection: Selection, seed: int) -> tuple[Experiment | None, str]:
    """Return what to drive next, and a sentence on it."""
    final = selection.final
    if selection.rivals:
        apart = [r for r in selection.rivals if not _both_late(final, r)]
        if not apart:
            return None, same_time((selection.rivals[0].instead_of, selection.rivals[0].name))
        rival = apart[0]
        found = separate(final, final.model, rival.model, (rival.instead_of, rival.name), seed=seed)
        return (None, found) if isinstance(found, str) else (found, found.text)
    numbers = [n for n in numbers_of(final, selection.effects) if abs(n.std) > BADLY * abs(n.value)]
    if not numbers:
        return None, ""
    worst = max(numbers, key=lambda n: abs(n.std) / max(abs(n.value), 1e-12))
    sharper = sharpen(final, worst.parameter, seed=seed)
    return sharper, sharper.text if sharper else ""


def _both_late(final: Fit, rival: Rival) -> bool:
    """Tell whether an effect and its rival only say how late something is, which every log shows alike."""
    named = any(e.name == rival.instead_of for e in final.model.effects)
    return named and only_late(final.model, rival.instead_of) and only_late(rival.model, rival.name)
