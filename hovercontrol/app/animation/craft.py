"""The drawing of a craft from above: its outline, and arrows of the forces of its commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.app.animation.motion import Motion
from hovercontrol.base.arrays import Array
from hovercontrol.craft.models.model import Model

#: Length and width of C17's craft [m], for a craft whose fans do not tell its size.
LENGTH, WIDTH = 0.45, 0.25

#: The outline, bow ahead, of length and width 1.
OUTLINE = np.array([[0.5, 0.0], [0.28, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.28, -0.5]])

#: That of a machine without a heading, of diameter 1.
ROUND = 0.5 * np.stack([np.cos(np.linspace(0.0, 6.2, 24)), np.sin(np.linspace(0.0, 6.2, 24))], axis=1)

#: The hull is drawn at least this part of the map's larger side, or nobody would see it.
SMALLEST = 1 / 14

#: The arrow of the upper quartile of all forces is as long as the hull; the longest is this many hulls.
QUARTILE, LONGEST = 0.75, 2.0

#: Forces below this part of the largest do not count in that.
FAINT = 0.01

#: Room around the path, in lengths of the hull.
MARGIN = 1.5

#: The hull reaches this factor beyond the fans.
BEYOND = 1.5


@dataclass(frozen=True, eq=False)
class Arrow:
    """A force on the hull over time.

    Attributes
    ----------
    place : ndarray, shape (2,)
        Where it acts in the body frame [m].
    force : ndarray, shape (2, n)
        To the bow and to port, as arrow length over hull length.
    """

    place: Array
    force: Array


@dataclass(frozen=True, eq=False)
class Craft:
    """The drawing of a craft.

    Attributes
    ----------
    outline : ndarray, shape (k, 2)
        Body frame [m].
    enlarged : float
        Ratio of the drawn to the actual size of the hull.
    arrows : tuple of Arrow
    """

    outline: Array
    enlarged: float
    arrows: tuple[Arrow, ...]

    @property
    def length(self) -> float:
        """Length of the hull as drawn [m]."""
        return float(np.ptp(self.outline[:, 0]))


def craft_of(motion: Motion, model: Model | None, *, forces: bool = True) -> Craft:
    """Return the drawing of the craft of a motion."""
    model = model or motion.model
    size = _size(model)
    rows = [(motion.x, motion.y), (motion.reference.get("x"), motion.reference.get("y"))]
    sides = [np.ptp(np.concatenate([row[k] for row in rows if row[k] is not None])) for k in (0, 1)]
    enlarged = max(1.0, SMALLEST * float(max(sides)) / size[0])
    arrows = _arrows(motion, model, size) if forces else []
    outline = OUTLINE * size if motion.headed else ROUND * size.min()
    return Craft(outline * enlarged, enlarged, _scaled(arrows, enlarged))


def _scaled(arrows: list[Arrow], enlarged: float) -> tuple[Arrow, ...]:
    """Return arrows for a hull of length 1, scaled by quantiles: a short peak does not shrink the others."""
    sizes = [np.hypot(*a.force) for a in arrows]
    largest = max((float(s.max()) for s in sizes), default=0.0)
    if largest <= 0.0:
        return ()
    seen = np.concatenate(sizes)
    one = float(np.quantile(seen[seen > FAINT * largest], QUARTILE))
    return tuple(
        Arrow(a.place * enlarged, a.force / np.maximum(one, size / LONGEST))
        for a, size in zip(arrows, sizes, strict=True)
    )


def _size(model: Model | None) -> Array:
    if model is None or not model.fans:
        return np.array([LENGTH, WIDTH])
    reach = np.abs([[f.x, f.y] for f in model.fans]).max(axis=0)
    return 2 * BEYOND * np.where(reach > 0, reach, reach.max() or LENGTH / 2)


def _arrows(motion: Motion, model: Model | None, size: Array) -> list[Arrow]:
    """Return the forces in the unit of the commands."""
    given = motion.commands
    stern = np.array([-size[0] / 2, 0.0])
    if model is not None and model.fans:
        return [
            Arrow(
                np.array([f.x, f.y]),
                np.outer([np.cos(f.direction), np.sin(f.direction)], f.forces(given[f.name])),
            )
            for f in model.fans
            if f.name in given
        ]
    if "thrust" in given:
        # F = T [cos theta, sin theta] [C17 eq 8-12]; without a rudder theta = 0
        angle = given.get("rudder", np.zeros_like(motion.time))
        return [Arrow(stern, given["thrust"] * np.array([np.cos(angle), np.sin(angle)]))]
    if {"force_x", "force_y"} <= set(given):
        return [Arrow(stern, np.array([given["force_x"], given["force_y"]]))]
    return []


def to_earth(points: Array, x: float, y: float, psi: float) -> Array:
    """Return points of the body frame, shape (k, 2), in the earth frame: p + R(psi) b."""
    c, s = np.cos(psi), np.sin(psi)
    return np.array([x, y]) + np.asarray(points) @ np.array([[c, s], [-s, c]])
