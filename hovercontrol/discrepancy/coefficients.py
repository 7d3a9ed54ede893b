"""The refitted coefficients of an amended model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hovercontrol.core.boundary import checked
from hovercontrol.estimation.fit import Fit


@checked
@dataclass(frozen=True)
class Refitted:
    """One coefficient of an amended model.

    Attributes
    ----------
    name : str
    value, std : float
        Estimate and standard error.
    unit : str
    start : float
        Value in the given model; NaN for a parameter of an added effect.

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


def refitted(fit: Fit, given: Mapping[str, float]) -> tuple[Refitted, ...]:
    """Return every fitted coefficient, with its value in the given model."""
    block, variance = fit.problem.block, np.diag(fit.covariance)
    return tuple(
        Refitted(
            name,
            float(fit.p[j]),
            math.sqrt(max(float(variance[j]), 0.0)),
            block.parameter(name).unit,
            given.get(name, math.nan),
        )
        for j, name in enumerate(fit.problem.names)
    )
