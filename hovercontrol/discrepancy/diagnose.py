"""Find where model and measurement disagree, name the missing effect, add it, show the gap shrink."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.discrepancy.candidates import Scores, Signatures, candidates
from hovercontrol.discrepancy.checks import check_excitation, check_logs
from hovercontrol.discrepancy.experiment import BADLY, Experiment, only_late, same_time, separate, sharpen
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.holdout import Gap, gap, gap_of
from hovercontrol.discrepancy.ladder import ladder, paced, rungs
from hovercontrol.discrepancy.laws import regime, worst
from hovercontrol.discrepancy.localize import Missing, localize
from hovercontrol.discrepancy.navigation import Navigated
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.outliers import LeftOut, cleaned, left_out
from hovercontrol.discrepancy.probes import Sign, probe
from hovercontrol.discrepancy.select import EACH, EXPLAINED, LEAST, Rival, Selection, noise_of, select
from hovercontrol.discrepancy.windowed import Data, Subject, gather
from hovercontrol.errors import InputError
from hovercontrol.files import write_whole
from hovercontrol.logs import Log
from hovercontrol.model import Model

Verdict = Literal["effect", "none", "ambiguous", "unexplained"]

#: chi2 per degree of freedom from which on probes for the unknown are worth their time.
PROBED = 1.04

#: Rise of twice the negative log likelihood on the hold-out log that no effect survives.
VETO = 12.0


@dataclass(frozen=True)
class Found:
    """One number of an effect that was added.

    Attributes
    ----------
    effect, parameter : str
        ``"slope"``, ``"slope_x"``.
    acts_in : str
        Where it acts: ``"u' v'"``, ``"thrust"``, ``"measured r"``.
    value, std : float
        Estimate and its standard error.
    unit : str
    """

    effect: str
    parameter: str
    acts_in: str
    value: float
    std: float
    unit: str

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a model lacks, with the evidence.

    Attributes
    ----------
    verdict : {"effect", "none", "ambiguous", "unexplained"}
    effects : tuple of Found
        Numbers of the effects that are named; empty if the verdict is not to name any.
    rivals : tuple of Rival
        Effects that these logs cannot tell from named ones.
    signs : tuple of Sign
        Of something that is not in the catalogue.
    model, amended : Model
        As given; with the named effects and all coefficients fitted.
    refitted : Model
        As given, its coefficients fitted like those of `amended`.
    before, after : Gap or None
        On the hold-out log, of `refitted` and `amended`.
    rival_gaps : dict of str to Gap
        On the hold-out log, by name, of the model with a rival in the place of what it rivals.
    held : Data or None
        The hold-out log as it was used: without what stands out.
    left_out : tuple of LeftOut
        Samples that were not used, by log (the hold-out log last), channel and reason.
    train_before, train_after : Gap
        On the training logs.
    selection : Selection
        The search itself.
    noise : Noise
        What is missing, taken as process noise.
    missing : tuple of Missing
        The force that the given model lacks, by log and equation: where effects are named, with the
        coefficients of `amended`; else with those of `refitted`.
    regime : str
        In words, where that force is.
    rows_dropped : int
        Rows of the training logs of which a sample was left out.
    warnings : tuple of str
        About the logs, one line each.
    experiment : Experiment or None
        What to drive next, where that would settle an ambiguous case or tell a coefficient better.
    advice : str
        That in one sentence, or why there is no such experiment; empty where none is wanted.
    """

    verdict: Verdict
    effects: tuple[Found, ...]
    rivals: tuple[Rival, ...]
    signs: tuple[Sign, ...]
    model: Subject
    amended: Subject
    refitted: Subject
    before: Gap | None
    after: Gap | None
    train_before: Gap
    train_after: Gap
    selection: Selection
    noise: Noise
    missing: tuple[Missing, ...]
    regime: str
    rows_dropped: int
    warnings: tuple[str, ...] = ()
    experiment: Experiment | None = None
    advice: str = ""
    rival_gaps: dict[str, Gap] = field(default_factory=dict)
    held: Data | None = None
    left_out: tuple[LeftOut, ...] = ()

    def missing_after(self) -> tuple[Missing, ...]:
        """Return the force that the amended model still lacks on the training logs."""
        data = self.selection.final.windowed.data
        near = fit(self.amended, data, ladder(data)[:2][-1], frozen=True)
        return tuple(localize(near, self.noise.like(len(near.windowed.free))))

    def result(self) -> dict[str, Any]:
        """Return what ``result.json`` holds."""
        held = self.before is not None and self.after is not None
        names = dict.fromkeys(e.effect for e in self.effects)
        numbers = {name: [e for e in self.effects if e.effect == name] for name in names}
        return {
            "verdict": self.verdict,
            "effects": [
                {
                    "name": name,
                    "equation": own[0].acts_in,
                    "coefficient": own[0].value,
                    "std": own[0].std,
                    "unit": own[0].unit,
                    "numbers": {e.parameter: {"value": e.value, "std": e.std, "unit": e.unit} for e in own},
                }
                for name, own in numbers.items()
            ],
            "rivals": [
                {
                    "name": r.name,
                    "reason": f"instead of {r.instead_of}: behind by {r.behind:.1f} in twice the log "
                    f"likelihood; correlation of signatures {r.correlation:.3f}",
                }
                for r in self.rivals
            ],
            "gap": {
                "train": {"before": self.train_before.nrmse, "after": self.train_after.nrmse},
                "holdout": {
                    "before": self.before.nrmse if self.before else {},
                    "after": self.after.nrmse if self.after else {},
                    "floor": self.after.floor if self.after else {},
                }
                if held
                else {},
            },
            "where": self._where(),
            "signs": [{"kind": s.kind, "text": s.text, "gain": s.gain} for s in self.signs],
            "process_noise": self._process(),
            "next_experiment": self.advice or None,
            "rows_dropped": self.rows_dropped,
            "warnings": list(self.warnings),
        }

    def _where(self) -> dict[str, Any]:
        """Return in which equation, when (of the first log in which it shows) and in which regime."""
        most = worst(self.missing)
        if most is None or not most.segments:
            return {"equation": None, "segments": [], "regime": self.regime}
        return {
            "equation": most.equation,
            "log": most.log,
            "segments": [list(s) for s in most.segments],
            "regime": self.regime,
        }

    def _process(self) -> dict[str, float]:
        final = self.selection.final
        names = [final.windowed.block.states[i].name for i in final.windowed.free]
        return {f"{n}'": float(v) for n, v in zip(names, final.noise.process, strict=True) if v > 0}

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``result.json``, ``model.toml`` and, where there is one, ``next_experiment.csv``."""
        from hovercontrol.modelfile import save_model

        folder = Path(folder)
        text = json.dumps(_finite(self.result()), indent=2, allow_nan=False, default=float) + "\n"
        files = [write_whole(folder / "result.json", lambda path: path.write_text(text, encoding="utf-8"))]
        if isinstance(self.amended, Model):
            files.append(save_model(self.amended, folder / "model.toml"))
        if self.experiment:
            files.append(self.experiment.save(folder / "next_experiment.csv"))
        return files


def _finite(value: Any) -> Any:
    """Return a result with null where a number is not finite: JSON knows no NaN."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
    warnings += check_excitation(told, data)
    selection = select(model, data, names=names, max_effects=max_effects, tell=tell)
    _clean_again(model, selection)
    final = selection.final
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
        held = cleaned(final.model, as_read, rungs(model, data)[0])
        out += left_out([holdout], as_read, held, held_out=True)
    before = gap(bare.model, held, length) if held else None
    after = gap(final.model, held, length) if held and final is not bare else before
    signs += _slow(selection) + _weak(selection) + _veto(selection, before, after)
    verdict = _verdict(selection, signs)
    named = verdict in ("effect", "ambiguous")
    warnings += _stopped(selection, names, max_effects) if verdict == "unexplained" else []
    tell(0.96, "looking where it is")
    near = bare  # without process noise, in windows short enough to see when
    if named:  # fitted without the effects the other coefficients would hide what they do
        near = fit(_less(final.model, selection.effects), data, length, frozen=True)
    elif selection.process:
        near = fit(bare.model, data, length, prior_model=model)
    elif bare.windowed.length > length:
        near = fit(bare.model, data, length, prior_model=model, near=bare, frozen=True)
    noise = noise_of(near, rough=True)
    missing = tuple(localize(near, noise))
    experiment, advice = _next(selection, seed) if named else (None, "")
    amended = final if named or verdict == "none" else bare
    plain = not selection.process and bare.windowed.length <= length
    train_before = gap_of(bare) if plain else gap(bare.model, data, length)
    train_after = gap(final.model, data, length) if amended is not bare else train_before
    found = Diagnosis(
        verdict=verdict,
        effects=_numbers(final, selection.effects) if named else (),
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


def _clean_again(model: Subject, selection: Selection) -> None:
    """Leave out what stands out beside the amended model only: what the given one lacks is as steep."""
    base, final = selection.base, selection.final
    if not selection.effects:
        return
    data = final.windowed.data
    clean = cleaned(final.model, data, rungs(model, data)[0])
    if clean is not data:
        selection.final = fit(
            final.model, clean, final.windowed.length, final.noise, prior_model=model, near=final
        )
        selection.base = fit(
            base.model, clean, base.windowed.length, base.noise, prior_model=model, near=base
        )


def _less(model: Subject, names: Sequence[str]) -> Subject:
    """Return a model without some of its effects, all else as it is."""
    return replace(model, effects=tuple(e for e in model.effects if e.name not in names))


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
    numbers = [n for n in _numbers(final, selection.effects) if abs(n.std) > BADLY * abs(n.value)]
    if not numbers:
        return None, ""
    worst = max(numbers, key=lambda n: abs(n.std) / max(abs(n.value), 1e-12))
    sharper = sharpen(final, worst.parameter, seed=seed)
    return sharper, sharper.text if sharper else ""


def _both_late(final: Fit, rival: Rival) -> bool:
    """Tell whether an effect and its rival only say how late something is, which every log shows alike."""
    named = any(e.name == rival.instead_of for e in final.model.effects)
    return named and only_late(final.model, rival.instead_of) and only_late(rival.model, rival.name)


def _stopped(selection: Selection, names: Sequence[str] | None, max_effects: int) -> list[str]:
    """Return a warning if it was the limit on effects that ended the search."""
    if len(selection.effects) < max_effects:
        return []
    final = selection.final
    best = Scores(final, Signatures(final, candidates(final, names))).best()
    bar = 1.0 if selection.process else max(1.0, final.chi2_per_dof)
    more = [s.gain for s in best if s.allowed and s.gain > bar * (LEAST + EACH * len(s.candidate.amplitudes))]
    if not more:
        return []
    count = f"{max_effects} effect{'s' if max_effects > 1 else ''}"
    return [
        f"stopped at {count} (--max-effects {max_effects}): another would take {max(more):.3g} more from "
        "twice the negative log likelihood; allow more effects"
    ]


def _slow(selection: Selection) -> tuple[Sign, ...]:
    """Return a sign if long windows leave what short ones do not show."""
    if not selection.slow:
        return ()
    text = (
        f"stretches of {selection.final.windowed.length:g} s are explained, longer ones are not: something "
        "small that lasts is missing"
    )
    count = int(selection.final.windowed.seen.sum())
    return (Sign("slow", text, (selection.slow - 1.0) * count, 1),)


def _weak(selection: Selection) -> tuple[Sign, ...]:
    """Return a sign if the logs want an effect whose size they do not tell: another may be meant."""
    return tuple(
        Sign("weak", f"{name} would take some of the misfit, but these logs do not tell its size", gain, 1)
        for name, gain in selection.gains.items()
        if name in selection.effects and gain < LEAST
    )


def _veto(selection: Selection, before: Gap | None, after: Gap | None) -> tuple[Sign, ...]:
    """Return a sign if the amended model is worse on the hold-out log than the given one."""
    if not (selection.effects and before and after):
        return ()
    worse = after.chi2 - before.chi2
    if worse < VETO * max(1.0, after.chi2 / max(after.count, 1)):
        return ()
    names = " and ".join(selection.effects)
    text = f"{names} would fit the training logs, but the hold-out log is predicted worse with it"
    return (Sign("hold-out", text, worse, len(selection.effects)),)


def _verdict(selection: Selection, signs: Sequence[Sign]) -> Verdict:
    if signs or (not selection.process and selection.final.chi2_per_dof > EXPLAINED):
        return "unexplained"
    if selection.rivals:
        return "ambiguous"
    return "effect" if selection.effects else "none"


def _numbers(fit: Fit, names: Sequence[str]) -> tuple[Found, ...]:
    w, C = fit.windowed, fit.covariance
    found = []
    for name in names:
        e = w.model.effect(name)
        for key in e.numbers:
            parameter = e.parameter(key)
            if parameter not in w.names or (key == "width" and e.numbers[key].neutral != 0.0):
                continue
            j = w.names.index(parameter)
            unit = w.block.parameter(parameter).unit
            std = math.sqrt(max(C[j, j], 0.0))
            found.append(Found(name, parameter, acts_in(fit, name), float(fit.p[j]), std, unit))
    return tuple(found)


def acts_in(fit: Fit, name: str) -> str:
    """Return where an effect acts, in words of the equations."""
    w = fit.windowed
    e = w.model.effect(name)
    own = {w.block.parameter(e.parameter(k)).symbol for k in e.numbers}
    block = w.block
    rows = [f"{s.name}'" for s in block.states if block.expand(block.derivatives[s.name]).free_symbols & own]
    rows += [
        o.name.replace("_measured", " as measured")
        for o in block.outputs
        if block.expand(block.output_expressions[o.name]).free_symbols & own
    ]
    return " ".join(rows) or ("all commands" if type(e).kind() == "input" else "the log's clock")
