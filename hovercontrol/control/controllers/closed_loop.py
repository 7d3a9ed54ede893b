"""A plant under held commands, period by period: integrated, or stepped if it is sampled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import whole_periods
from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.simulation.arguments import initial_state
from hovercontrol.blocks.simulation.trajectory import time_response
from hovercontrol.control.controllers.approach import ControlledResponse

Start = Mapping[str, float] | ArrayLike | None


class Motion:
    """The motion of a plant, begun at its start.

    Parameters
    ----------
    where : str
        Of the period, for error messages.
    plant : Block
        Continuous or sampled.
    x0 : mapping by name, or array_like, shape (n_states,), or None
        Over the plant's start values.
    period : float
        For which a command is held [s].
    rows : int
        Rows of the response in a period; of a sampled plant one for each of its steps.
    """

    def __init__(self, where: str, plant: Block, x0: Start, period: float, rows: int) -> None:
        self._plant = plant
        self._rows = whole_periods(where, period, plant.period) if plant.period else rows
        self._dt = period / self._rows
        self._run = None if plant.period else plant.compile().start(x0)
        self._x: list[Array] = [initial_state(plant, x0) if self._run is None else self._run.state]
        self._u: list[Array] = []

    @property
    def state(self) -> Array:
        """The present state."""
        return self._x[-1]

    def hold(self, command: Array) -> None:
        """Hold a command for a period."""
        for _ in range(self._rows):
            if self._run is None:  # x(k + 1) = f(x(k), u(k))
                t = len(self._u) * self._dt
                self._x.append(numpy_functions(self._plant).derivatives(t, self._x[-1], command))
            else:
                self._run.step(command, self._dt)
                self._x.append(self._run.state)
            self._u.append(command)

    def response(self) -> ControlledResponse:
        """Return the motion so far."""
        x, u = np.array(self._x).T, np.array([*self._u, self._u[-1]]).T
        times = np.arange(float(x.shape[1])) * self._dt
        y = numpy_functions(self._plant).outputs(times, x, u)
        found = time_response(self._plant, times, y, x, u, kind=ControlledResponse)
        assert isinstance(found, ControlledResponse)
        return found
