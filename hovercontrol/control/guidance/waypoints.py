"""Line-of-sight guidance along straight legs between waypoints, with switching by circles of acceptance.

Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley 2011, section 10.3. With ``chi_p``
the direction of the leg from p_k to p_(k+1),

``along = (x - x_k) cos chi_p + (y - y_k) sin chi_p``, ``cross = -(x - x_k) sin chi_p + (y - y_k) cos chi_p``,

``course_ref = chi_p - atan(cross/lookahead)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.laws import SURGE_REF
from hovercontrol.craft.models.motion import MOTION

#: Period of sampled guidance [s].
PERIOD = 0.02

COURSE_REF = Signal("course_ref", "rad", "wanted course, not wrapped")
CROSS_TRACK = Signal("cross_track", "m", "distance to the left of the leg")
ALONG_TRACK = Signal("along_track", "m", "distance along the leg from its beginning")
TO_GO = Signal("to_go", "m", "distance from the waypoint ahead")
LEG = Signal("leg", "1", "number of the leg, from 0; the number of legs after the last waypoint")

POSITION = tuple(s for s in MOTION if s.name in ("x", "y"))


@checked
def line_of_sight(
    points: ArrayLike,
    *,
    lookahead: float = 3.0,
    acceptance: float = 1.0,
    surge: float = 0.5,
    integral: float = 0.0,
    closed: bool = False,
    period: float = PERIOD,
    name: str = "guidance",
) -> Block:
    """Return line-of-sight guidance through waypoints.

    Where the craft comes within the circle of acceptance of the waypoint ahead, or passes it, the next leg
    begins. After the last waypoint the surge command is zero and the last course is held.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Waypoints [m], n >= 2; the first leg begins at the first.
    lookahead : float, optional
        Distance ahead on the leg that the course points at [m].
    acceptance : float, optional
        Radius of the circles of acceptance [m].
    surge : float, optional
        Surge command under way [m/s].
    integral : float, optional
        Gain kappa [m/s] of integral line of sight against currents and sideslip, 0: none. The course is then
        ``chi_p - atan((cross + kappa s)/lookahead)`` with ``s' = lookahead cross/(lookahead^2 +
        (cross + kappa s)^2)`` (Borhaug, Pavlov, Pettersen, "Integral LOS control for path following of
        underactuated marine surface vessels in the presence of constant ocean currents", CDC 2008); s begins
        at zero on each leg.
    closed : bool, optional
        Go on from the last waypoint to the first, round after round.
    period : float, optional
        [s]
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``x, y`` [m]; outputs ``course_ref`` [rad], continuous from leg to leg but for the
        shortest turn, ``surge_ref`` [m/s], ``cross_track``, ``along_track``, ``to_go`` [m] and ``leg``. The
        waypoints are parameters ``x_0, y_0, ...``.

    Raises
    ------
    InputError
        If there are fewer than two points, two in a row coincide, or a number is not positive.

    Examples
    --------
    >>> los = line_of_sight([[0.0, 0.0], [10.0, 0.0]], lookahead=2.0).in_continuous_time
    >>> [s.name for s in los.outputs][:3]
    ['course_ref', 'surge_ref', 'cross_track']
    """
    path = waypoint_array(name, points, closed)
    p = {
        "lookahead": Signal("lookahead", "m", "lookahead distance on the leg", start=lookahead),
        "acceptance": Signal("acceptance", "m", "radius of the circle of acceptance", start=acceptance),
        "surge": Signal("surge", "m/s", "surge command under way", start=surge),
    }
    for key, signal in p.items():
        positive(f"{name}: {key}", signal.start)
    not_negative(f"{name}: integral", integral)
    positive(f"{name}: period", period)
    if integral:
        p["integral"] = Signal("integral", "m/s", "gain of the integral", start=integral)
        p["period"] = Signal("period", "s", "of the ticks, fixed", start=period, lower=period, upper=period)
    k = {key: signal.symbol for key, signal in p.items()}
    corners = corner_signals(path)
    legs = len(path) if closed else len(path) - 1
    offset, states, summed, updates = _integral(k) if integral else (CROSS_TRACK.symbol, [], {}, {})
    # The wanted course, as the whole turn that is nearest to the last one.
    last_course = COURSE_REF.replace(name="last_course", start=math.atan2(*(path[1] - path[0])[::-1]))
    wanted = _DIRECTION - sp.atan(offset / k["lookahead"]) - last_course.symbol
    moving = sp.true if closed else LEG.symbol < legs
    turn = sp.Piecewise((sp.atan2(sp.sin(wanted), sp.cos(wanted)), moving), (0, True))
    return Block(
        name,
        states=(_LAST_LEG, *states, last_course),
        inputs=POSITION,
        outputs=(COURSE_REF, SURGE_REF, CROSS_TRACK, ALONG_TRACK, TO_GO, LEG),
        parameters=(*p.values(), *(c for pair in corners for c in pair)),
        definitions={
            **_switching(corners, legs, closed, k["acceptance"]),
            **track(leg_ends(corners, sp.Min(LEG.symbol, legs - 1), legs)),
            **summed,
            "course_ref": last_course.symbol + turn,
        },
        definition_signals=(LEG, ALONG_TRACK, CROSS_TRACK, TO_GO, COURSE_REF),
        derivatives={"last_leg": LEG.symbol, "last_course": COURSE_REF.symbol, **updates},
        output_expressions={"surge_ref": sp.Piecewise((k["surge"], moving), (0, True))},
        period=period,
    )


_LAST_LEG = LEG.replace(name="last_leg", description="leg at the last tick")
_DIRECTION = sp.Symbol("leg_direction", real=True)
_X, _Y = (s.symbol for s in POSITION)


def _switching(
    corners: Sequence[tuple[Signal, Signal]], legs: int, closed: bool, radius: sp.Symbol
) -> dict[str, sp.Expr]:
    """Return the leg: the next one where the waypoint ahead is near, or passed."""
    before = _LAST_LEG.symbol
    ends = {f"{key}_before": e for key, e in leg_ends(corners, before, legs).items()}
    begin_x, begin_y, end_x, end_y = (sp.Symbol(key, real=True) for key in ends)
    left_x, left_y = end_x - _X, end_y - _Y
    passed = left_x * (end_x - begin_x) + left_y * (end_y - begin_y) <= 0
    reached = sp.Or(left_x**2 + left_y**2 <= radius**2, passed)
    if closed:
        after, may = sp.Piecewise((0, before >= legs - 1), (before + 1, True)), sp.true
    else:
        after, may = before + 1, before < legs
    return {**ends, "leg": sp.Piecewise((after, sp.And(may, reached)), (before, True))}


def _integral(
    k: dict[str, sp.Symbol],
) -> tuple[sp.Expr, list[Signal], dict[str, sp.Expr], dict[str, sp.Expr]]:
    """Return the offset of integral line of sight, its state, its definition and its next value."""
    last = Signal("last_integral", "s", "integral s of integral line of sight")
    now = sp.Symbol("integral_now", real=True)
    begun = sp.Piecewise((last.symbol, sp.Eq(LEG.symbol, _LAST_LEG.symbol)), (0, True))
    cross, ahead = CROSS_TRACK.symbol, k["lookahead"]
    offset = cross + k["integral"] * now
    # s' = lookahead cross/(lookahead^2 + (cross + kappa s)^2)
    following = now + k["period"] * ahead * cross / (ahead**2 + offset**2)
    return offset, [last], {"integral_now": begun}, {"last_integral": following}


def track(ends: dict[str, sp.Expr]) -> dict[str, sp.Expr]:
    """Return the definitions of a leg's ends and direction, and of the distances along and across it.

    Parameters
    ----------
    ends : dict of str to sympy.Expr
        By :func:`leg_ends`.
    """
    begin_x, begin_y, end_x, end_y = (sp.Symbol(key, real=True) for key in ends)
    cos, sin = sp.cos(_DIRECTION), sp.sin(_DIRECTION)
    return {
        **ends,
        "leg_direction": sp.atan2(end_y - begin_y, end_x - begin_x),
        "along_track": (_X - begin_x) * cos + (_Y - begin_y) * sin,
        "cross_track": -(_X - begin_x) * sin + (_Y - begin_y) * cos,
        "to_go": sp.sqrt((end_x - _X) ** 2 + (end_y - _Y) ** 2),
    }


def corner_signals(path: np.ndarray) -> list[tuple[Signal, Signal]]:
    """Return the waypoints as parameters ``x_0, y_0, ...`` [m]."""
    return [
        (Signal(f"x_{k}", "m", "waypoint", start=px), Signal(f"y_{k}", "m", "waypoint", start=py))
        for k, (px, py) in enumerate(path)
    ]


def leg_ends(corners: Sequence[tuple[Signal, Signal]], leg: sp.Expr, legs: int) -> dict[str, sp.Expr]:
    """Return beginning and end of the leg of a number, by Piecewise over the legs."""
    found = {}
    for key, end, axis in (("begin_x", 0, 0), ("begin_y", 0, 1), ("end_x", 1, 0), ("end_y", 1, 1)):
        each = [corners[(k + end) % len(corners)][axis].symbol for k in range(legs)]
        found[key] = sp.Piecewise(
            *((value, leg < k + sp.Rational(1, 2)) for k, value in enumerate(each[:-1])), (each[-1], True)
        )
    return found


def waypoint_array(name: str, points: ArrayLike, closed: bool = False) -> np.ndarray:
    """Return waypoints as an array of shape (n, 2)."""
    try:
        path = np.asarray(points, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: points must be numbers, found {points!r:.60}") from None
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2:
        raise InputError(f"{name}: expected n >= 2 points of shape (n, 2), found the shape {path.shape}")
    if not np.isfinite(path).all():
        raise InputError(f"{name}: points must be finite")
    round_trip = np.vstack([path, path[:1]]) if closed else path
    lengths = np.hypot(*np.diff(round_trip, axis=0).T)
    if lengths.min() == 0.0:
        k = int(lengths.argmin())
        raise InputError(f"{name}: points {k} and {(k + 1) % len(path)} coincide")
    return path
