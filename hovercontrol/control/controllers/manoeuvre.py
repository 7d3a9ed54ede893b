"""A planned motion with its inputs: simulated, and as a reference for tracking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.control.controllers.references import from_pieces


@dataclass(frozen=True, eq=False, repr=False)
class Manoeuvre:
    """A motion from start to end in minimum time, from :func:`hovercontrol.minimum_time`.

    Parameters
    ----------
    plant : Block
    time : ndarray, shape (n + 1,)
        Ends of the intervals [s], from 0.
    states : dict of str to ndarray, shape (n + 1,)
        By name [unit], from a simulation with the inputs.
    inputs : dict of str to ndarray, shape (n + 1,)
        By name [unit], each held from its time on; the last value is repeated.
    passed : ndarray, shape (n_waypoints,)
        When each waypoint is passed [s].
    error : float
        Largest difference between the simulated states and those of the optimisation [units of the states].
    position : tuple of str
        The states that are the position.
    heading : str
        The state that is the heading.
    params : mapping
        Parameter values by key, over the defaults.
    """

    plant: Block = field(repr=False)
    time: Array
    states: dict[str, Array]
    inputs: dict[str, Array]
    passed: Array
    error: float
    position: tuple[str, str] = field(repr=False)
    heading: str = field(repr=False)
    params: Mapping[str, float] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return float(self.time[-1])

    @checked
    def simulate(
        self,
        plant: Block | None = None,
        *,
        x0: Mapping[str, float] | ArrayLike | None = None,
        rows: int = 5,
    ) -> control.TimeResponseData:
        """Simulate the inputs without feedback.

        Parameters
        ----------
        plant : Block, optional
            Another plant with the same inputs (default: the one that was planned with).
        x0 : mapping by name, or array_like, shape (n_states,), optional
            Initial state (default: the start of the manoeuvre).
        rows : int, optional
            Rows of the result in each interval.

        Returns
        -------
        control.TimeResponseData

        Raises
        ------
        InputError
            If a name or a shape is wrong, or the simulation fails.
        """
        at_least("simulate: rows", rows, 1)
        begin = np.repeat(self.time[:-1], rows)
        times = np.append(
            begin + np.repeat(np.diff(self.time), rows) * np.tile(np.arange(rows) / rows, len(self.time) - 1),
            self.duration,
        )
        inputs = {name: np.append(np.repeat(u[:-1], rows), u[-1]) for name, u in self.inputs.items()}
        start = {name: float(x[0]) for name, x in self.states.items()} if x0 is None else x0
        params = self.params if plant is None else None
        return (plant or self.plant).compile().simulate(times, inputs, start, params)

    @checked
    def reference(self, *, control_point: float = 0.0, name: str = "reference") -> Block:
        """Return the position over time as a reference, for :func:`hovercontrol.tracking_controller`.

        In each interval it is the polynomial of degree 5 with the planned positions, velocities and
        accelerations at both ends. Before and after the manoeuvre it is at rest.

        Parameters
        ----------
        control_point : float, optional
            The point that follows it, ahead of the centre of mass [m]: that of the controller.
        name : str, optional

        Returns
        -------
        Block
            Outputs ``x_ref, y_ref`` [m], ``vx_ref, vy_ref`` [m/s], ``ax_ref, ay_ref`` [m/s^2].

        Raises
        ------
        InputError
            If the plant is sampled, has no such position, or no heading for a control point.
        """
        self.plant.need_continuous("velocities and accelerations for a reference")
        finite(f"{name}: control_point", control_point)
        names = [s.name for s in self.plant.states]
        for key in (*self.position, *([self.heading] if control_point else [])):
            if key not in names:
                raise InputError(f"{name}: block {self.plant.name!r} has no state {key!r} to follow")
        x = np.array([self.states[key] for key in names])
        u = np.array([self.inputs[s.name] for s in self.plant.inputs])
        begin, end = (self._point(at, u[:, :-1], control_point) for at in (x[:, :-1], x[:, 1:]))
        h = np.diff(self.time)
        curves = [(self.time, _quintic(h, begin[:, axis], end[:, axis])) for axis in (0, 1)]
        outside = [(float(begin[0, axis, 0]), float(end[0, axis, -1])) for axis in (0, 1)]
        return from_pieces(curves, outside, name)

    def _point(self, x: Array, u: Array, d: float) -> Array:
        """Return the point's position, velocity and acceleration, shape (3, 2, n)."""
        names = [s.name for s in self.plant.states]
        functions = numpy_functions(self.plant)
        # x' = f,  x'' = (df/dx) f  with held inputs
        f = np.array(functions.derivatives(0.0, x, u, self.params))
        J = np.array([functions.jacobian(0.0, a, b, self.params) for a, b in zip(x.T, u.T, strict=True)])
        second = np.einsum("kij,jk->ik", J, f)
        places = [names.index(key) for key in self.position]
        found = np.array([x[places], f[places], second[places]])
        if d:
            # p = (x, y) + d (cos, sin),  p'' = (x'', y'') + d psi'' (-sin, cos) - d psi'^2 (cos, sin)
            k = names.index(self.heading)
            along = np.array([np.cos(x[k]), np.sin(x[k])])
            across = np.array([-along[1], along[0]])
            found += d * np.array([along, f[k] * across, second[k] * across - f[k] ** 2 * along])
        return found


def _quintic(h: Array, begin: Array, end: Array) -> Array:
    """Return coefficients, shape (6, n), from values and two derivatives at both ends, shape (3, n)."""
    # p(t) = c5 t^5 + ... + c0 with p, p', p'' given at 0 and h
    p, v, a = begin
    q, w, b = end
    gap = [q - (p + v * h + a * h**2 / 2), (w - (v + a * h)) * h, (b - a) * h**2]
    # c3 h^3 + c4 h^4 + c5 h^5 = gap_0,  3, 4, 5 times = gap_1,  6, 12, 20 times = gap_2
    high = np.linalg.solve([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]], np.array(gap))
    c3, c4, c5 = high / h ** np.array([[3], [4], [5]])
    return np.array([c5, c4, c3, a / 2, v, p])
