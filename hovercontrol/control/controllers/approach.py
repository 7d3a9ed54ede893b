"""Whether a predictive controller brought its plant to its reference or its waypoints, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.simulation.response import Response

#: A reference is reached if the error is within this share of the first one, as for a settling time; and it
#: comes no closer if the error falls by less than this share of what it fell so far in a quarter of the run.
SETTLED = 0.05


class Passed(NamedTuple):
    """How near a waypoint was passed.

    Attributes
    ----------
    point : tuple of float
        x and y [m].
    distance : float
        The least, after the waypoint before it [m].
    time : float
        Then [s].
    """

    point: tuple[float, float]
    distance: float
    time: float


class ControlledResponse(Response):
    """The response of a plant under a predictive controller, from :meth:`MPC.simulate`.

    Attributes
    ----------
    failures : tuple of float
        Times of the samples at which the solver failed and the last plan went on [s].
    waypoints : tuple of Passed
        How near each waypoint was passed; empty without waypoints.
    status : str
        ``"reached"``, ``"on the way"``, or what was not reached and by how much.
    obstacles : ndarray, shape (n, 3)
        x, y and radius [m].
    plans : ndarray, shape (samples, horizon + 1, 2)
        The predicted positions at each sample [m]; empty for a plant without a position.
    """

    failures: tuple[float, ...]
    waypoints: tuple[Passed, ...]
    status: str
    obstacles: Array
    plans: Array

    @property
    def reached(self) -> bool:
        """Whether the reference, or each waypoint and at the end the last one, is reached."""
        return self.status == "reached"

    def __repr__(self) -> str:
        lines = [super().__repr__(), f"    {self.status}"]
        lines += [f"    waypoint {p.point}: {p.distance:.3g} m at {p.time:.4g} s" for p in self.waypoints]
        if self.failures:
            lines.append(f"    the last plan went on at {len(self.failures)} samples")
        return "\n".join(lines)


def passed(time: Array, path: Array, points: Array, acceptance: float) -> tuple[Passed, ...]:
    """Return how near each point was passed, in order.

    Parameters
    ----------
    time : ndarray, shape (n_times,)
        [s]
    path : ndarray, shape (2, n_times)
        [m]
    points : ndarray, shape (n_points, 2)
        [m]
    acceptance : float
        The next point counts from the first time within this distance on [m].
    """
    found, begin = [], 0
    for x, y in points:
        d = np.hypot(path[0, begin:] - x, path[1, begin:] - y)
        nearest = int(np.argmin(d))
        found.append(Passed((float(x), float(y)), float(d[nearest]), float(time[begin + nearest])))
        begin += int(np.argmax(d <= acceptance)) if d[nearest] <= acceptance else nearest
    return tuple(found)


def way_status(time: Array, path: Array, waypoints: Sequence[Passed], acceptance: float, speed: float) -> str:
    """Return the status of a run along waypoints; arguments as for :func:`passed`.

    Parameters
    ----------
    waypoints : sequence of Passed
    speed : float
        Of the reference [m/s].
    """
    late = time >= time[0] + 0.75 * (time[-1] - time[0])
    missed: list[str] = []
    for k, point in enumerate(waypoints, 1):
        d = np.hypot(path[0] - point.point[0], path[1] - point.point[1])[late]
        closer = float(d[0] - d[-1])
        last = k == len(waypoints)
        where = f"waypoint {k} ({point.point[0]:g}, {point.point[1]:g}) m"
        if point.distance > acceptance:
            if closer > SETTLED * speed * float(np.ptp(time[late])):
                return "; ".join(missed) or "on the way"
            missed.append(f"{where} is not reached: {point.distance:.3g} m off at {point.time:.4g} s")
        elif last and d[-1] > acceptance:
            missed.append(f"{where} is passed at {point.time:.4g} s and {d[-1]:.3g} m away at the end")
    return "; ".join(missed) or "reached"


def reference_status(errors: Array, names: Sequence[str], units: Sequence[str], weights: Array) -> str:
    """Return the status of a run to a reference.

    Parameters
    ----------
    errors : ndarray, shape (n_samples, n_states)
        Reference minus state [unit], of the states with a weight.
    names, units : sequence of str
    weights : ndarray, shape (n_states,)
        [1/unit^2]
    """
    size = np.sqrt(errors**2 @ weights)
    quarter = max(1, len(size) // 4)
    first, before, last = size[0], size[-2 * quarter : -quarter], size[-quarter:]
    if not before.size or np.mean(last) <= SETTLED * first:
        return "reached"
    if np.mean(before) - np.mean(last) > SETTLED * max(first - np.mean(last), SETTLED * first):
        return "on the way"
    off = errors[-1]
    k = int(np.argmax(weights * off**2))
    return f"{names[k]} stays {abs(off[k]):.3g} {units[k]} from its reference".replace(" 1 from", " from")
