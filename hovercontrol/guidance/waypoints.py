"""Line-of-sight guidance along straight legs between waypoints, with switching by circles of acceptance.

Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley 2011, sections 10.3 and 12.2 (below:
F). With ``chi_p`` the direction of the leg from p_k to p_(k+1),

``along = (x - x_k) cos chi_p + (y - y_k) sin chi_p``, ``cross = -(x - x_k) sin chi_p + (y - y_k) cos chi_p``,

``course_ref = chi_p - atan(cross/lookahead)``  [F eq 10.59, 10.72, 10.73].
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.controllers.k06.laws import SURGE_REF
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError
from hovercontrol.io.tables import number, positive
from hovercontrol.models.model import MOTION

#: Period of sampled guidance [s].
PERIOD = 0.02

COURSE_REF = Signal("course_ref", "rad", "wanted course, not wrapped")
CROSS_TRACK = Signal("cross_track", "m", "distance to the left of the leg")
ALONG_TRACK = Signal("along_track", "m", "distance along the leg from its beginning")
TO_GO = Signal("to_go", "m", "distance from the waypoint ahead")
LEG = Signal("leg", "1", "number of the leg, from 0; the number of legs after the last waypoint")

_POSITION = tuple(s for s in MOTION if s.name in ("x", "y"))


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
        (cross + kappa s)^2)`` [F eq 10.74]; s begins at zero on each leg.
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
    sizes = {
        "lookahead": Signal("lookahead", "m", "distance ahead that the course points at", start=lookahead),
        "acceptance": Signal("acceptance", "m", "radius of the circle of acceptance", start=acceptance),
        "surge": Signal("surge", "m/s", "surge command under way", start=surge),
    }
    for key, signal in sizes.items():
        positive(f"{name}: {key}", signal.start)
    if not 0.0 <= number(f"{name}: integral", integral) < math.inf:
        raise InputError(f"{name}: integral must not be negative, found {integral!r}")
    positive(f"{name}: period", period)
    corners = [
        (Signal(f"x_{k}", "m", "waypoint", start=px), Signal(f"y_{k}", "m", "waypoint", start=py))
        for k, (px, py) in enumerate(path)
    ]
    legs = len(path) if closed else len(path) - 1
    last_leg = LEG.replace(name="last_leg", description="the leg at the last tick")
    ahead, radius, speed = (s.symbol for s in sizes.values())
    x, y = (s.symbol for s in _POSITION)
    now, before = LEG.symbol, last_leg.symbol
    flown = {"before": before, "now": sp.Min(now, legs - 1)}
    values: dict[str, sp.Expr] = {}
    for when, leg in flown.items():
        for key, value in leg_ends(corners, leg, legs).items():
            values[f"{key}_{when}"] = value
    begin_x, begin_y, end_x, end_y = (
        sp.Symbol(f"{key}_now", real=True) for key in ("begin_x", "begin_y", "end_x", "end_y")
    )
    former = {key: sp.Symbol(f"{key}_before", real=True) for key in ("begin_x", "begin_y", "end_x", "end_y")}
    left_x, left_y = former["end_x"] - x, former["end_y"] - y
    forward = left_x * (former["end_x"] - former["begin_x"]) + left_y * (former["end_y"] - former["begin_y"])
    reached = sp.Or(left_x**2 + left_y**2 <= radius**2, forward <= 0)
    after = sp.Piecewise((0, before >= legs - 1), (before + 1, True)) if closed else before + 1
    under_way = sp.true if closed else before < legs
    direction = sp.Symbol("leg_direction", real=True)
    cross = CROSS_TRACK.symbol
    offset: sp.Expr = cross
    states, updates = [last_leg], {"last_leg": now}
    parameters = [*sizes.values()]
    if integral:
        kappa = Signal("integral", "m/s", "gain of the integral", start=integral)
        last = Signal("last_integral", "s", "integral of the cross-track error over the distance squared")
        tick = Signal("period", "s", "of the ticks, fixed", start=period, lower=period, upper=period)
        parameters += [kappa, tick]
        values["integral_now"] = sp.Piecewise((last.symbol, sp.Eq(now, before)), (0, True))
        s = sp.Symbol("integral_now", real=True)
        offset = cross + kappa.symbol * s
        states.append(last)
        updates["last_integral"] = s + tick.symbol * ahead * cross / (ahead**2 + offset**2)
    # The wanted course, as the whole turn that is nearest to the last one.
    last_course = COURSE_REF.replace(name="last_course", start=float(np.arctan2(*(path[1] - path[0])[::-1])))
    states.append(last_course)
    wanted = direction - sp.atan(offset / ahead) - last_course.symbol
    moving = now < legs if not closed else sp.true
    turn = sp.Piecewise((sp.atan2(sp.sin(wanted), sp.cos(wanted)), moving), (0, True))
    updates["last_course"] = COURSE_REF.symbol
    return Block(
        name,
        states=tuple(states),
        inputs=_POSITION,
        outputs=(COURSE_REF, SURGE_REF, CROSS_TRACK, ALONG_TRACK, TO_GO, LEG),
        parameters=(*parameters, *(c for pair in corners for c in pair)),
        definitions={
            **values,
            "leg": sp.Piecewise((after, sp.And(under_way, reached)), (before, True)),
            "leg_direction": sp.atan2(end_y - begin_y, end_x - begin_x),
            "along_track": (x - begin_x) * sp.cos(direction) + (y - begin_y) * sp.sin(direction),
            "cross_track": -(x - begin_x) * sp.sin(direction) + (y - begin_y) * sp.cos(direction),
            "to_go": sp.sqrt((end_x - x) ** 2 + (end_y - y) ** 2),
            "course_ref": last_course.symbol + turn,
        },
        definition_signals=(LEG, ALONG_TRACK, CROSS_TRACK, TO_GO, COURSE_REF),
        derivatives=updates,
        output_expressions={"surge_ref": sp.Piecewise((speed, moving), (0, True))},
        period=period,
    )


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
