"""The force that a model lacks along each log, with its band, and where it is significant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr


@dataclass(frozen=True)
class MissingCriteria:
    """When a missing force is significant.

    No published source: three standard errors are exceeded by chance in 0.3 % of normal samples; the
    times are set by hand, exercised by tests/identification/diagnose/test_remainder.py.

    Attributes
    ----------
    seen : float
        Standard errors that the force must exceed.
    shortest : float
        Shortest interval that is listed [s].
    apart : float
        Intervals closer than this are joined [s]: a force that changes sign passes through zero.
    """

    seen: float = 3.0
    shortest: float = 0.2
    apart: float = 0.5


#: The values in use.
MISSING = MissingCriteria()


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity on which a missing force may depend: a velocity or a command.

    Attributes
    ----------
    name, unit : str
    values : ndarray, shape (n,)
        Velocities as reconstructed; NaN in rows outside all windows.
    is_command : bool
    """

    name: str
    unit: str
    values: Array
    is_command: bool = False

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Missing:
    """The acceleration missing in one equation, along one log.

    Attributes
    ----------
    log, equation, unit : str
        ``"a.csv"``, ``"u'"``, ``"m/s^2"``.
    time : ndarray, shape (n,)
        On the log's clock [s].
    force, band : ndarray, shape (n,)
        Missing force per mass (torque per inertia), and its standard error; NaN in rows outside all windows.
    over : tuple of Quantity
        Quantities on which it may depend, in the same rows.
    seen : float
        Root mean square of the observed acceleration in that equation; equations are compared relative to it.
    tempo : float
        By which lengths of time are multiplied (:mod:`hovercontrol.identification.engine.tempo`).
    """

    log: str
    equation: str
    unit: str
    time: Array
    force: Array
    band: Array
    over: tuple[Quantity, ...] = ()
    seen: float = 1.0
    tempo: float = 1.0

    __repr__ = short_repr

    @property
    def segments(self) -> list[tuple[float, float]]:
        """Intervals in which the force is significant [s]; those close together are joined."""
        with np.errstate(invalid="ignore"):
            there = np.abs(self.force) > MISSING.seen * self.band
        edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(int), [0]])))
        spans = [(float(self.time[a]), float(self.time[b - 1])) for a, b in edges.reshape(-1, 2)]
        joined: list[tuple[float, float]] = []
        for begin, end in (s for s in spans if s[1] - s[0] >= MISSING.shortest * self.tempo):
            if joined and begin - joined[-1][1] < MISSING.apart * self.tempo:
                begin = joined.pop()[0]
            joined.append((begin, end))
        return joined

    @property
    def share(self) -> float:
        """Fraction of the rows in which the force is significant."""
        with np.errstate(invalid="ignore"):
            return float(np.nanmean(np.abs(self.force) > MISSING.seen * self.band))

    @property
    def rms(self) -> float:
        """Root mean square of the force."""
        return math.sqrt(float(np.nanmean(self.force**2)))


def rate(unit: str) -> str:
    """Return the unit of a derivative.

    Examples
    --------
    >>> rate("m/s"), rate("rad")
    ('m/s^2', 'rad/s')
    """
    return f"{unit.removesuffix('/s')}/s^2" if unit.endswith("/s") else f"{unit}/s"


def running_mean(time: Array, values: Array, over: float) -> Array:
    """Return the mean of the rows within half of `over` seconds of each row; NaN where a row has no value."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    first = np.searchsorted(time, time - 0.5 * over, side="left")
    stop = np.searchsorted(time, time + 0.5 * over, side="right")
    with np.errstate(all="ignore"):
        mean = (total[stop] - total[first]) / (count[stop] - count[first])
    return np.asarray(np.where(known, mean, np.nan))
