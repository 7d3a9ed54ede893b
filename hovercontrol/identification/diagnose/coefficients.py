"""The refitted coefficients of an amended model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.diagnose.search.fit import Tried
from hovercontrol.identification.engine.excitation import Excitation
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.groups import Group
from hovercontrol.identification.engine.subject import unknowns


@checked
@dataclass(frozen=True)
class Reading:
    """Another estimate of a coefficient: with a missing effect added, or over a longer time.

    Attributes
    ----------
    value, std : float
        Estimate and standard error, in the coefficient's unit.
    cause : str
        ``"with thrust_lag"`` or ``"over 2 s"``.

    Examples
    --------
    >>> print(Reading(2.214, 0.012, "with steer_lag"))
    2.214 ± 0.012 with steer_lag
    """

    value: float
    std: float
    cause: str

    def __str__(self) -> str:
        return f"{self.value:.4g} ± {self.std:.2g} {self.cause}"


@checked
@dataclass(frozen=True)
class Refitted:
    """One coefficient of an amended model.

    Attributes
    ----------
    name : str
    value, std : float
        Estimate and standard error; the latter is infinite where the logs do not determine the coefficient.
        It covers the `readings`: the square root of the variance by noise and the largest difference squared.
    unit : str
    start : float
        Value in the given model; NaN for a parameter of an added effect.
    kept : str
        Why the value was kept: ``"by you"``, or what the logs cannot show; empty if it was estimated.
    readings : tuple of Reading
        Estimates with an effect that is neither named nor refuted; those that differ by more than the
        standard error by noise.

    Examples
    --------
    >>> Refitted("gain", 13.7, 0.02, "rad/s^2/V", start=14.0).name
    'gain'
    """

    name: str
    value: float
    std: float
    unit: str
    start: float
    kept: str = ""
    readings: tuple[Reading, ...] = ()

    __repr__ = short_repr


def refitted(
    fit: Fit, given: Mapping[str, float], undecided: Sequence[Tried] = ()
) -> tuple[tuple[Refitted, ...], tuple[Group, ...]]:
    """Return every coefficient of a fit, with its value in the given model, and the groups among them.

    Parameters
    ----------
    undecided : sequence of Tried
        Fits with one effect more, which may be there.
    """
    problem, block, variance = fit.problem, fit.problem.block, np.diag(fit.covariance)
    shown = Excitation(fit, problem.size)
    found = []
    for j, name in enumerate(problem.names):
        std = math.sqrt(max(float(variance[j]), 0.0)) if np.isfinite(shown.std[j]) else math.inf
        other = _readings(fit, name, std, undecided)
        std = math.hypot(std, max((abs(r.value - fit.p[j]) for r in other), default=0.0))
        why = "" if math.isfinite(std) else shown.reason(j)
        unit = block.parameter(name).unit
        found.append(Refitted(name, float(fit.p[j]), std, unit, given.get(name, math.nan), why, other))
    for name in (n for n in unknowns(problem.model) if n not in problem.names and n in given):
        unit = block.parameter(name).unit
        found.append(Refitted(name, given[name], 0.0, unit, given[name], "by you"))
    return tuple(found), shown.groups


def _readings(fit: Fit, name: str, std: float, undecided: Sequence[Tried]) -> tuple[Reading, ...]:
    """Return the estimates of a coefficient beside other effects, if they differ by its standard error."""
    found = []
    for t in undecided:
        j = t.fit.problem.names.index(name)
        value, error = float(t.fit.p[j]), math.sqrt(max(float(t.fit.covariance[j, j]), 0.0))
        if abs(value - fit.p[fit.problem.names.index(name)]) > std:
            found.append(Reading(value, error, f"with {t.name}"))
    return tuple(found)
