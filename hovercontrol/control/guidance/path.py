"""A path of straight legs flown by K06's laws, switched by events: the tracker that K06 chapter 7 sketches.

"One possible solution would be to combine the functionality of a path planner with a hybrid control strategy,
making use of the control laws presented in this thesis ... An event-driven controller would be implemented to
switch between the various continuous-time control laws" (K06 chapter 7).

The planner gives one corner after the other as the goal to K06's pose controller (section 2.3.1), which
points at it, drives, halts, turns to the next leg and rests; at rest the next leg begins. A craft without
drag keeps the direction of its momentum while it drives straight on, whatever its heading does, so that
deviations are corrected where it stops: long legs are divided.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.origin import GOAL, MODE, origin
from hovercontrol.control.guidance.waypoints import (
    ALONG_TRACK,
    CROSS_TRACK,
    LEG,
    POSITION,
    corner_signals,
    leg_ends,
    track,
    waypoint_array,
)
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body


@checked
def path_tracker(
    points: ArrayLike,
    *,
    surge: float = 0.4,
    slow_down: float = 0.4,
    position_tolerance: float = 0.25,
    heading_tolerance: float = math.radians(3.0),
    rest_energy: float = 3e-3,
    yaw_rate: float = 0.8,
    reverse_surge: float = 0.0,
    longest: float = math.inf,
    end_heading: float | None = None,
    period: float = 0.01,
    body: Body = HOVERDEMON_BODY,
    name: str = "guidance",
) -> Block:
    """Return the hybrid tracker of a path: a planner of legs and K06's pose controller.

    It sets the references of :func:`~hovercontrol.control.controllers.k06.drive`; with `reverse_surge`
    :func:`~hovercontrol.control.controllers.k06.both_ways`, whose stern may go first.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Corners of the path [m], n >= 2; the first leg begins at the first.
    surge, slow_down, yaw_rate, reverse_surge : float, optional
        As for :func:`~hovercontrol.control.controllers.k06.origin` [m/s, 1/s, rad/s, m/s].
    position_tolerance, heading_tolerance, rest_energy : float, optional
        The same [m, rad, J].
    longest : float, optional
        Legs longer than this [m] are divided into equal parts.
    end_heading : float, optional
        Heading at the end [rad]; default: that of the last leg.
    period : float, optional
        [s]
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs the motion; outputs ``surge_ref``, ``yaw_rate_ref``, ``mode`` (point, drive, halt,
        orient, rest), ``leg``, ``cross_track``, ``along_track`` [m] and the others of the pose controller.

    Raises
    ------
    InputError
        If there are fewer than two points, two in a row coincide, or a number is not positive.

    Examples
    --------
    >>> tracker = path_tracker([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    >>> tracker.period, tracker.signal("mode").modes
    (0.01, ('point', 'drive', 'halt', 'orient', 'rest'))
    """
    if not longest > 0.0:
        raise InputError(f"{name}: longest must be positive, found {longest!r}")
    path = _divided(waypoint_array(name, points), longest)
    heading = math.atan2(*(path[-1] - path[-2])[::-1]) if end_heading is None else end_heading
    planner = _planner(path, number(f"{name}: end_heading", heading), positive(f"{name}: period", period))
    pose = origin(
        surge=surge,
        slow_down=slow_down,
        position_tolerance=position_tolerance,
        heading_tolerance=heading_tolerance,
        rest_energy=rest_energy,
        yaw_rate=yaw_rate,
        reverse_surge=reverse_surge,
        period=period,
        body=body,
        name="pose",
    )
    return interconnect([planner, pose], name)


def _planner(path: np.ndarray, end_heading: float, period: float) -> Block:
    """Return the planner: its goal is the end of the leg; the next leg begins when the craft rests there."""
    corners = corner_signals(path)
    legs = len(path) - 1
    end = Signal("end_heading", "rad", "heading at the end", start=end_heading)
    present = LEG.replace(name="present_leg", description="number of the present leg")
    k = present.symbol
    now = leg_ends(corners, k, legs)
    after = leg_ends(corners, sp.Min(k + 1, legs - 1), legs)
    onward = sp.atan2(after["end_y"] - after["begin_y"], after["end_x"] - after["begin_x"])
    rests = sp.Eq(MODE.symbol, MODE.mode("rest"))
    return Block(
        "planner",
        states=(present,),
        inputs=(*POSITION, MODE),
        outputs=(*GOAL, LEG, CROSS_TRACK, ALONG_TRACK),
        parameters=(end, *(c for pair in corners for c in pair)),
        definitions=track(now),
        definition_signals=(CROSS_TRACK, ALONG_TRACK),
        derivatives={"present_leg": sp.Piecewise((k + 1, sp.And(rests, k < legs - 1)), (k, True))},
        output_expressions={
            "goal_x_ref": sp.Symbol("end_x", real=True),
            "goal_y_ref": sp.Symbol("end_y", real=True),
            "goal_heading_ref": sp.Piecewise((onward, k < legs - 1), (end.symbol, True)),
            "leg": k,
        },
        period=period,
    )


def _divided(path: np.ndarray, longest: float) -> np.ndarray:
    """Return a path with long legs divided."""
    parts = [path[:1]]
    for begin, end in pairwise(path):
        pieces = max(1, math.ceil(math.hypot(*(end - begin)) / longest))
        shares = np.arange(1, pieces + 1)[:, None] / pieces
        parts.append(begin + shares * (end - begin))
    return np.concatenate(parts)
