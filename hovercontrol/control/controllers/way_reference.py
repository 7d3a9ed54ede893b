"""The reference of a predictive controller along waypoints: position and heading over the horizon."""

from __future__ import annotations

import math

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.control.controllers.detour import Way, way_around
from hovercontrol.control.controllers.shooting import Stage

#: Least length of the way ahead that is searched for the point nearest to the craft [m], and in periods.
SEARCH = 0.25, 5


class WayReference:
    """The point that moves along the shortest way through waypoints, around obstacles.

    Parameters
    ----------
    stage : Stage
    waypoints : ndarray, shape (n, 2)
        [m]
    speed : float
        [m/s]
    stop : float
        Time in which the craft stops [s]: the point slows down before the last waypoint.
    heading : int
        Index of the state that is the heading, -1 for none.

    Attributes
    ----------
    waypoints : ndarray, shape (n, 2)
        [m]
    speed : float
        [m/s]
    """

    def __init__(self, stage: Stage, waypoints: Array, speed: float, stop: float, heading: int) -> None:
        self._stage, self.waypoints, self._heading = stage, waypoints, heading
        self.speed, self._stop = speed, stop
        self._reach = speed * stage.period
        self._way: Way | None = None

    def reset(self) -> None:
        """Begin the way anew at the next sample."""
        self._way = None

    def rows(self, progress: float, x0: Array, horizon: int) -> tuple[float, dict[int, Array]]:
        """Return the progress along the way [m], and references by the index of the state.

        Parameters
        ----------
        progress : float
            At the last sample [m].
        x0 : ndarray, shape (n_states,)
            Present state.
        horizon : int
            Number of periods N; each reference has shape (N + 1,).
        """
        stage, reach = self._stage, self._reach
        here = x0[list(stage.position)]
        if self._way is None:
            self._way = way_around(np.vstack([here, self.waypoints]), stage.obstacles)
        least, periods = SEARCH
        progress = self._way.nearest(here, progress, progress + max(periods * reach, least))
        ahead = self._way.at(self._moved(progress, np.arange(1.0, horizon + 2.0) * stage.period))
        found = dict(zip(stage.position, ahead, strict=True))
        # the heading points to the way's point a horizon ahead, as the line of sight does
        goal = self._way.ahead(progress + reach * (horizon + 1)) - here
        return progress, found | {self._heading: np.full(horizon + 1, math.atan2(goal[1], goal[0]))}

    def _moved(self, s: float, times: Array) -> Array:
        """Return the length of the way after some times [s], with ``s' = min(speed, (L - s)/stop)``."""
        assert self._way
        length, braking = self._way.length, self.speed * self._stop
        if not braking:
            return s + self.speed * times
        # at full speed until L - s = speed stop, then L - s falls by e in each time `stop`
        free = max(0.0, length - braking - s) / self.speed
        slow = np.maximum(0.0, times - free) / self._stop
        left = length - s - self.speed * np.minimum(times, free)
        return length - left * np.exp(-slow)
