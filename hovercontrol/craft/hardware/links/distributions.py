"""Distributions of delays for Blocks: their quantile functions are expressions.

A delay is drawn by putting a random number between 0 and 1 into the quantile function (inverse transform
sampling), so that function must be an expression that every backend can print.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
import sympy as sp
from scipy.optimize import root
from scipy.special import beta

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive


@runtime_checkable
class Delays(Protocol):
    """Distribution of the delays of a link, in seconds.

    Examples
    --------
    >>> isinstance(BoundedDelays(mean=0.05, sd=0.005, least=0.04, most=0.08), Delays)
    True
    """

    @property
    def mean(self) -> float:
        """Mean delay [s]."""

    @property
    def most(self) -> float:
        """Longest delay [s]."""

    def quantile(self, share: sp.Expr) -> sp.Expr:
        """Return the quantile of the delays at a share [s], as an expression without unit."""


@checked
@dataclass(frozen=True)
class BoundedDelays:
    """Delays between two bounds, with a given mean and standard deviation (Kumaraswamy's distribution).

    The distribution of z = (delay - least) / (most - least) is ``1 - (1 - z^a)^b``. Like the beta
    distribution it has two shape parameters, one peak between the bounds and zero density at them (a, b > 1).
    Unlike the beta and the truncated normal distribution it has a closed quantile function:
    ``z = (1 - (1 - share)^(1/b))^(1/a)`` (P. Kumaraswamy, Journal of Hydrology 46, 1980). Its moments are
    ``E z^n = b B(1 + n/a, b)``, and a and b are solved from the given mean and standard deviation: all four
    numbers hold exactly.

    Parameters
    ----------
    mean, sd, least, most : float
        [s]

    Attributes
    ----------
    shapes : tuple of float
        a and b.

    Raises
    ------
    InputError
        If the bounds are negative or not in order, the mean is not between them, or the standard deviation is
        not positive or too large for these bounds.

    Examples
    --------
    >>> delays = BoundedDelays(mean=0.04081, sd=0.01061, least=0.022, most=0.09)
    >>> print(round(float(delays.quantile(sp.Float(0.5))), 4))
    0.0396
    """

    mean: float
    sd: float
    least: float
    most: float
    shapes: tuple[float, float] = field(init=False)

    def __post_init__(self) -> None:
        for key in ("mean", "sd", "least", "most"):
            object.__setattr__(self, key, number(f"delays: {key}", getattr(self, key)))
        if not 0 <= self.least < self.most < float("inf"):
            raise InputError(
                f"delays: expected 0 <= least < most, found least = {self.least:g} s, most = {self.most:g} s"
            )
        if not self.least < self.mean < self.most:
            raise InputError(
                f"delays: mean {self.mean:g} s must be between {self.least:g} s (least) and {self.most:g} s"
            )
        positive("delays: sd", self.sd)
        # No distribution on [least, most] with this mean has a larger variance (Bhatia and Davis).
        largest = float(np.sqrt((self.mean - self.least) * (self.most - self.mean)))
        if self.sd >= largest:
            raise InputError(
                f"delays: sd {self.sd:g} s must be below {largest:g} s with these bounds and mean"
            )
        width = self.most - self.least
        object.__setattr__(self, "shapes", _shapes((self.mean - self.least) / width, self.sd / width))

    def quantile(self, share: sp.Expr) -> sp.Expr:
        """Return the quantile of the delays at a share [s], as an expression without unit."""
        a, b = self.shapes
        z = (1 - (1 - share) ** (1 / b)) ** (1 / a)
        return self.least + (self.most - self.least) * z


@lru_cache
def _shapes(mean: float, sd: float) -> tuple[float, float]:
    """Return a and b of the distribution on [0, 1] with this mean and standard deviation."""

    def misfit(logarithms: np.ndarray) -> list[float]:
        a, b = np.exp(logarithms)
        first, second = (b * beta(1 + n / a, b) for n in (1, 2))
        return [first - mean, np.sqrt(np.fmax(second - first**2, 0.0)) - sd]

    found = root(misfit, np.log([2.0, 3.0]), tol=1e-13)
    if np.abs(misfit(found.x)).max() > 1e-9:
        raise InputError(
            f"delays: no distribution found with mean {mean:g} and sd {sd:g}, in widths of the bounds"
        )
    a, b = np.exp(found.x).tolist()
    return a, b
