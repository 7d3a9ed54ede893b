"""A model predictive controller from names: weights, limits, obstacles and waypoints, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.control.controllers.detour import way_around
from hovercontrol.control.controllers.optimizer import Solver
from hovercontrol.control.controllers.prediction_arguments import (
    Circles,
    Limits,
    by_name,
    plant_of,
    points_of,
    stage_of,
)
from hovercontrol.control.controllers.predictive import MPC
from hovercontrol.control.controllers.shooting import Stage
from hovercontrol.control.controllers.suggestion import Times, suggested_periods, suggested_weights, times_of
from hovercontrol.control.controllers.way_reference import WayReference
from hovercontrol.craft.models.interface import AnyModel


@checked
def mpc(
    plant: AnyModel,
    *,
    period: float | None = None,
    horizon: int | None = None,
    weights: Mapping[str, float] | None = None,
    rate_weights: Mapping[str, float] | None = None,
    final: float = 1.0,
    limits: Limits | None = None,
    rate_limits: Mapping[str, float] | None = None,
    obstacles: Circles = (),
    waypoints: ArrayLike | None = None,
    speed: float = 0.5,
    acceptance: float = 0.25,
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

    Each plan is compared with others by its predicted cost. At rest a propeller's thrust ``k n abs(n)`` has
    no slope over its speed, so that a solver alone would stay
    (:mod:`~hovercontrol.control.controllers.plans`).

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled; its equations predict the motion.
    period : float, optional
        Time between samples [s] (default: 0.05 s, or with the suggested horizon about a fortieth of it). Of a
        sampled plant a multiple of its period (default: its period).
    horizon : int, optional
        Number of periods predicted (default: 20; with waypoints and limits the times in which the craft gets
        going, turns round and stops, :mod:`~hovercontrol.control.controllers.suggestion`).
    weights : mapping of str to float, optional
        By name [1/unit^2]: cost of the squared difference of a state from its reference, or of the squared
        input. With waypoints they may be left out, together with `rate_weights`: they then follow from
        `acceptance` and from the ranges of the inputs.
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
        Of the reference along the waypoints [m/s]; where the inputs have limits it slows down before the last
        one as the craft can.
    acceptance : float, optional
        Distance within which a waypoint counts as reached [m].
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
        If CasADi is not installed (``pip install ".[mpc]"``), the plant has parts that tick, its
        inputs are delayed, a name is unknown, a number is out of range, weights are missing, or a waypoint
        lies within an obstacle.

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
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    points = None if waypoints is None else points_of(name, waypoints)
    _check_arguments(name, weights, points, speed=speed, acceptance=acceptance, final=final)
    at = states.index(heading) if heading in states else -1

    def stage_with(period: float, substeps: int | None) -> Stage:
        return stage_of(
            name, block, period, limits, rate_limits, obstacles, clearance, position, params, substeps,
            planar=points is not None,
        )  # fmt: skip

    given = (block.period or None) if period is None else positive(f"{name}: period", period)
    trial = stage_with(given or 0.05, substeps)
    bounded = bool(np.isfinite([trial.lower, trial.upper]).all())
    if weights is None and not bounded:
        raise InputError(f"{name}: limits: expected limits of each input, from which the weights follow")
    times = times_of(trial, speed, at) if points is not None and bounded else Times(0.0, 0.0, 0.0)
    if horizon is None and any(times):
        given, horizon = suggested_periods(times, given)
    horizon = at_least(f"{name}: horizon", 20 if horizon is None else horizon, 2)
    stage = stage_with(given or 0.05, substeps)
    if weights is None:
        weights, changes = suggested_weights(stage, acceptance, at)
        rate_weights = changes if rate_weights is None else rate_weights
    if points is not None:
        way_around(np.vstack([points[:1], points]), stage.obstacles)  # refuses waypoints within obstacles
    costs = _costs(name, states, inputs, weights, rate_weights or {})
    way = None if points is None else WayReference(stage, points, speed, times.stop, at)
    return MPC(stage, horizon, costs, final, way, acceptance, solver, name)


def _check_arguments(
    name: str, weights: Mapping[str, float] | None, points: Array | None, **numbers: float
) -> None:
    if points is None and weights is None:
        raise InputError(f"{name}: weights: expected weights by name; only with waypoints are they suggested")
    for what, number in numbers.items():
        positive(f"{name}: {what}", number)


def _costs(
    name: str,
    states: Sequence[str],
    inputs: Sequence[str],
    weights: Mapping[str, float],
    rate_weights: Mapping[str, float],
) -> tuple[Array, Array, Array]:
    """Return the weights of the states, of the inputs and of the inputs' changes."""
    both = by_name(f"{name}: weights", weights, [*states, *inputs])
    Q, R = (np.array([both[key] for key in group]) for group in (states, inputs))
    if not Q.any():
        raise InputError(f"{name}: weights: expected a positive weight of at least one state")
    rated = by_name(f"{name}: rate_weights", rate_weights, inputs)
    return Q, R, np.array(list(rated.values()))
