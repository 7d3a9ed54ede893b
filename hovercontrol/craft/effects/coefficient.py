"""Numbers of an effect, each with unit and bounds: coefficients enter its terms linearly, shapes do not."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError

#: Smallest width of regularised dry friction: zero would divide.
TINY = 1e-9


@checked
@dataclass(frozen=True)
class Coefficient:
    """A number of an effect that enters its terms linearly.

    Parameters
    ----------
    unit : str
        May name an input's unit in braces: ``"m/s^2/{thrust}"``.
    lower, upper : float, optional
        Bounds.
    default : float, optional
        Default value; without it the value is required.
    neutral : float, optional
        The value at which the effect vanishes; NaN for a number that does not scale it.

    Raises
    ------
    InputError
        If the bounds are not an interval, or exclude `neutral` or `default`.

    Examples
    --------
    >>> c = Coefficient("1/s", lower=0.0)
    >>> c.lower, c.upper, c.default
    (0.0, inf, None)
    """

    unit: str
    lower: float = -math.inf
    upper: float = math.inf
    default: float | None = None
    neutral: float = 0.0

    def __post_init__(self) -> None:
        between = f"[{self.lower:g}, {self.upper:g}]"
        if not self.lower <= self.upper:
            raise InputError(f"bounds {between}: lower is above upper")
        for what, value in (("neutral", self.neutral), ("default", self.default)):
            if value is not None and (value < self.lower - TINY or value > self.upper):
                hint = " (the value at which the effect is not there)" if what == "neutral" else ""
                raise InputError(f"{what} = {value:g}{hint} is not within the bounds {between}")


@checked
@dataclass(frozen=True)
class Shape(Coefficient):
    """A shape parameter of an effect, which may enter nonlinearly (a width, a time).

    Parameters
    ----------
    search : tuple of float, optional
        Values from which a search for the effect starts.
    of : {"", "input", "speed", "time", "step", "signal"}, optional
        Unit of these values: none, the largest thrust, the craft's speed along the effect's axis (root mean
        square), the length of the log, or the time between its rows; or they are parts of the rows in which
        the law's signal is below.
    fixed : bool, optional
        Whether a fit keeps it: a scale, or a constant of the regularisation.
    unit, lower, upper, default, neutral
        As for :class:`Coefficient`.

    Examples
    --------
    >>> width = Shape("m/s", lower=TINY, default=0.01)
    >>> width.default, width.neutral
    (0.01, nan)
    """

    neutral: float = math.nan
    search: tuple[float, ...] = ()
    of: str = ""
    fixed: bool = False
