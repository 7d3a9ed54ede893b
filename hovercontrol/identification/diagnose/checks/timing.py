"""The times of a log, against the time scales of its model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.rows import BLOCKING
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.logs import Log
from hovercontrol.logs.log import gap_rows


@dataclass(frozen=True)
class LengthCriteria:
    """Lengths of a log below which a warning is given.

    Attributes
    ----------
    short : float
        Longest interval without a gap, relative to the model's longest time constant: after four time
        constants a first-order response is within 2 %.
    few : int
        The same as a number of rows; set by hand, exercised by tests/identification/diagnose/test_checks.py.
    """

    short: float = 4.0
    few: int = 100


#: The values in use.
LENGTH = LengthCriteria()


def time_constant(model: Subject) -> float:
    """Return the longest time constant of a model's states at their nominal values [s]; 0 if none decays.

    The time constant of a state x with x' = f is 1/|df/dx|, if df/dx is negative.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> round(time_constant(c17_simulation()), 1)
    2.1
    """
    slopes = np.diag(_jacobian(model))
    known = slopes[np.isfinite(slopes) & (slopes < 0.0)]
    return float(1.0 / np.abs(known).min()) if known.size else 0.0


@checked
def slow_rows(model: Subject, log: Log) -> list[str]:
    """Return a line about a log whose rows are too far apart to show any motion of the model.

    From row to row, dt apart, a mode of the eigenvalue s turns by dt Im(s) and decays by exp(dt Re(s)). Rows
    show an oscillation only if it turns by less than pi (Shannon 1949); of a decay by exp(-pi), 4 % are left.
    The line is returned if dt |s| > pi for every eigenvalue s at the nominal values. Times in a wrong unit do
    that, and start values that are far off.

    Parameters
    ----------
    model : Model or BlockModel
    log : Log

    Returns
    -------
    list of str
        One line, or none.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=2.0)
    >>> decay = hc.BlockModel(hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> slow_rows(decay, Log("a", 0.1 * np.arange(5), {}))
    []
    >>> slow_rows(decay, Log("a", 10.0 * np.arange(5), {}))[0].partition(":")[2].partition(",")[0]
    ' rows are 10 s apart'
    """
    A = _jacobian(model)
    if len(log) < 2 or not A.size or not np.isfinite(A).all():
        return []
    apart, slowest = float(np.median(np.diff(log.time))), float(np.abs(np.linalg.eigvals(A)).min())
    if apart * slowest <= np.pi:
        return []
    return [
        f"{log.name}: rows are {apart:.3g} s apart, all motion of the model is over in "
        f"{np.pi / slowest:.2g} s: is the unit of time wrong (--columns time=NAME:us), or are the "
        "model's start values?"
    ]


def _jacobian(model: Subject) -> NDArray[np.float64]:
    """Return the derivatives of a model's equations by its states, at their nominal values."""
    block, values = structure(model), model.coefficients()
    numbers = {k: values.get(k.rpartition(".")[2], v) for k, v in block.default_parameters.items()}
    x, u = (np.array([s.nominal for s in signals]) for signals in (block.states, block.inputs))
    with np.errstate(all="ignore"):
        return np.asarray(block.to_numpy().jacobian(0.0, x, u, numbers))


def check_length(log: Log, longest_constant: float, is_craft: bool) -> list[str]:
    """Refuse a log that is too short for a fit; return a warning about one that is short.

    Parameters
    ----------
    log : Log
    longest_constant : float
        Result of :func:`time_constant`.
    is_craft : bool
        Whether rows more than a second apart are refused.
    """
    step = float(np.median(np.diff(log.time))) if len(log) > 1 else 0.0
    if is_craft and step > 1.0:  # other machines may be slow
        raise InputError(f"{log.name}: rows are {step:g} s apart: is its time in seconds?")
    cuts = [gap_rows(part.time) for part in log.each_trial()]
    parts = [own for part, at in zip(log.each_trial(), cuts, strict=True) for own in np.split(part.time, at)]
    longest = max(parts, key=len)
    if longest.size < BLOCKING.fewest:
        raise InputError(
            f"{log.name}: too short: the longest stretch without a break has {longest.size} rows, expected "
            f"{BLOCKING.fewest} or more"
        )
    seconds = max(float(own[-1] - own[0]) for own in parts if own.size)
    said = f"{log.name}: {seconds:.3g} s without a break are short"
    if seconds < LENGTH.short * longest_constant:
        part = f"{seconds / longest_constant:.2g} of the model's longest time constant"
        return [f"{said}, {part} ({longest_constant:.3g} s): effects may not be found"]
    if longest.size < LENGTH.few:
        return [f"{said}, {longest.size} rows: effects may not be found"]
    return []


def refuse_other_pace(logs: Sequence[Log]) -> None:
    """Refuse logs whose row intervals differ by a factor of over 300: their times differ in unit."""
    paces = [(float(np.median(np.diff(log.time))), log.name) for log in logs if len(log) > 1]
    for (slow, one), (fast, other) in pairwise(sorted(paces, reverse=True)):
        if slow > 300.0 * fast:
            raise InputError(
                f"{one}: rows are {slow:.3g} s apart, those of {other} {fast:.3g} s: are their times in the "
                "same unit?"
            )
