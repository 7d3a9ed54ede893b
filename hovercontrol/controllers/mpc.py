"""A model predictive controller from names: weights, limits, obstacles and waypoints, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.controllers.detour import way_around
from hovercontrol.controllers.predictive import MPC, Solver
from hovercontrol.controllers.shooting import Stage
from hovercontrol.core.arguments import at_least
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.functions import numpy_functions
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.tables import finite, positive
from hovercontrol.models.interface import AnyModel

Array = NDArray[np.float64]
Limits = Mapping[str, tuple[float, float]]


@checked
def mpc(
    plant: AnyModel,
    *,
    period: float = 0.05,
    horizon: int = 20,
    weights: Mapping[str, float],
    rate_weights: Mapping[str, float] | None = None,
    final: float = 1.0,
    limits: Limits | None = None,
    rate_limits: Mapping[str, float] | None = None,
    obstacles: Sequence[tuple[float, float, float]] = (),
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
        Continuous; its equations predict the motion.
    period : float, optional
        Time between samples [s].
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
        Parameter values by key for the prediction.
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
        If CasADi is not installed (``pip install "hovercontrol[mpc]"``), the plant is sampled, its inputs
        are delayed, a name is unknown, a number is out of range, or a waypoint lies within an obstacle.

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
    >>> controller.control([0.0] * 6, {"u": 1.0}).shape
    (2,)
    """
    block = _plant(plant, name)
    period = positive(f"{name}: period", period)
    at_least(f"{name}: horizon", horizon, 2)
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    both = _by_name(f"{name}: weights", weights, [*states, *inputs])
    if not any(both[key] for key in states):
        raise InputError(f"{name}: weights: expected a positive weight of at least one state")
    S = _by_name(f"{name}: rate_weights", rate_weights or {}, inputs)
    rates = _by_name(f"{name}: rate_limits", rate_limits or {}, inputs, math.inf)
    lower = {s.name: s.lower for s in block.inputs} | dict.fromkeys(states, -math.inf)
    upper = {s.name: s.upper for s in block.inputs} | dict.fromkeys(states, math.inf)
    for key, (low, high) in (limits or {}).items():
        if key not in lower:
            raise InputError(f"{name}: limits: no state or input {key!r}{did_you_mean(key, lower)}")
        if not low < high:
            raise InputError(f"{name}: limits: {key}: expected (lower, upper), found ({low!r}, {high!r})")
        lower[key], upper[key] = float(low), float(high)
    where, circles = _circles(name, states, position, obstacles, waypoints is not None)
    points = None if waypoints is None else _points(name, waypoints)
    by_input = [np.array([of[key] for key in inputs], dtype=np.float64) for of in (lower, upper, rates)]
    by_state = [np.array([of[key] for key in states], dtype=np.float64) for of in (lower, upper)]
    grown = circles + np.array([0.0, 0.0, finite(f"{name}: clearance", clearance)])
    n = _substeps(block, period, name, substeps)
    values = block.parameter_values(params)
    stage = Stage(
        block,
        period,
        n,
        values,
        by_input[0],
        by_input[1],
        by_input[2],
        by_state[0],
        by_state[1],
        where,
        grown,
    )
    if points is not None:
        way_around(np.vstack([points[:1], points]), stage.obstacles)  # refuses waypoints within obstacles
    return MPC(
        stage,
        horizon,
        (
            np.array([both[key] for key in states]),
            np.array([both[key] for key in inputs]),
            np.array(list(S.values())),
        ),
        positive(f"{name}: final", final),
        points,
        positive(f"{name}: speed", speed),
        heading,
        solver,
        name,
    )


def _substeps(plant: Block, period: float, name: str, given: int | None) -> int:
    """Return the given number of steps, or one that is stable for the fastest mode at start and at rest."""
    if given is not None:
        return at_least(f"{name}: substeps", given, 1)
    f, u = numpy_functions(plant), [s.start for s in plant.inputs]
    fastest = 0.0
    for x in ([s.start for s in plant.states], [0.0] * len(plant.states)):
        F = f.jacobian(0.0, x, u)
        if np.isfinite(F).all():
            fastest = max(fastest, float(np.abs(np.linalg.eigvals(F)).max()))
    return min(max(1, math.ceil(period * fastest / 2.0)), 50)  # Runge-Kutta is stable up to |lambda| h = 2.78


def _plant(plant: AnyModel, name: str) -> Block:
    block = plant if isinstance(plant, Block) else plant.plant()
    block.need_continuous("prediction", hybrid=False)
    block.need_prompt_inputs("the prediction")
    if not block.states or not block.inputs:
        raise InputError(f"{name}: block {block.name!r} needs states and inputs")
    return block


def _by_name(
    where: str, given: Mapping[str, float], names: Sequence[str], default: float = 0.0
) -> dict[str, float]:
    """Return a number of at least 0 for each name."""
    found = dict.fromkeys(names, default)
    for key, value in given.items():
        if key not in found:
            raise InputError(f"{where}: no signal {key!r}{did_you_mean(key, names)}")
        if finite(f"{where}: {key}", value) < 0.0:
            raise InputError(f"{where}: {key}: expected a number of at least 0, found {value!r}")
        found[key] = float(value)
    return found


def _circles(
    name: str,
    states: Sequence[str],
    position: Sequence[str],
    obstacles: Sequence[Sequence[float]],
    needed: bool,
) -> tuple[tuple[int, ...], Array]:
    circles = np.array(obstacles, dtype=float).reshape(-1, 3)
    for cx, cy, radius in circles:
        if not (np.isfinite([cx, cy, radius]).all() and radius > 0.0):
            raise InputError(
                f"{name}: obstacles: expected (x, y, radius) with a positive radius, "
                f"found ({cx:g}, {cy:g}, {radius:g})"
            )
    if not (len(circles) or needed):
        return (), circles
    for key in position:
        if key not in states:
            raise InputError(f"{name}: position: no state {key!r}{did_you_mean(key, states)}")
    return tuple(states.index(key) for key in position), circles


def _points(name: str, waypoints: ArrayLike) -> Array:
    points = np.asarray(waypoints, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
        raise InputError(
            f"{name}: waypoints: expected finite positions, shape (n, 2), found shape {points.shape}"
        )
    return points
