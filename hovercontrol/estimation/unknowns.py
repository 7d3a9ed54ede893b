"""What a fit seeks: its start, its bounds, the coordinates it is sought in, its places in a Block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.effects import Shape
from hovercontrol.estimation.subject import Subject, same_widths, unknowns

Array = NDArray[np.float64]

#: Narrowest friction [m/s, rad/s] that a fit tells from a jump, and the widest in parts of the speed.
NARROWEST, WIDEST = 5e-4, 0.3


class Unknowns:
    """The unknowns of a model.

    Those that scale something (widths, times, stiffnesses: shapes above zero) are sought by their logarithm.

    Parameters
    ----------
    model : Model or BlockModel
        Whose values the unknowns start from.
    block : Block
        With the model's equations.
    paths : mapping of str to ndarray
        The Block's states, as guessed from logs: no friction grows as wide as they are fast.
    names : sequence of str, optional
        Default: :func:`~hovercontrol.estimation.subject.unknowns`.

    Attributes
    ----------
    names : tuple of str
    start, lower, upper : ndarray, shape (P,)
        In the unknowns' own units.
    log_scale : ndarray of bool, shape (P,)
    size : ndarray, shape (P,)
        How large they are: as they start, 1 for zero.
    same : dict of str to str
        Numbers that are the same as an unknown.
    """

    def __init__(
        self, model: Subject, block: Block, paths: Mapping[str, Array], names: Sequence[str] | None = None
    ) -> None:
        self.names = tuple(unknowns(model) if names is None else names)
        values = model.coefficients()
        signals = [block.parameter(name) for name in self.names]
        keys = [p.name for p in block.parameters]
        same = {one: other for one, other in same_widths(model).items() if other in self.names}
        self.same = same
        self._at = [
            [keys.index(block.parameter(n).name) for n in (name, *(o for o, f in same.items() if f == name))]
            for name in self.names
        ]
        self.lower = np.array([s.lower for s in signals])
        self.upper = np.array([s.upper for s in signals])
        self.start = np.array([values[name] for name in self.names])
        shapes = {
            e.parameter(k): n for e in model.effects for k, n in e.numbers.items() if isinstance(n, Shape)
        }
        self.log_scale = np.array(
            [name in shapes and _scales(shapes[name], values[name]) for name in self.names], dtype=bool
        )
        self._bound_widths(model, paths)
        self.start = np.clip(self.start, self.lower, self.upper)
        self.size = np.array([abs(v) or 1.0 for v in self.start])
        self._every = [
            values.get(key, values.get(key.rpartition(".")[2], start))
            for key, start in block.default_parameters.items()
        ]

    def _bound_widths(self, model: Subject, paths: Mapping[str, Array]) -> None:
        """Let no dry friction grow as wide as the motion is fast: it would be a linear drag."""
        for e in model.effects:
            axis, name = e.axis, e.friction_width()
            if axis not in paths or name not in self.names:
                continue
            squares = paths[axis] ** 2
            j = self.names.index(name)
            widest = WIDEST * np.sqrt(np.mean(squares**2) / max(float(np.mean(squares)), 1e-300))
            self.lower[j] = max(self.lower[j], NARROWEST)
            self.upper[j] = max(min(self.upper[j], widest), self.start[j], self.lower[j])

    def inside(self, p: Array) -> Array:
        """Return unknowns in the coordinates in which they are sought."""
        return np.where(self.log_scale, np.log(np.where(self.log_scale, p, 1.0)), p)

    def outside(self, z: Array) -> Array:
        """Return unknowns in their own units, within their bounds."""
        p = np.where(self.log_scale, np.exp(np.where(self.log_scale, z, 0.0)), z)
        return np.asarray(np.clip(p, self.lower, self.upper))

    def slope(self, p: Array) -> Array:
        """Return the derivative of unknowns by the coordinates in which they are sought."""
        return np.where(self.log_scale, p, 1.0)

    def parameters(self, p: Array) -> list[float]:
        """Return every parameter of the Block, the unknowns as in `p`."""
        every = list(self._every)
        for places, value in zip(self._at, p.tolist(), strict=True):
            for at in places:
                every[at] = value
        return every

    def coefficients(self, p: Array) -> dict[str, float]:
        """Return the unknowns and what is the same as one, by name."""
        found = dict(zip(self.names, p.tolist(), strict=True))
        return {**found, **{one: found[other] for one, other in self.same.items()}}


def _scales(shape: Shape, start: float) -> bool:
    """Return whether a shape is above zero, and none at which its effect vanishes."""
    return shape.lower > 0.0 or (shape.lower == 0.0 < start and np.isnan(shape.neutral))
