"""Positions from ranges in closed form: Bancroft's method [K06 eq 5.6]; from two ranges, by two circles.

S. Bancroft, "An algebraic solution of the GPS equations", IEEE Trans. Aerospace and Electronic Systems 21,
1985; here in the plane, with beacons at known heights.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arguments import broadcastable
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Definitions
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors.beacons import NARROW, Beacons
from hovercontrol.craft.hardware.sensors.cone import K06_CONE, cone_signals, correction_definitions

#: Circles that miss each other by less, as a part of the range squared, touch: rounding, not noise.
TOUCHING = 1e-9

#: Tells which unit's ranges there are.
RANGE_UNIT = Signal("range_unit", "1", "number of the unit with these ranges, from 1; 0: none")

#: The position that was solved last, which tells the two places that two ranges leave apart.
PREVIOUS = (
    Signal("previous_x", "m", "last solved position, earth frame"),
    Signal("previous_y", "m", "last solved position, earth frame"),
    Signal("previous_known", "1", "1 if there is a last position"),
)

#: Which of the two places that two beacons leave.
_SIDE = Signal("side", "1", "side of the line from beacon 1 to 2: 1 left, -1 right", lower=-1.0, upper=1.0)


def range_signals(count: int) -> tuple[tuple[Signal, ...], tuple[Signal, ...]]:
    """Return the signals ``range_1...`` [m] and ``range_1_heard...`` (0 or 1)."""
    numbers = range(1, count + 1)
    ranges = tuple(Signal(f"range_{k}", "m", f"measured range to beacon {k}", nominal=2.7) for k in numbers)
    heard = tuple(Signal(f"range_{k}_heard", "1", "1 if the beacon was heard", start=1.0) for k in numbers)
    return ranges, heard


@checked
def range_solver(
    beacons: Beacons,
    *,
    cone: tuple[float, float] = K06_CONE,
    side: float = 1.0,
    previous: bool = False,
    name: str = "range_solver",
) -> Block:
    """Return the position of a unit from its ranges.

    Each range is corrected for its cone angle, then the equations
    ``rho_i = sqrt((x - x_i)^2 + (y - y_i)^2 + h_i^2) + b`` (5.6) are solved: with
    ``L = x^2 + y^2 - b^2`` they are linear in x, y and b, by least squares beyond three beacons, and L then
    solves a quadratic. Of its two roots the one with the smaller b is taken: the other has b of about twice
    the range.

    Two beacons do not determine b, which is then zero: their ranges are two circles on the floor, which
    intersect on both sides of the line between the beacons. Two ranges of more beacons are solved in the same
    way; the solution nearer to the previous position is used (K06 section 5.5.3).

    Parameters
    ----------
    beacons : Beacons
        The surveyed beacons; their positions are parameters.
    cone : (float, float), optional
        Of the cone-angle error (5.7); (0, 0) for none.
    side : float, optional
        With two beacons only, and then a parameter: 1 for positions left of the line from the first to the
        second, -1 for positions right of it.
    previous : bool, optional
        With more than two beacons only: whether two ranges are solved, with the inputs ``previous_x,
        previous_y`` [m], ``previous_known`` (0 or 1).
    name : str, optional

    Returns
    -------
    Block
        Inputs ``range_1...`` [m] and ``range_1_heard...`` (0 or 1); outputs ``solved_x, solved_y``,
        ``solved_bias`` (b) [m] and ``solved``: 1 if three beacons not in a line were heard, or two (of two
        beacons, or with `previous`) with intersecting circles. No states.

    Raises
    ------
    InputError
        If a coefficient of `cone` is not finite, `side` is not 1 or -1, or `previous` is given with two
        beacons.

    Examples
    --------
    >>> square = Beacons([(0, 0), (2, 0), (0, 2)], 2.0)
    >>> ranges = [6**0.5, 6**0.5, 6**0.5]  # from (1, 1)
    >>> solver = range_solver(square, cone=(0.0, 0.0))
    >>> solver.to_numpy().outputs(0.0, (), [*ranges, 1, 1, 1])[:2].round(9).tolist()
    [1.0, 1.0]
    >>> two = range_solver(Beacons([(0, 0), (2, 0)], 2.0), cone=(0.0, 0.0), side=-1)
    >>> two.to_numpy().outputs(0.0, (), [*ranges[:2], 1, 1])[:2].round(9).tolist()
    [1.0, -1.0]
    """
    if side not in (-1, 1):
        raise InputError(f"{name}: side must be 1 or -1, found {side!r}")
    count = len(beacons.positions)
    if previous and count == 2:
        raise InputError(f"{name}: expected no `previous` with two beacons: `side` selects the solution")
    ranges, heard = range_signals(count)
    ranges = tuple(r.replace(start=start) for r, start in zip(ranges, _from_the_middle(beacons), strict=True))
    places = beacons.signals()
    define = Definitions()
    corrected = []
    for k, (rho, place) in enumerate(zip(ranges, places, strict=True), 1):
        define.update(correction_definitions(rho.symbol, place[2].symbol, f"_{k}"))
        corrected.append(sp.Symbol(f"range_corrected_{k}", real=True))
    where = [tuple(s.symbol for s in place) for place in places]
    hears = [s.symbol for s in heard]
    chosen = (_SIDE.replace(start=float(side)),) if count == 2 else ()
    if chosen:
        both = define("both_heard", hears[0] * hears[1])
        x, y, solved = _circles(define, where, corrected, both, _SIDE.symbol)
        bias: sp.Expr = sp.S.Zero
    else:
        x, y, bias, solved = _bancroft(define, where, corrected, hears)
    if previous:
        x, y, bias, solved = _or_circles(define, where, corrected, hears, (x, y, bias, solved))
    return Block(
        name,
        inputs=(*ranges, *heard, *(PREVIOUS if previous else ())),
        outputs=(
            Signal("solved_x", "m", "position of the unit, earth frame"),
            Signal("solved_y", "m", "position of the unit, earth frame"),
            Signal("solved_bias", "m", "common error of all ranges, b in (5.6)"),
            Signal("solved", "1", "1 if the ranges give a position"),
        ),
        parameters=(*(s for place in places for s in place), *cone_signals(cone, name), *chosen),
        output_expressions={"solved_x": x, "solved_y": y, "solved_bias": bias, "solved": solved},
        definitions=define,
    )


def _from_the_middle(beacons: Beacons) -> list[float]:
    """Return the ranges from the middle of the beacons [m]: ranges with a solution, to start with."""
    x, y = (sum(p[i] for p in beacons.positions) / len(beacons.positions) for i in (0, 1))
    return [
        math.hypot(p[0] - x, p[1] - y, h) for p, h in zip(beacons.positions, beacons.heights, strict=True)
    ]


def _or_circles(
    define: Definitions,
    places: Sequence[tuple[sp.Symbol, ...]],
    ranges: Sequence[sp.Symbol],
    heard: Sequence[sp.Symbol],
    many: tuple[sp.Expr, ...],
) -> tuple[sp.Expr, ...]:
    """Return x, y, bias and solved from `many` ranges, or from two and the previous position."""
    x0, y0, known = (s.symbol for s in PREVIOUS)
    none: sp.Expr = sp.S.One  # heard so far
    one: sp.Expr = sp.S.Zero
    first, second = [], []
    for k, h in enumerate(heard, 1):
        first.append(define(f"is_first_{k}", h * none))
        second.append(define(f"is_second_{k}", h * one))
        one = define(f"one_so_far_{k}", one * (1 - h) + none * h)
        none = define(f"none_so_far_{k}", none * (1 - h))
    pair = []
    for label, which in (("first", first), ("second", second)):
        row = [sp.Add(*(w * p[i] for w, p in zip(which, places, strict=True))) for i in range(3)]
        rho = sp.Add(*(w * r for w, r in zip(which, ranges, strict=True)))
        height = define(f"{label}_height", sp.Piecewise((row[2], row[2] > 0), (places[0][2], True)))
        pair.append((define(f"{label}_x", row[0]), define(f"{label}_y", row[1]), height))
        pair.append(define(f"{label}_range", rho))
    two = define("two_heard", sp.Piecewise((known, sp.And(sum(heard) > 1.5, sum(heard) < 2.5)), (0, True)))
    (ax, ay, _), (bx, by, _) = pair[0], pair[2]
    side = define("previous_side", (bx - ax) * (y0 - ay) - (by - ay) * (x0 - ax))
    x, y, solved = _circles(define, (pair[0], pair[2]), (pair[1], pair[3]), two, side)
    return (
        *(sp.Piecewise((e, two > 0), (m, True)) for e, m in zip((x, y, sp.S.Zero), many[:3], strict=True)),
        define("any_solved", sp.Piecewise((solved, two > 0), (many[3], True))),
    )


def _circles(
    define: Definitions,
    places: Sequence[tuple[sp.Symbol, ...]],
    ranges: Sequence[sp.Symbol],
    both: sp.Symbol,
    side: sp.Expr,
) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return x, y and solved from two ranges, left of the line between the beacons for side > 0."""
    # From the first beacon, in units of its height.
    (x1, y1, scale), (x2, y2, _) = places
    dx, dy = define("line_x", (x2 - x1) / scale), define("line_y", (y2 - y1) / scale)
    length = define("line_squared", dx**2 + dy**2)
    first, second = (
        define(f"floor_{k}_squared", (rho - h) * (rho + h) / scale**2)
        for k, (rho, (_, _, h)) in enumerate(zip(ranges, places, strict=True), 1)
    )
    there = define("line_there", sp.Piecewise((1, both * length > 0), (0, True)))
    divisor = define("divisor", sp.Piecewise((length, length > 0), (1, True)))
    # As parts of the line: how far along it the place is, and how far beside it, squared.
    along = define("along", (first - second + length) / (2 * divisor))
    across = define("beside_squared", first / divisor - along**2)
    beside = define("beside", sp.sqrt(sp.Max(across, 0)) * sp.Piecewise((1, side > 0), (-1, True)))
    missed = -across * length > TOUCHING * (ranges[0] / scale) ** 2
    return (
        define("met_x", x1 + scale * (along * dx - beside * dy)),
        define("met_y", y1 + scale * (along * dy + beside * dx)),
        define("met", there * sp.Piecewise((0, missed), (1, True))),
    )


def _bancroft(
    define: Definitions,
    places: Sequence[tuple[sp.Symbol, ...]],
    ranges: Sequence[sp.Symbol],
    heard: Sequence[sp.Symbol],
) -> tuple[sp.Expr, ...]:
    """Return x, y, bias and solved from three or more ranges."""

    def total(parts: Sequence[sp.Expr]) -> sp.Expr:
        return sp.Add(*(w * e for w, e in zip(heard, parts, strict=True)))

    # From the centroid, in units of a height: there the three columns are never dependent.
    count = define("heard_count", sp.Add(*heard))
    scale = places[0][2]
    cx, cy = (
        define(f"centroid_{axis}", total([p[i] for p in places]) / sp.Max(count, 1))
        for i, axis in enumerate("xy")
    )
    rows, rights = [], []
    for k, ((x, y, h), rho) in enumerate(zip(places, ranges, strict=True), 1):
        a = define(f"row_x_{k}", (x - cx) / scale)
        b = define(f"row_y_{k}", (y - cy) / scale)
        c = define(f"row_range_{k}", rho / scale)
        rows.append((a, b, -c))
        rights.append(define(f"right_{k}", (a**2 + b**2 + (h / scale) ** 2 - c**2) / 2))
    normal = sp.zeros(3, 3)
    for i in range(3):
        for j in range(i, 3):
            normal[i, j] = normal[j, i] = define(f"normal_{i}{j}", total([row[i] * row[j] for row in rows]))
    spread = normal[0, 0] + normal[1, 1]
    out_of_line = normal[0, 0] * normal[1, 1] - normal[0, 1] ** 2 > NARROW**2 * spread**2
    enough = define("enough", sp.Piecewise((1, sp.And(count > sp.Rational(5, 2), out_of_line)), (0, True)))
    adjugate = normal.adjugate()
    det = define("normal_det", sp.Piecewise((normal.row(0).dot(adjugate.col(0)), enough > 0), (1, True)))

    def solution(label: str, parts: Sequence[sp.Expr]) -> list[sp.Symbol]:
        g = sp.Matrix(
            [
                define(f"{label}_side{i}", total([r[i] * e for r, e in zip(rows, parts, strict=True)]))
                for i in range(3)
            ]
        )
        return [define(f"{label}_{i}", adjugate.row(i).dot(g) / det) for i in range(3)]

    p = solution("fixed_part", rights)
    q = solution("growing_part", [sp.Rational(1, 2)] * len(rows))

    def product(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> sp.Expr:
        return a[0] * b[0] + a[1] * b[1] - a[2] * b[2]

    # L = <p + L q, p + L q>, its roots without cancellation
    two = define("quadratic_2", sp.Piecewise((product(q, q), enough > 0), (-1, True)))
    one = define("quadratic_1", 2 * product(p, q) - 1)
    zero = define("quadratic_0", product(p, p))
    root = define("quadratic_root", sp.sqrt(sp.Max(one**2 - 4 * two * zero, 0)))
    half = define("quadratic_half", -(one + sp.Piecewise((root, one > 0), (-root, True))) / 2)
    first, second = define("length_1", half / two), define("length_2", zero / half)
    other = sp.Abs(p[2] + first * q[2]) < sp.Abs(p[2] + second * q[2])
    length = define("length", sp.Piecewise((first, other), (second, True)))
    return (
        define("many_x", cx + scale * (p[0] + length * q[0])),
        define("many_y", cy + scale * (p[1] + length * q[1])),
        define("many_bias", scale * (p[2] + length * q[2])),
        enough,
    )


@lru_cache(maxsize=32)
def _solver(beacons: Beacons, cone: tuple[float, float], side: float, previous: bool) -> Block:
    return range_solver(beacons, cone=cone, side=side, previous=previous)


@checked
def locate(
    ranges: ArrayLike,
    beacons: Beacons,
    *,
    cone: tuple[float, float] = K06_CONE,
    side: float = 1.0,
    previous: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Return positions from ranges, by the equations of :func:`range_solver`.

    Parameters
    ----------
    ranges : array_like, shape (n_beacons, ...)
        Measured ranges [m]; nan where a beacon was not heard.
    beacons : Beacons
    cone : (float, float), optional
        Of the cone-angle error (5.7); (0, 0) for none.
    side : float, optional
        With two beacons only: 1 for positions left of the line from the first to the second, -1 right of it.
    previous : array_like, shape (2, ...), optional
        With more beacons: previous positions [m], which select the solution where two ranges were heard.

    Returns
    -------
    ndarray, shape (3, ...)
        x, y and the ranges' common error b [m]; nan where fewer than three beacons not in a line were heard.
        From two ranges b is 0; all are nan where the circles do not intersect, or neither `side` nor
        `previous` selects a solution.

    Raises
    ------
    InputError
        If the number of ranges differs from the number of beacons, `previous` has another shape, or as for
        :func:`range_solver`.

    Examples
    --------
    >>> square = Beacons([(0, 0), (2, 0), (2, 2), (0, 2)], 2.0)
    >>> locate([2.45, 2.45, 2.45, 2.45], square, cone=(0.0, 0.0)).round(4).tolist()
    [1.0, 1.0, 0.0005]
    >>> two = [6**0.5, 6**0.5, np.nan, np.nan]  # at (1, 1) or at (1, -1)
    >>> locate(two, square, cone=(0.0, 0.0), previous=[0.8, 0.9]).round(4).tolist()
    [1.0, 1.0, 0.0]
    """
    rho = np.asarray(ranges, dtype=float)
    n = len(beacons.positions)
    if rho.ndim == 0 or rho.shape[0] != n:
        raise InputError(f"locate: expected {n} ranges, one for each beacon, found shape {rho.shape}")
    heard = np.isfinite(rho)
    linear, quadratic = cone
    inputs = [np.where(heard, rho, 0.0), heard]
    if previous is not None:
        before = np.asarray(previous, dtype=float)
        if not 0 < before.ndim <= rho.ndim or before.shape[0] != 2:
            raise InputError(f"locate: previous: expected x and y, found shape {before.shape}")
        broadcastable("locate", ranges=rho[0], previous=before[0])
        spread = before.reshape(2, *(1,) * (rho.ndim - before.ndim), *before.shape[1:])
        before = np.broadcast_to(spread, (2, *rho.shape[1:]))
        known = np.isfinite(before).all(axis=0, keepdims=True)
        inputs += [np.where(known, before, 0.0), known]
    solver = _solver(beacons, (float(linear), float(quadratic)), side, previous is not None)
    solved = solver.to_numpy().outputs(0.0, (), np.concatenate(inputs))
    found: NDArray[np.float64] = np.where(solved[3] > 0, solved[:3], np.nan)
    return found
