"""Unknowns of a fit: initial values, bounds, scaled coordinates and positions among a Block's parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.craft.effects import Shape
from hovercontrol.identification.engine.subject import Subject, same_widths, unknowns

#: Smallest width of friction that a fit can distinguish from a jump [m/s, rad/s], of a slow machine relative
#: to its speed, and largest width relative to the speed.
NARROWEST, WIDEST = 5e-4, 0.3


class Unknowns:
    """The unknowns of a model.

    Unknowns p are estimated in scaled coordinates z. Those that keep their sign (masses, times, widths of
    friction) have ``z = log |p|``, all others ``z = p``. A parameter of a Block keeps its sign if its bounds
    exclude zero or the equations are not defined there.

    Parameters
    ----------
    model : Model or BlockModel
        Its values are the initial values of the unknowns.
    block : Block
        Block with the equations of the model.
    paths : mapping of str to ndarray
        States of the Block, as guessed from the logs. They bound the widths of friction.
    names : sequence of str, optional
        Names of the unknowns; default: :func:`~hovercontrol.identification.engine.subject.unknowns`.

    Attributes
    ----------
    names : tuple of str
    start, lower, upper : ndarray, shape (P,)
        Initial values and bounds, in the units of the unknowns.
    log_scale : ndarray of bool, shape (P,)
        Unknowns whose logarithm is estimated.
    sign : ndarray, shape (P,)
        Sign of these unknowns; 1 for all others.
    size : ndarray, shape (P,)
        Magnitude of the initial values; 1 for zero.
    same : dict of str to str
        Parameters that share their value with an unknown.

    Raises
    ------
    InputError
        If an unknown that keeps its sign is zero in the model.
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
        keeps = model.sign_keeping()
        self.log_scale = np.array(
            [n in keeps or (n in shapes and _scales(shapes[n], values[n])) for n in self.names], dtype=bool
        )
        self._bound_widths(model, paths)
        self.start = np.clip(self.start, self.lower, self.upper)
        for name in (
            n for n, value in zip(self.names, self.start.tolist(), strict=True) if n in keeps and not value
        ):
            raise InputError(
                f"{model.name!r}: {name} = 0, where the equations are not defined; give it a start value"
            )
        self.sign = np.where(self.log_scale, np.sign(self.start), 1.0)
        self.size = np.array([abs(v) or 1.0 for v in self.start])
        self._every = [
            values.get(key, values.get(key.rpartition(".")[2], start))
            for key, start in block.default_parameters.items()
        ]

    def _bound_widths(self, model: Subject, paths: Mapping[str, Array]) -> None:
        """Bound the width of dry friction by the speed: wider friction would act as linear drag."""
        # widest = WIDEST sqrt(mean(v^4) / mean(v^2)) along the guessed path
        for e in model.effects:
            axis, name = e.axis, e.friction_width()
            if axis not in paths or name not in self.names:
                continue
            squares = paths[axis] ** 2
            j = self.names.index(name)
            speed = float(np.sqrt(np.mean(squares**2) / max(float(np.mean(squares)), 1e-300)))
            widest = WIDEST * speed
            narrow = NARROWEST if model.is_craft else NARROWEST * min(speed, 1.0)
            self.lower[j] = max(self.lower[j], narrow)
            self.upper[j] = max(min(self.upper[j], widest), self.start[j], self.lower[j])

    def inside(self, p: Array) -> Array:
        """Return the scaled coordinates z of unknowns p."""
        return np.where(self.log_scale, np.log(np.where(self.log_scale, np.abs(p), 1.0)), p)

    def outside(self, z: Array) -> Array:
        """Return the unknowns p of scaled coordinates z, clipped to their bounds."""
        p = np.where(self.log_scale, self.sign * np.exp(np.where(self.log_scale, z, 0.0)), z)
        return np.asarray(np.clip(p, self.lower, self.upper))

    def slope(self, p: Array) -> Array:
        """Return dp/dz: p for unknowns whose logarithm is estimated, else 1."""
        return np.where(self.log_scale, p, 1.0)

    def held(self, p: Array, slope: Array) -> NDArray[np.bool_]:
        """Return which unknowns are at a bound that the direction `slope` in z points across."""
        up = slope * self.sign
        return np.asarray(((p <= self.lower) & (up < 0)) | ((p >= self.upper) & (up > 0)))

    def parameters(self, p: Array) -> list[float]:
        """Return all parameters of the Block, with the values `p` of the unknowns."""
        every = list(self._every)
        for places, value in zip(self._at, p.tolist(), strict=True):
            for at in places:
                every[at] = value
        return every

    def coefficients(self, p: Array) -> dict[str, float]:
        """Return the unknowns and the parameters that share their values, by name."""
        found = dict(zip(self.names, p.tolist(), strict=True))
        return {**found, **{one: found[other] for one, other in self.same.items()}}


def _scales(shape: Shape, start: float) -> bool:
    """Return whether the logarithm of a shape is estimated.

    Its lower bound must be positive, or zero without a neutral value (at which the effect would vanish).
    """
    return shape.lower > 0.0 or (shape.lower == 0.0 < start and np.isnan(shape.neutral))
