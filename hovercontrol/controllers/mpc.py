"""A model predictive controller from names: weights, limits, obstacles and waypoints, checked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.controllers.detour import way_around
from hovercontrol.controllers.optimizer import Solver
from hovercontrol.controllers.prediction_arguments import (
    Circles,
    Limits,
    by_name,
    plant_of,
    points_of,
    stage_of,
)
from hovercontrol.controllers.predictive import MPC
from hovercontrol.core.arguments import at_least
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError
from hovercontrol.io.tables import positive
from hovercontrol.models.interface import AnyModel


@checked
def mpc(
    plant: AnyModel,
    *,
    period: float | None = None,
    horizon: int = 20,
    weights: Mapping[str, float],
    rate_weights: Mapping[str, float] | None = None,
    final: float = 1.0,
    limits: Limits | None = None,
    rate_limits: Mapping[str, float] | None = None,
    obstacles: Circles = (),
    waypoints: ArrayLike | None = None,
    speed: float = 0.5,
    clearance: float = 0.05,
    position: tuple[str, str] = ("x", "y"),
    heading: str = "psi",
    params: Mapping[str, float] | None = None,
    substeps: int | None = None,
    solver: Solver = "rti",
    name: str = "mpc",
) -> MPC:
    """Return a model predictive controller of a plant, with limits, obstacles and waypoints.

    It solves an optimisation problem at every sample and is therefore not a Block. ``control(x)`` returns the
    inputs of the next period, ``to_control()`` a discrete-time system for use in a loop, and ``simulate(t)``
    the closed loop.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled; its equations predict the motion.
    period : float, optional
        Time between samples [s]: 0.05 s if it is not given. Of a sampled plant a multiple of its period
        (default: its period).
    horizon : int, optional
        Number of periods predicted.
    weights : mapping of str to float
        By name [1/unit^2]: cost of the squared difference of a state from its reference, or of the squared
        input.
    rate_weights : mapping of str to float, optional
        Cost of the squared change of an input from sample to sample [1/unit^2].
    final : float, optional
        Factor on the weights of the states at the end of the horizon, dimensionless.
    limits : mapping of str to (float, float), optional
        Lower and upper limit of inputs and states [unit], over the bounds of the inputs' signals. Limits of
        inputs hold exactly. Those of states hold where possible (they are soft, with a slack).
    rate_limits : mapping of str to float, optional
        Maximum change of inputs in a second [unit/s].
    obstacles : sequence of (x, y, radius), optional
        Circles that the position stays out of [m]; a radius includes the craft's own. Soft, with a slack.
    waypoints : array_like, shape (n, 2), optional
        Positions to reach in order [m]. The reference moves along the shortest way through them, around
        the obstacles.
    speed : float, optional
        Of the reference along the waypoints [m/s].
    clearance : float, optional
        Distance kept from the obstacles [m].
    position : tuple of str, optional
        The states that are the position [m].
    heading : str, optional
        The state whose reference, with waypoints, is the direction of the way ahead [rad].
    params : mapping, optional
        Parameter values by key for the prediction. At rest, dry friction of a narrow width hides from the
        derivatives that a larger input would move the plant: predict with a width of about 0.05 m/s.
    substeps : int, optional
        Runge-Kutta steps per period (default: chosen from the plant's fastest mode).
    solver : {"rti", "ipopt"}, optional
        One step of SQP at each sample (real-time iteration), or full convergence by IPOPT.
    name : str, optional

    Returns
    -------
    MPC

    Raises
    ------
    InputError
        If CasADi is not installed (``pip install "hovercontrol[mpc]"``), the plant has parts that tick, its
        inputs are delayed, a name is unknown, a number is out of range, or a waypoint lies within an
        obstacle.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> controller = mpc(
    ...     craft,
    ...     weights={"u": 1.0, "r": 1.0, "thrust": 0.01},
    ...     limits={"thrust": (0.0, 4.0), "rudder": (-0.5, 0.5)},
    ... )
    >>> controller
    MPC of block 'plant': 20 periods of 0.05 s, 0 obstacles, solver rti

    From 0.5 to 1 m/s straight ahead, it gives full thrust and no rudder:

    >>> thrust, rudder = controller.control([0.0, 0.0, 0.0, 0.5, 0.0, 0.0], {"u": 1.0})
    >>> round(float(thrust), 2), round(float(rudder), 2)
    (4.0, 0.0)
    """
    block = plant_of(name, plant)
    period = positive(f"{name}: period", (block.period or 0.05) if period is None else period)
    at_least(f"{name}: horizon", horizon, 2)
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    both = by_name(f"{name}: weights", weights, [*states, *inputs])
    if not any(both[key] for key in states):
        raise InputError(f"{name}: weights: expected a positive weight of at least one state")
    changes = by_name(f"{name}: rate_weights", rate_weights or {}, inputs)
    points = None if waypoints is None else points_of(name, waypoints)
    stage = stage_of(
        name, block, period, limits, rate_limits, obstacles, clearance, position, params, substeps,
        planar=points is not None,
    )  # fmt: skip
    if points is not None:
        way_around(np.vstack([points[:1], points]), stage.obstacles)  # refuses waypoints within obstacles
    Q, R, S = (
        np.array(list(of))
        for of in ((both[key] for key in states), (both[key] for key in inputs), changes.values())
    )
    return MPC(
        stage,
        horizon,
        (Q, R, S),
        positive(f"{name}: final", final),
        points,
        positive(f"{name}: speed", speed),
        heading,
        solver,
        name,
    )
