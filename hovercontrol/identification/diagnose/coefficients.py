"""The refitted coefficients of an amended model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.engine.excitation import Excitation
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.groups import Group
from hovercontrol.identification.engine.subject import unknowns


@checked
@dataclass(frozen=True)
class Refitted:
    """One coefficient of an amended model.

    Attributes
    ----------
    name : str
    value, std : float
        Estimate and standard error; the latter is infinite where the logs do not determine the coefficient.
    unit : str
    start : float
        Value in the given model; NaN for a parameter of an added effect.
    kept : str
        Why the value was kept: ``"by you"``, or what the logs cannot show; empty if it was estimated.

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

    __repr__ = short_repr


def refitted(fit: Fit, given: Mapping[str, float]) -> tuple[tuple[Refitted, ...], tuple[Group, ...]]:
    """Return every coefficient of a fit, with its value in the given model, and the groups among them."""
    problem, block, variance = fit.problem, fit.problem.block, np.diag(fit.covariance)
    shown = Excitation(fit, problem.size)
    found = []
    for j, name in enumerate(problem.names):
        std = math.sqrt(max(float(variance[j]), 0.0)) if np.isfinite(shown.std[j]) else math.inf
        why = "" if math.isfinite(std) else shown.reason(j)
        unit = block.parameter(name).unit
        found.append(Refitted(name, float(fit.p[j]), std, unit, given.get(name, math.nan), why))
    for name in (n for n in unknowns(problem.model) if n not in problem.names and n in given):
        unit = block.parameter(name).unit
        found.append(Refitted(name, given[name], 0.0, unit, given[name], "by you"))
    return tuple(found), shown.groups
