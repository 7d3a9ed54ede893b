"""Positions of the beacons of a ranging system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import pair

#: Beacons whose smaller spread is less than this part of the larger one hang in a line, two that are less
#: than this part of their height apart in one place.
NARROW = 1e-3


@checked
@dataclass(frozen=True)
class Beacons:
    """Beacons above the floor.

    Parameters
    ----------
    positions : sequence of (float, float)
        Positions over the floor, earth frame [m]: two different ones, or more that are not in a line. Two
        determine a position and its mirror image, see
        :func:`~hovercontrol.craft.hardware.sensors.bancroft.range_solver`.
    heights : float or sequence of float
        Heights above the units that hear them [m].

    Raises
    ------
    InputError
        If there are fewer than two, two coincide, more are in a line, or a height is not positive.

    Examples
    --------
    >>> len(Beacons([(0, 0), (2, 0), (0, 2)], 2.5).heights)
    3
    """

    positions: tuple[tuple[float, float], ...]
    heights: tuple[float, ...]

    def __init__(self, positions: Sequence[Sequence[float]], heights: float | Sequence[float]) -> None:
        if not hasattr(positions, "__len__"):
            raise InputError(f"beacons: expected a sequence of positions, found {positions!r}")
        places = tuple(pair(f"beacon {k}: position", p) for k, p in enumerate(positions, 1))
        if len(places) < 2:
            raise InputError(f"beacons: expected at least two, found {len(places)}")
        above = heights if isinstance(heights, Sequence | np.ndarray) else [heights] * len(places)
        if len(above) != len(places):
            raise InputError(f"beacons: expected {len(places)} heights, found {len(above)}")
        checked = tuple(positive(f"beacon {k}: height", h) for k, h in enumerate(above, 1))
        if len(places) == 2 and math.dist(*places) <= NARROW * max(checked):
            raise InputError(f"beacons: expected two different positions, found {places}")
        spread = np.linalg.svd(np.array(places) - np.mean(places, axis=0), compute_uv=False)
        if len(places) > 2 and spread[1] <= NARROW * spread[0]:
            raise InputError(f"beacons: expected positions that are not in a line, found {places}")
        object.__setattr__(self, "positions", places)
        object.__setattr__(self, "heights", checked)

    def signals(self) -> tuple[tuple[Signal, Signal, Signal], ...]:
        """Return parameters for each beacon: ``beacon_1_x, beacon_1_y, beacon_1_height`` and so on [m]."""
        text = "position of the beacon, earth frame"
        return tuple(
            (
                Signal(f"beacon_{k}_x", "m", text, start=x),
                Signal(f"beacon_{k}_y", "m", text, start=y),
                Signal(f"beacon_{k}_height", "m", "height above the unit", start=h, lower=1e-3),
            )
            for k, ((x, y), h) in enumerate(zip(self.positions, self.heights, strict=True), 1)
        )


@checked
def k06_beacons() -> Beacons:
    """Return four beacons on the corners of a square of 2.44 m, 2.7048 m up.

    The height is that of K06's table 5.2; K06 does not print the positions of its beacons.

    Examples
    --------
    >>> k06_beacons().positions[0]
    (0.0, 0.0)
    """
    side = 2.44
    return Beacons([(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)], 2.7048)
