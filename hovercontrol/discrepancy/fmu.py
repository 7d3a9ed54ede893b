"""What an FMU lacks: effects before its inputs, after its outputs and in its derivatives, by likelihood.

Each candidate is screened by its linear response beside the sensitivities of the fit. The best are fitted
with all parameters. Schwarz' criterion of the whitened residuals (:mod:`hovercontrol.fmi.replay.whitening`)
decides: residuals that depend on their past are an autoregression, as process noise would make them, so
that a disturbed plant does not call for an effect.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hovercontrol.core.boundary import checked
from hovercontrol.effects import Effect, Shape
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimation.excitation import covariance
from hovercontrol.fmi.replay.candidates import Candidate, candidates
from hovercontrol.fmi.replay.held_out import held_out
from hovercontrol.fmi.replay.output_error import FmuFit, fit_fmu, refine
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows, trials_of
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.start_values import (
    around_json,
    save_around,
    save_copy,
    save_corrected,
    save_csv,
    save_ssv,
)
from hovercontrol.fmi.replay.unknowns import Unknowns, estimated
from hovercontrol.io.folders import write_folder
from hovercontrol.io.plain_json import json_text, plain
from hovercontrol.logs.log import Log

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FmuCriteria:
    """Thresholds of the search.

    No published source for `fitted`, `screened` and `worse`: set by hand; the benchmark ``fmu_models`` counts
    the names that they give. Differences of Schwarz' criterion: above 10 the evidence is very strong,
    above 6 strong (Kass and Raftery, JASA 90 (1995)).

    Attributes
    ----------
    screened : float
        Smallest decrease of the sum of squares by the linear response, in noise variances.
    fitted : int
        Most candidates fitted in a step.
    gain : float
        Smallest decrease of the criterion by an effect that is named.
    apart : float
        A candidate closer than this to the best is a rival.
    worse : float
        A held-out log may be predicted worse by this factor at most.
    iterations : int
        Of each candidate's fit.
    """

    screened: float = 12.0
    fitted: int = 8
    gain: float = 10.0
    apart: float = 6.0
    worse: float = 1.05
    iterations: int = 15


#: Name of the FMU with effects around it.
CORRECTED = "corrected.fmu"
#: The values in use.
CRITERIA = FmuCriteria()


@dataclass(frozen=True)
class FmuNamed:
    """An effect that the FMU lacks.

    Attributes
    ----------
    place : {"before", "after", "added"}
    effect : str
    numbers, std : mapping
        Its numbers and their standard errors.
    gain : float
        Decrease of Schwarz' criterion.
    rivals : tuple of str
        Effects that the logs do not tell from it, with their place.
    """

    place: str
    effect: str
    numbers: Mapping[str, float]
    std: Mapping[str, float]
    gain: float
    rivals: tuple[str, ...] = ()

    def __str__(self) -> str:
        where = {"before": "before the FMU", "after": "after the FMU", "added": "in the FMU's equations"}
        said = ", ".join(f"{k} = {v:.4g} ± {self.std[k]:.2g}" for k, v in self.numbers.items())
        more = f"; the logs do not tell it from {', '.join(self.rivals)}" if self.rivals else ""
        return f"{self.effect} {where[self.place]}: {said}{more}"


@checked
@dataclass(frozen=True, eq=False)
class FmuDiagnosis:
    """The result of :func:`~hovercontrol.discrepancy.diagnose.diagnose` of an FMU.

    Attributes
    ----------
    verdict : {"none", "effect", "partial", "ambiguous", "unexplained"}
        As of :class:`~hovercontrol.discrepancy.diagnosis.Diagnosis`; a remainder is a residual that
        depends on its past.
    effects : tuple of FmuNamed
    model : FmuPlant
        As given.
    amended : FmuPlant
        With the effects around the FMU (``amended.around``) and the estimates.
    residual_before, residual_after : mapping
        Root mean square of measured minus computed of each channel.
    remains : tuple of str
        Channels whose residual depends on its past.
    held_before, held_after : mapping
        Of each held-out log and channel: residual over spread.
    base, final : FmuFit
    warnings : tuple of str
    """

    verdict: str
    effects: tuple[FmuNamed, ...]
    model: FmuPlant
    amended: FmuPlant
    residual_before: Mapping[str, float]
    residual_after: Mapping[str, float]
    remains: tuple[str, ...]
    held_before: Mapping[str, Mapping[str, float]]
    held_after: Mapping[str, Mapping[str, float]]
    base: FmuFit
    final: FmuFit
    warnings: tuple[str, ...] = field(default=())

    def sentences(self) -> list[str]:
        """Return the result as sentences."""
        said = [f"{self.model.name} lacks {e}" for e in self.effects]
        if not self.effects:
            said = [
                f"{self.model.name} lacks nothing: its residuals are measurement noise"
                if self.verdict == "none"
                else f"{self.model.name}: no effect around the FMU explains the logs"
            ]
        sizes = [
            f"{c} {before:.3g} -> {self.residual_after[c]:.3g}" for c, before in self.residual_before.items()
        ]
        said.append(f"residuals (root mean square): {', '.join(sizes)}")
        if self.remains:
            said.append(f"the residuals of {', '.join(self.remains)} still depend on their past")
        for log, shares in self.held_after.items():
            pairs = [f"{c} {self.held_before[log][c]:.3g} -> {v:.3g}" for c, v in shares.items()]
            said.append(f"{log} (held out): residual over spread: {', '.join(pairs)}")
        return said

    def __repr__(self) -> str:
        return "\n".join([f"FmuDiagnosis: {self.verdict}", *(f"  {line}" for line in self.sentences())])

    def result(self) -> dict[str, Any]:
        """Return the result as what JSON holds."""
        found: dict[str, Any] = plain(
            {
                "model": self.model.name,
                "verdict": self.verdict,
                "effects": [vars(e) for e in self.effects],
                "residual_before": dict(self.residual_before),
                "residual_after": dict(self.residual_after),
                "remains": list(self.remains),
                "held_before": dict(self.held_before),
                "held_after": dict(self.held_after),
                "around": around_json(self.amended.around),
                "warnings": list(self.warnings),
            }
        )
        return found

    def save(self, folder: str | Path) -> list[Path]:
        """Write result.json, around.json, start_values.csv, start_values.ssv and FMUs with the estimates.

        A copy of the FMU has the estimates as start values. If effects were found, ``corrected.fmu`` has the
        FMU inside and the effects around it (:func:`hovercontrol.fmi.corrected_fmu`). Without a C compiler
        it is not written; a warning says so.
        """

        def write(temporary: Path) -> None:
            text = json_text(self.result())
            json.loads(text)
            (temporary / "result.json").write_text(text, encoding="utf-8")
            save_around(self.amended.around, temporary / "around.json")
            save_csv(self.amended, temporary / "start_values.csv")
            save_ssv(self.amended, temporary / "start_values.ssv")
            save_copy(self.amended, temporary / self.model.path.name)
            if self.amended.around.effects:
                try:
                    save_corrected(self.amended, temporary / CORRECTED)
                except InputError as fault:  # what was found must not be lost for want of a compiler
                    warnings.warn(f"{CORRECTED} was not written: {fault}", stacklevel=2)

        return write_folder(folder, write, stale=(CORRECTED,))


def diagnose_fmu(
    model: FmuPlant,
    logs: Sequence[Log],
    holdout: Sequence[Log] = (),
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    progress: Callable[[float, str], None] | None = None,
) -> FmuDiagnosis:
    """Find which effects an FMU lacks; see :func:`~hovercontrol.discrepancy.diagnose.diagnose`.

    Raises
    ------
    InputError
        If a log does not fit the FMU, a name is unknown, or the FMU cannot be run.
    """
    report = progress or (lambda part, what: None)
    rows = trials_of(model, logs)
    if max_effects < 1:
        raise InputError(f"max_effects: expected 1 or more, found {max_effects}")
    wanted = _wanted(model, rows, names)
    done = [0]

    def said(what: str) -> None:
        done[0] += 1
        report(0.9 * done[0] / (5 + done[0]), what)

    with threadpool_limits(1, "blas"):
        base = fit_fmu(model, rows, said)
        now, named = base, list[FmuNamed]()
        while len(named) < max_effects:
            step = _step(now, wanted, said)
            if step is None:
                break
            now, effect = step
            named.append(effect)
        said("predicting the held-out logs")
        before = {log.name: held_out(base.model, log) for log in holdout}
        after = {log.name: held_out(now.model, log) for log in holdout}
    worse = any(after[k][c] > CRITERIA.worse * before[k][c] for k in after for c in after[k])
    signals = (*model.outputs, *model.states)
    channels = [signals[i].name for i in rows[0].places]
    remains = tuple(c for c, n in zip(channels, now.whitening.orders, strict=True) if n)
    said_of = ("a held-out log is predicted worse with the effects",) if worse and named else ()
    report(1.0, "done")
    return FmuDiagnosis(
        _verdict(named, remains, worse),
        tuple(named),
        model,
        now.model,
        dict(zip(channels, base.rms.tolist(), strict=True)),
        dict(zip(channels, now.rms.tolist(), strict=True)),
        remains,
        before,
        after,
        base,
        now,
        said_of,
    )


def _verdict(named: Sequence[FmuNamed], remains: Sequence[str], worse: bool) -> str:
    if not named:
        return "unexplained" if remains else "none"
    if worse or any(e.rivals for e in named):
        return "ambiguous"
    return "partial" if remains else "effect"


def _wanted(model: FmuPlant, rows: Sequence[Rows], names: Sequence[str] | None) -> set[str] | None:
    if names is None:
        return None
    known = candidates(model, rows)
    every = {n for c in known for n in (c.name, c.cls.name)}
    for name in names:
        if name not in every:
            raise InputError(f"unknown effect {name!r}{did_you_mean(name, every)}")
    return {c.name for c in known if {c.name, c.cls.name} & set(names)}


def _step(
    fit: FmuFit, wanted: set[str] | None, said: Callable[[str], None]
) -> tuple[FmuFit, FmuNamed] | None:
    """Return the fit with the best further effect, and the effect; None if there is none."""
    every = candidates(fit.model, fit.unknowns.logs)
    every = [c for c in every if wanted is None or c.name in wanted]
    said("screening effects")
    found = _screened(fit, every)
    fits: list[tuple[FmuFit, Candidate]] = []
    for _, candidate, begin in found[: CRITERIA.fitted]:
        said(f"fitting {candidate.name}")
        trial = _fitted(fit, candidate, begin)
        if trial is not None:
            fits.append((trial, candidate))
    fits.sort(key=lambda pair: pair[0].bic)
    if not fits or fit.bic - fits[0][0].bic < CRITERIA.gain:
        return None
    best, chosen = fits[0]
    rivals = tuple(c.name for f, c in fits[1:] if f.bic - best.bic < CRITERIA.apart)
    numbers, std = _numbers(best, chosen)
    return best, FmuNamed(chosen.place, chosen.cls.name, numbers, std, fit.bic - best.bic, rivals)


def _screened(fit: FmuFit, every: Sequence[Candidate]) -> list[tuple[float, Candidate, Effect]]:
    """Return candidates that may lower the sum of squares, the best first, and where a fit of each begins.

    With w the residual over its root mean square, J the sensitivities of the fit and d the response to a
    trial, all of them so scaled: d' is d less its projection on J, and its best multiple lowers the
    sum of squares by ``(w d')^2 / d'd'``.
    """
    unknowns, scale = fit.unknowns, np.maximum(fit.rms, 1e-300)
    base = unknowns.predict(fit.values)
    seen = [np.isfinite(r) for r in fit.residuals]
    w = np.concatenate(
        [np.where(s, r / scale, 0.0).ravel() for r, s in zip(fit.residuals, seen, strict=True)]
    )
    J = np.concatenate(
        [
            np.where(s[..., None], j / scale[:, None], 0.0).reshape(-1, len(fit.values))
            for j, s in zip(unknowns.slopes(fit.values, base), seen, strict=True)
        ]
    )
    Q = np.linalg.qr(J / np.maximum(np.sqrt((J**2).sum(axis=0)), 1e-300))[0] if J.shape[1] else J
    plant, found = fit.model, []
    w = w - Q @ (Q.T @ w)
    for candidate in every:
        best: tuple[float, Candidate, Effect] | None = None
        for e in candidate.tried:
            trial = _with(fit, candidate.added_to(plant, e))
            try:
                there = trial[0].predict(trial[1])
            except RunFailed:
                continue
            d = np.concatenate(
                [np.where(s, (y - b) / scale, 0.0).ravel() for y, b, s in zip(there, base, seen, strict=True)]
            )
            d = d - Q @ (Q.T @ d)
            square = float(d @ d)
            if square <= 1e-12 * len(d):
                continue
            a = float(w @ d) / square
            own = next(iter(estimated(e)))
            linear = not isinstance(type(e).numbers[own], Shape)
            if not linear and a <= 0.0:
                continue
            start = e.within_bounds(**{**e.values, own: a * e.values[own]}) if linear else e
            gain = float(w @ w) - float(((w - (a if linear else 1.0) * d) ** 2).sum())
            gain = max(gain, 0.5 * a * a * square) if not linear else gain
            if best is None or gain > best[0]:
                best = (gain, candidate, start)
        if best is not None and best[0] > CRITERIA.screened:
            found.append(best)
    return sorted(found, key=lambda one: -one[0])


def _with(fit: FmuFit, plant: FmuPlant) -> tuple[Unknowns, Array]:
    """Return the unknowns of a model with more effects, at the values of a fit."""
    unknowns = Unknowns(plant, fit.unknowns.logs)
    known = dict(zip(fit.unknowns.names, fit.values.tolist(), strict=True))
    around = plant.around.values
    return unknowns, np.array([known[n] if n in known else around[n] for n in unknowns.names])


def _fitted(fit: FmuFit, candidate: Candidate, begin: Effect) -> FmuFit | None:
    unknowns, values = _with(fit, candidate.added_to(fit.model, begin))
    try:
        return refine(unknowns, values, CRITERIA.iterations)
    except RunFailed:
        return None


def _numbers(fit: FmuFit, candidate: Candidate) -> tuple[dict[str, float], dict[str, float]]:
    C = covariance(fit.information, fit.unknowns.size, fit.widen)
    numbers, std = {}, {}
    for k in estimated(candidate.cls.small()):
        j = fit.unknowns.names.index(f"{candidate.place}.{candidate.cls.parameter(k)}")
        numbers[k], std[k] = float(fit.values[j]), float(np.sqrt(C[j, j]))
    return numbers, std
