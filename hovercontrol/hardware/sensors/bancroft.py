"""A position from ranges in closed form: Bancroft's method, K06 (5.6); of two beacons, where circles meet.

S. Bancroft, "An algebraic solution of the GPS equations", IEEE Trans. Aerospace and Electronic Systems 21,
1985; here in the plane, with beacons at known heights.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.block import Block
from hovercontrol.errors import InputError
from hovercontrol.expressions import Definitions
from hovercontrol.hardware.sensors.beacons import NARROW, Beacons
from hovercontrol.hardware.sensors.cone import K06_CONE, cone_signals, correction_definitions
from hovercontrol.signals import Signal

#: Circles that miss each other by less, as a part of the range squared, touch: rounding, not noise.
TOUCHING = 1e-9

#: Tells which unit's ranges there are.
RANGE_UNIT = Signal("range_unit", "1", "which unit's ranges these are, from 1; 0 for none")

#: Which of the two places that two beacons leave.
_SIDE = Signal("side", "1", "of the line from beacon 1 to 2: 1 left, -1 right", lower=-1.0, upper=1.0)


def range_signals(count: int) -> tuple[tuple[Signal, ...], tuple[Signal, ...]]:
    """Return the signals ``range_1...`` [m] and ``range_1_heard...`` (0 or 1)."""
    numbers = range(1, count + 1)
    ranges = tuple(Signal(f"range_{k}", "m", f"measured range to beacon {k}", nominal=2.7) for k in numbers)
    heard = tuple(Signal(f"range_{k}_heard", "1", "1 where the beacon was heard", start=1.0) for k in numbers)
    return ranges, heard


def range_solver(
    beacons: Beacons,
    *,
    cone: tuple[float, float] = K06_CONE,
    side: float = 1.0,
    name: str = "range_solver",
) -> Block:
    """Return the position of a unit from its ranges.

    Each range is corrected for its cone angle, then the equations
    ``rho_i = sqrt((x - x_i)^2 + (y - y_i)^2 + h_i^2) + b`` (5.6) are solved: with
    ``L = x^2 + y^2 - b^2`` they are linear in x, y and b, by least squares beyond three beacons, and L then
    solves a quadratic. Of its two roots the one with the smaller b is taken: the other has b of about twice
    the range.

    Exactly two beacons cannot tell b, which is taken for zero: their ranges are two circles on the floor,
    which meet on either side of the line between them.

    Parameters
    ----------
    beacons : Beacons
        As surveyed; their places are parameters.
    cone : (float, float), optional
        Of the cone-angle error (5.7); (0, 0) for none.
    side : float, optional
        Of two beacons only, where it is a parameter too: 1 for a place left of the line from the first to
        the second, -1 for one right of it.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``range_1...`` [m] and ``range_1_heard...`` (0 or 1); outputs ``solved_x, solved_y``,
        ``solved_bias`` (b) [m] and ``solved``: 1 where three beacons out of line were heard; of two
        beacons where both were heard and the circles meet. No states.

    Raises
    ------
    InputError
        If a coefficient of `cone` is no finite number, or `side` not 1 or -1.

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
    ranges, heard = range_signals(len(beacons.positions))
    places = beacons.signals()
    definitions: dict[str, sp.Expr] = {}
    corrected = []
    for k, (rho, place) in enumerate(zip(ranges, places, strict=True), 1):
        definitions |= correction_definitions(rho.symbol, place[2].symbol, f"_{k}")
        corrected.append(sp.Symbol(f"range_corrected_{k}", real=True))
    chosen = (_SIDE.but(start=float(side)),) if len(places) == 2 else ()
    definitions |= (_circles if chosen else _bancroft)(
        [tuple(s.symbol for s in place) for place in places], corrected, [s.symbol for s in heard]
    )
    return Block(
        name,
        inputs=(*ranges, *heard),
        outputs=(
            Signal("solved_x", "m", "position of the unit, earth frame"),
            Signal("solved_y", "m", "position of the unit, earth frame"),
            Signal("solved_bias", "m", "what all ranges are too long by, b in (5.6)"),
            Signal("solved", "1", "1 where the ranges give a position"),
        ),
        parameters=(*(s for place in places for s in place), *cone_signals(cone, name), *chosen),
        output_expressions={"solved_bias": sp.S.Zero} if chosen else {},
        definitions=definitions,
    )


def _circles(
    places: Sequence[tuple[sp.Symbol, ...]], ranges: Sequence[sp.Symbol], heard: Sequence[sp.Symbol]
) -> dict[str, sp.Expr]:
    """Return definitions that lead to solved_x, solved_y and solved, of two beacons."""
    define = Definitions()

    # From the first beacon, in units of its height.
    (x1, y1, scale), (x2, y2, _) = places
    dx, dy = define("line_x", (x2 - x1) / scale), define("line_y", (y2 - y1) / scale)
    length = define("line_squared", dx**2 + dy**2)
    first, second = (
        define(f"floor_{k}_squared", (rho - h) * (rho + h) / scale**2)
        for k, (rho, (_, _, h)) in enumerate(zip(ranges, places, strict=True), 1)
    )
    there = define("both_heard", sp.Piecewise((1, heard[0] * heard[1] * length > 0), (0, True)))
    divisor = define("divisor", sp.Piecewise((length, length > 0), (1, True)))
    # As parts of the line: how far along it the place is, and how far beside it, squared.
    along = define("along", (first - second + length) / (2 * divisor))
    across = define("beside_squared", first / divisor - along**2)
    beside = define("beside", sp.sqrt(sp.Max(across, 0)) * sp.Piecewise((1, _SIDE.symbol > 0), (-1, True)))
    missed = -across * length > TOUCHING * (ranges[0] / scale) ** 2
    define("solved_x", x1 + scale * (along * dx - beside * dy))
    define("solved_y", y1 + scale * (along * dy + beside * dx))
    define("solved", there * sp.Piecewise((0, missed), (1, True)))
    return define


def _bancroft(
    places: Sequence[tuple[sp.Symbol, ...]], ranges: Sequence[sp.Symbol], heard: Sequence[sp.Symbol]
) -> dict[str, sp.Expr]:
    """Return definitions that lead to solved_x, solved_y, solved_bias and solved."""
    define = Definitions()

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
    enough = define("solved", sp.Piecewise((1, sp.And(count > sp.Rational(5, 2), out_of_line)), (0, True)))
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
    define("solved_x", cx + scale * (p[0] + length * q[0]))
    define("solved_y", cy + scale * (p[1] + length * q[1]))
    define("solved_bias", scale * (p[2] + length * q[2]))
    return define


@lru_cache(maxsize=32)
def _solver(beacons: Beacons, cone: tuple[float, float], side: float) -> Block:
    return range_solver(beacons, cone=cone, side=side)


def locate(
    ranges: ArrayLike, beacons: Beacons, *, cone: tuple[float, float] = K06_CONE, side: float = 1.0
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
        Of two beacons only: 1 for places left of the line from the first to the second, -1 right of it.

    Returns
    -------
    ndarray, shape (3, ...)
        x, y and the ranges' common error b [m]; nan where fewer than three beacons out of line were heard.
        Of two beacons b is 0, and all nan where one was not heard or the ranges do not meet.

    Raises
    ------
    InputError
        If the number of ranges is not that of the beacons, or as of :func:`range_solver`.

    Examples
    --------
    >>> square = Beacons([(0, 0), (2, 0), (2, 2), (0, 2)], 2.0)
    >>> locate([2.45, 2.45, 2.45, 2.45], square, cone=(0.0, 0.0)).round(4).tolist()
    [1.0, 1.0, 0.0005]
    """
    rho = np.asarray(ranges, dtype=float)
    n = len(beacons.positions)
    if rho.ndim == 0 or rho.shape[0] != n:
        raise InputError(f"locate: expected {n} ranges, one a beacon, found shape {rho.shape}")
    heard = np.isfinite(rho)
    linear, quadratic = cone
    inputs = np.concatenate([np.where(heard, rho, 0.0), heard])
    solved = _solver(beacons, (float(linear), float(quadratic)), side).to_numpy().outputs(0.0, (), inputs)
    found: NDArray[np.float64] = np.where(solved[3] > 0, solved[:3], np.nan)
    return found
