"""Where a function of one signal acts: the ends of a table or of a range at which it gains most.

The function is a sum of hats with knots close together, of which the products are made once. A table, or one
within a range and zero elsewhere, is then a sum of these hats, and its gain on left-out blocks is linear
algebra. Of tables of one kind, and of ranges, as likely as the best, the one that acts in fewest rows is
taken. The limits of a range are then moved between the knots next to them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects.law import TABLES, VALUES, Factor, knots
from hovercontrol.identification.diagnose.criteria import CRITERIA

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.laws.scan import Local, Scan

#: Number of knots close together, of places between two of them at which a limit may lie, and how often the
#: interval in which it lies is divided.
FINE, BETWEEN, ROUNDS = 33, 8, 2

#: A kind of function and the first and last knot between which it changes.
Span: TypeAlias = tuple[str, int, int]


def hats(values: Array, knots: Array) -> Array:
    """Return the linear B-splines at values, shape (k, *values.shape); they sum to one.

    Parameters
    ----------
    values : ndarray
    knots : ndarray, shape (k,)
        Increasing; beyond the ends the outer hats stay at one.

    Examples
    --------
    >>> hats(np.array([0.0, 0.25, 5.0]), np.array([0.0, 1.0])).tolist()
    [[1.0, 0.75, 0.0], [0.0, 0.25, 1.0]]
    """
    # the place of a value among the knots, counted from the first, and its distance from each of them
    place = np.interp(values, knots, np.arange(knots.size))
    return np.maximum(1.0 - np.abs(place - np.arange(knots.size).reshape(-1, *[1] * place.ndim)), 0.0)


def placed(scan: Scan, local: Local) -> list[Local]:
    """Return a function as a table and as ranges, with the ends at which each gains most.

    A range may also be one of its own signal times the factors: a drag in proportion to a speed, above one.
    """
    own = Factor("", local.of.signal)
    times_own = [replace(local, by=(*local.by, own))] if own not in local.by else []
    ranges = [_range(scan, one) for one in (local, *times_own)]
    return [*_tables(scan, local), *(one for one in ranges if one)]


def _tables(scan: Scan, local: Local) -> list[Local]:
    """Return a function as tables, zero below, above or on both sides, of those as likely as the best.

    Their gains are lessened, since a range has one value where a table has five.
    """
    at, G, f = _fine(scan, local)

    def gain(span: Span) -> float:
        kind, i, j = span
        return scan.gain_of(G, f, _table_hats(kind, at, at[i], at[j]))

    best = [_best(gain, [(kind, i, j) for i, j in _pairs(at.size)], at.size) for kind in TABLES]
    least = max(found for _, found in best) - CRITERIA.apart
    return [
        replace(local, kind=kind, ends=(float(at[i]), float(at[j])), gain=found - CRITERIA.apart)
        for (kind, i, j), found in best
        if found >= least
    ]


def _fine(scan: Scan, local: Local) -> tuple[Array, Array, Array]:
    """Return knots close together, and the products and scores of the hats at them."""
    at = scan.knots(local.of, FINE)
    ((_, G, f),) = scan.products([(local.by, local.of, hats(scan.along_logs(local.of), at))])
    return at, G, f


def _pairs(n: int) -> list[tuple[int, int]]:
    """Return pairs of every second knot."""
    return list(itertools.combinations(sorted({*range(0, n, 2), n - 1}), 2))


def _best(gain: Callable[[Span], float], spans: Sequence[Span], n: int) -> tuple[Span, float]:
    """Return the span that gains most; of those as likely, the one that acts in fewest rows."""
    gains = {span: gain(span) for span in spans}
    while True:
        kind, i, j = best = max(gains, key=lambda span: gains[span])
        near = [(kind, i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]
        fresh = [s for s in near if s not in gains and 0 <= s[1] < s[2] < n and s[2] - s[1] < n - 1]
        gains |= {span: gain(span) for span in fresh}
        if max(gains, key=lambda span: gains[span]) == best:
            break
    likely = [s for s, g in gains.items() if g > gains[best] - CRITERIA.apart]
    least = min(likely, key=lambda s: (_rows(s, n), -gains[s]))
    return least, gains[least]


def _rows(span: Span, n: int) -> int:
    """Return the number of knots at which a function acts."""
    kind, i, j = span
    return (n - 1 if kind == "rise" else j) - (0 if kind == "fall" else i)


def _range(scan: Scan, local: Local) -> Local | None:
    """Return a function that is one in a range; None if a signal has too few values for one."""
    at, G, f = _fine(scan, local)
    n, knot = at.size, np.arange(at.size)

    def gain(span: Span) -> float:
        return scan.gain_of(G, f, ((knot >= span[1]) & (knot <= span[2])).astype(float)[None])

    spans = [("between", i, j) for i, j in _pairs(n) if (i, j) != (0, n - 1)]
    if not spans:
        return None
    (_, i, j), most = _best(gain, spans, n)
    return _with_limits(scan, replace(local, gain=most), at, i, j)


def _with_limits(scan: Scan, local: Local, at: Array, i: int, j: int) -> Local:
    """Return a range of knots as one between limits, each moved to where it gains most."""
    a, n = scan.along_logs(local.of), at.size
    rises = (float(at[i - 1]), float(at[i])) if i > 0 else None
    falls = (float(at[j]), float(at[j + 1])) if j < n - 1 else None

    def moved(step: tuple[float, float], other: Array, sign: float) -> tuple[float, tuple[float, float]]:
        gain = local.gain
        for _ in range(ROUNDS):
            tried = _steps(a, *step)
            columns = np.stack([other + sign * hats(a, np.array(one))[1] for one in tried])
            ((_, G, f),) = scan.products([(local.by, local.of, columns)])
            gains = [scan.gain_of(G, f, row[None]) for row in np.eye(len(tried))]
            gain, step = max(gains), tried[int(np.argmax(gains))]
        return gain, step

    gain = local.gain
    if rises:
        later = hats(a, np.array(falls))[1] if falls else np.zeros_like(a)
        gain, rises = moved(rises, -later, 1.0)
    if falls:
        earlier = hats(a, np.array(rises))[1] if rises else np.ones_like(a)
        gain, falls = moved(falls, earlier, -1.0)
    kind = "between" if rises and falls else "above" if rises else "below"
    return replace(local, kind=kind, ends=(*(rises or ()), *(falls or ())), gain=gain)


def _steps(a: Array, low: float, high: float) -> list[tuple[float, float]]:
    """Return neighbouring values of a signal between two knots: where a step may lie."""
    inside = a[(a >= low) & (a <= high)]
    values = np.unique(np.quantile(inside, np.linspace(0.0, 1.0, BETWEEN + 1), method="nearest"))
    found = np.unique([low, *values.tolist(), high])
    return list(zip(found[:-1].tolist(), found[1:].tolist(), strict=True))


def _table_hats(kind: str, a: Array, low: float, high: float) -> Array:
    """Return what a unit of each value of a table adds, over its signal."""
    at, below, above = knots(kind, low, high), kind != "fall", kind != "rise"
    return hats(a, np.array([*[low] * below, *at, *[high] * above]))[below:][: len(VALUES)]
