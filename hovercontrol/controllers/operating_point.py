"""The operating point of a controller design, and the plant's linear model there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.functions import array_function
from hovercontrol.core.sgn import sgn
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.targets.linear import point_values

Array = NDArray[np.float64]

#: How dry friction enters a linear model: its regularised slope, or not at all.
Slope = Literal["none", "smooth"]


class OperatingPoint(Protocol):
    """A point at which a plant is in equilibrium: a trim, or a ``control.OperatingPoint``."""

    @property
    def states(self) -> Any:
        """The states, by name or in the Block's order."""

    @property
    def inputs(self) -> Any:
        """The inputs, by name or in the Block's order."""


@dataclass(frozen=True)
class Point:
    """An operating point in the order of a plant's signals.

    Parameters
    ----------
    x, u : ndarray, shapes (n_states,) and (n_inputs,)
        In the signals' units.
    params : mapping
        Parameter values by key, over the defaults.
    time : float
        [s]
    """

    x: Array
    u: Array
    params: Mapping[str, float]
    time: float

    def rates(self, plant: Block) -> Array:
        """Return the states' derivatives, shape (n_states,)."""
        return plant.to_numpy().derivatives(self.time, self.x, self.u, self.params)

    def outputs(self, plant: Block) -> Array:
        """Return the outputs, shape (n_outputs,)."""
        return plant.to_numpy().outputs(self.time, self.x, self.u, self.params)


def point_of(where: str, plant: Block, trim: OperatingPoint) -> Point:
    """Return an operating point in the order of the plant's signals.

    Raises
    ------
    InputError
        If a name is unknown, or a number of values is wrong.
    """
    plant.need_continuous("controller design", hybrid=False)
    plant.need_prompt_inputs("a controller design")
    x = _values(where, plant, "states", trim.states)
    u = _values(where, plant, "inputs", trim.inputs)
    params = getattr(trim, "params", None) or {}
    return Point(x, u, params, float(getattr(trim, "time", None) or 0.0))


def _values(where: str, plant: Block, kind: Literal["states", "inputs"], given: Any) -> Array:
    signals = getattr(plant, kind)
    if not isinstance(given, Mapping):
        return point_values(given, len(signals), kind[:-1], plant.name)
    names = [s.name for s in signals]
    for key in given:
        if key not in names:
            raise InputError(
                f"{where}: the operating point has no {kind[:-1]} {key!r}{did_you_mean(key, names)}"
            )
    return point_values([given.get(s.name, s.start) for s in signals], len(signals), kind[:-1], plant.name)


def linear_model(plant: Block, point: Point, friction: Slope) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D at an operating point, from the exact Jacobians.

    Parameters
    ----------
    plant : Block
    point : Point
    friction : {"none", "smooth"}
        "none" takes each ``sgn(v, w)`` as the constant that it is at the point: dry friction damps nothing.
        "smooth" differentiates ``tanh(v/w)``, which at v = 0 is a damping of 1/w.
    """
    if friction == "none":
        plant = _with_constant_friction(plant, point)
    f = plant.to_numpy()
    A, B, C, D = (
        f.jacobian(point.time, point.x, point.u, point.params, rows, columns)
        for rows in ("derivatives", "outputs")
        for columns in ("states", "inputs")
    )
    return A, B, C, D


def _with_constant_friction(plant: Block, point: Point) -> Block:
    found = {f for _, e in plant.all_expressions() for f in e.atoms(sgn)}
    signs = sorted(found, key=str)
    if not signs:
        return plant
    p = plant.parameter_values(point.params, bounded=False)
    values = array_function(plant, signs)(point.time, point.x, point.u, p)
    swap = {f: sp.Float(float(v)) for f, v in zip(signs, values, strict=True)}
    return plant.unchecked(**plant.swapped(swap))
