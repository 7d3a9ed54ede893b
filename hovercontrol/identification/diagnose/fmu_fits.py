"""Candidates around a fitted FMU: screened by their linear response, fitted, and read block by block."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.fmi.replay.candidates import Candidate
from hovercontrol.fmi.replay.output_error import ITERATIONS, FmuFit, refine
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.unknowns import Unknowns, estimated
from hovercontrol.identification.diagnose.evidence.blocks import Blocks, along, of_gain, scatter
from hovercontrol.identification.engine.excitation import covariance


@dataclass(frozen=True)
class FmuCriteria:
    """What limits the effort of the search; what an effect needs is in ``CRITERIA`` of all models.

    No published source: set by hand; the benchmark ``fmu_models`` counts the names that they give.

    Attributes
    ----------
    screened : float
        Smallest decrease of the sum of squares by the linear response, in noise variances.
    fitted : int
        Most candidates fitted in a step.
    iterations : int
        Of each candidate's fit.
    """

    screened: float = 12.0
    fitted: int = 8
    iterations: int = 15


#: The values in use.
EFFORT = FmuCriteria()


#: A candidate, its fall of the sum of squares, and the effect at which a fit begins.
Scored: TypeAlias = tuple[float, Candidate, Effect]


def screened(fit: FmuFit, every: Sequence[Candidate]) -> list[Scored]:
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
        if best is not None and best[0] > EFFORT.screened:
            found.append(best)
    return sorted(found, key=lambda one: -one[0])


def _with(fit: FmuFit, plant: FmuPlant) -> tuple[Unknowns, Array]:
    """Return the unknowns of a model with more effects, at the values of a fit."""
    unknowns = Unknowns(plant, fit.unknowns.logs)
    known = dict(zip(fit.unknowns.names, fit.values.tolist(), strict=True))
    around = plant.around.values
    return unknowns, np.array([known[n] if n in known else around[n] for n in unknowns.names])


def fitted(fit: FmuFit, candidate: Candidate, begin: Effect) -> FmuFit | None:
    """Return the fit with a candidate added, from where it begins; None if the FMU refuses."""
    unknowns, values = _with(fit, candidate.added_to(fit.model, begin))
    try:
        return refine(unknowns, values, EFFORT.iterations)
    except RunFailed:
        return None


def completed(fit: FmuFit) -> FmuFit:
    """Return a candidate's fit, iterated until it has converged.

    From values that are still off, an autoregression takes the error of the values for noise and keeps it.
    """
    return refine(fit.unknowns, fit.values, ITERATIONS)


def without(final: FmuFit, out: Sequence[Candidate]) -> FmuFit:
    """Return the fit without some of its effects."""
    gone = {(c.place, c.cls.name) for c in out}
    around = final.model.around
    plant = replace(
        final.model,
        around=replace(
            around,
            at_inputs=tuple(e for e in around.at_inputs if ("before", e.name) not in gone),
            at_outputs=tuple(e for e in around.at_outputs if ("after", e.name) not in gone),
            in_equations=tuple(e for e in around.in_equations if ("added", e.name) not in gone),
        ),
    )
    unknowns, values = _with(final, plant)
    return refine(unknowns, values, EFFORT.iterations)


def _places(fit: FmuFit, candidate: Candidate) -> dict[str, int]:
    """Return the place of each number of an effect among the unknowns of a fit."""
    cls = candidate.cls
    return {
        k: fit.unknowns.names.index(f"{candidate.place}.{cls.parameter(k)}") for k in estimated(cls.small())
    }


def numbers_of(fit: FmuFit, candidate: Candidate) -> tuple[dict[str, float], dict[str, float]]:
    """Return the numbers of an effect and their standard errors."""
    C = covariance(fit.information, fit.unknowns.size, fit.widen)
    places = _places(fit, candidate)
    return (
        {k: float(fit.values[j]) for k, j in places.items()},
        {k: float(np.sqrt(C[j, j])) for k, j in places.items()},
    )


def agreement(fit: FmuFit, less: FmuFit, candidate: Candidate) -> Blocks:
    """Return how blocks agree on a fitted effect, as :func:`.evidence.blocks.agreement` does."""
    numbers = {k: j for k, j in _places(fit, candidate).items()}
    neutral = {k: candidate.cls.numbers[k].neutral for k in numbers}
    scaling = [(numbers[k], n) for k, n in neutral.items() if not math.isnan(n)]
    if not scaling:
        return of_gain(less.block_costs - fit.block_costs, fit.block_log)
    mine = [j for j, _ in scaling]
    away = np.array([fit.p[j] - n for j, n in scaling])
    others = [j for j in range(len(fit.p)) if j not in mine]
    information, u = along(fit.S, fit.g, np.zeros(len(fit.p)), mine, others, away)
    return scatter(u + information, information, fit.block_log)
