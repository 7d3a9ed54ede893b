"""The operating point of a controller design, and the plant's linear model there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.friction_slopes import Point, Slope
from hovercontrol.blocks.backends.trim_conditions import with_rates
from hovercontrol.blocks.block import Block

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.trim import Trim


def point_of(plant: Block, trim: Trim | control.OperatingPoint | Mapping[str, float]) -> Point:
    """Return an operating point in the order of the plant's signals.

    Raises
    ------
    InputError
        If the plant has parts that tick, an input acts late, a name is unknown, or a number of values is
        wrong.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> point_of(c17_simulation().plant(), {"u": 1.0, "thrust": 1.8}).u
    array([1.8, 0. ])
    """
    from hovercontrol.blocks.backends.linearization import operating_point  # python-control takes a second

    plant.need_no_ticks("controller design")
    plant.need_prompt_inputs("a controller design")
    return operating_point(plant, trim)


def rates(plant: Block, point: Point) -> Array:
    """Return the states' derivatives at an operating point, shape (n_states,) [unit/s].

    Of a sampled plant the change of a step over the period.
    """
    change = with_rates(plant).to_numpy().derivatives(point.t, point.x, point.u, point.params)
    return change / (plant.period or 1.0)


def outputs(plant: Block, point: Point) -> Array:
    """Return the outputs at an operating point, shape (n_outputs,)."""
    return plant.to_numpy().outputs(point.t, point.x, point.u, point.params)


def linear_model(
    plant: Block, point: Point, friction: Slope, amplitude: Mapping[str, float] | None
) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D at an operating point; friction and amplitude as for ``block.linearize``."""
    system = plant.linearize(point.x, point.u, point.params, point.t, friction=friction, amplitude=amplitude)
    A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in (system.A, system.B, system.C, system.D))
    return A, B, C, D
