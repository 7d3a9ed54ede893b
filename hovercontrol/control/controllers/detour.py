"""The shortest way along waypoints past circular obstacles, as a polyline with arcs in short pieces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError

#: Angle between two points of an arc [rad], and how often a way is bent around further obstacles.
PIECE, DEPTH = np.deg2rad(5.0), 6


class Way:
    """A polyline by its length.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        At least one [m].

    Attributes
    ----------
    length : float
        [m]
    """

    def __init__(self, points: Array) -> None:
        self._points = points[np.r_[True, np.hypot(*np.diff(points, axis=0).T) > 1e-9]]
        self._at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(self._points, axis=0).T))]
        self.length = float(self._at[-1])

    def at(self, s: Array) -> Array:
        """Return the points at lengths s [m] from the start, shape (2, n); beyond the end, the end."""
        return np.array([np.interp(s, self._at, column) for column in self._points.T], dtype=np.float64)

    def ahead(self, s: float) -> Array:
        """Return the point at a length s [m], shape (2,); beyond the end, on the last leg's extension."""
        legs = np.diff(self._points[-2:], axis=0)
        last = legs[0] / np.hypot(*legs[0]) if len(legs) else np.zeros(2)
        return self.at(np.array([s]))[:, 0] + max(0.0, s - self.length) * last

    def nearest(self, point: Array, begin: float, end: float) -> float:
        """Return the length [m] between `begin` and `end` at which the way is nearest to a point."""
        s = np.linspace(begin, min(max(end, begin), self.length), 50)
        return float(s[np.argmin(np.hypot(*(self.at(s) - point[:, None])))])


def way_around(points: Array, obstacles: Array) -> Way:
    """Return the way along points in order, around obstacles on the shorter side.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        [m]
    obstacles : ndarray, shape (n_obstacles, 3)
        Centre and radius of each circle [m].

    Raises
    ------
    InputError
        If a waypoint, other than the first point, lies within an obstacle.

    Examples
    --------
    A half circle of radius 1 m in the middle of 4 m: two tangents and an arc of 60 degrees.

    >>> way = way_around(np.array([[-2.0, 0.0], [2.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    >>> round(way.length, 2), round(float(2 * np.sqrt(3) + np.pi / 3), 2)
    (4.51, 4.51)
    """
    for k, point in enumerate(points[1:], 1):
        for cx, cy, radius in obstacles:
            if np.hypot(point[0] - cx, point[1] - cy) < radius:
                raise InputError(
                    f"waypoint {k} ({point[0]:g}, {point[1]:g}) m lies within {radius:g} m of the obstacle "
                    f"at ({cx:g}, {cy:g}) m (its radius and the clearance)"
                )
    found = [points[:1]]
    for a, b in pairwise(points):
        found.append(_leg(a, b, obstacles, DEPTH)[1:])
    return Way(np.concatenate(found))


def _leg(a: Array, b: Array, obstacles: Array, depth: int) -> Array:
    """Return the points of the way from a to b, both included."""
    length = float(np.hypot(*(b - a)))
    straight = np.array([a, b])
    if length < 1e-9 or not len(obstacles) or not depth:
        return straight
    along = (b - a) / length
    left = np.array([-along[1], along[0]])
    # s and d: position of each centre along and left of the leg
    s, d = (obstacles[:, :2] - a) @ along, (obstacles[:, :2] - a) @ left
    apart = np.hypot(s - np.clip(s, 0.0, length), d)
    depths = np.where(apart < obstacles[:, 2] * (1 - 1e-3), obstacles[:, 2] - apart, 0.0)
    worst = int(np.argmax(depths))
    if depths[worst] <= 0.0:
        return straight
    side = -1.0 if d[worst] > 0.0 else 1.0
    # The way is the upper convex hull of a, b and the circle, in the leg's coordinates.
    angles = np.arange(0.0, np.pi + PIECE / 2, PIECE)
    radius = obstacles[worst, 2] / np.cos(PIECE / 2)  # the pieces touch the circle
    arc = np.column_stack([s[worst] - radius * np.cos(angles), side * d[worst] + radius * np.sin(angles)])
    inside = arc[(arc[:, 0] > 0.0) & (arc[:, 0] < length) & (arc[:, 1] > 0.0)]
    hull: list[Array] = []
    for point in np.vstack([[0.0, 0.0], inside, [length, 0.0]]):
        while len(hull) > 1 and _turn(hull[-2], hull[-1], point) >= 0.0:
            hull.pop()
        hull.append(point)
    bent = np.array([a + p[0] * along + side * p[1] * left for p in hull])
    others = np.delete(obstacles, worst, axis=0)
    pieces = [_leg(p, q, others, depth - 1)[1:] for p, q in pairwise(bent)]
    return np.concatenate([bent[:1], *pieces])


def _turn(a: Array, b: Array, c: Array) -> float:
    """Return twice the area of a triangle, positive if it turns left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
