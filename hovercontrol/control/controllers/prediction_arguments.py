"""Arguments of controllers that predict: a plant, limits by name, obstacles and waypoints, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import at_least, whole_periods
from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.control.controllers.shooting import Stage
from hovercontrol.craft.models.interface import AnyModel

Limits = Mapping[str, tuple[float, float]]
Circles = Sequence[tuple[float, float, float]]


def stage_of(
    name: str,
    plant: Block,
    period: float,
    limits: Limits | None,
    rate_limits: Mapping[str, float] | None,
    obstacles: Circles,
    clearance: float,
    position: tuple[str, str],
    params: Mapping[str, float] | None,
    substeps: int | None,
    *,
    planar: bool,
) -> Stage:
    """Return one period of a plant with its limits; arguments as for :func:`~hovercontrol.mpc`.

    Parameters
    ----------
    name : str
        Of the function, for error messages.
    planar : bool
        Whether the position is needed even without obstacles.

    Raises
    ------
    InputError
        If a name is unknown or a number is out of range.
    """
    states, inputs = [s.name for s in plant.states], [s.name for s in plant.inputs]
    rates = by_name(f"{name}: rate_limits", rate_limits or {}, inputs, math.inf)
    lower = {s.name: s.lower for s in plant.inputs} | dict.fromkeys(states, -math.inf)
    upper = {s.name: s.upper for s in plant.inputs} | dict.fromkeys(states, math.inf)
    for key, (low, high) in (limits or {}).items():
        check_known(key, lower, f"{name}: limits: no state or input {key!r}")
        if not low < high:
            raise InputError(f"{name}: limits: {key}: expected (lower, upper), found ({low!r}, {high!r})")
        lower[key], upper[key] = float(low), float(high)
    where, circles = _circles(name, states, position, obstacles, planar)

    def row(of: Mapping[str, float], names: Sequence[str]) -> Array:
        return np.array([of[key] for key in names], dtype=np.float64)

    grown = circles + np.array([0.0, 0.0, finite(f"{name}: clearance", clearance)])
    n = substeps_of(name, plant, period, substeps)
    values = plant.parameter_values(params)
    of_inputs = row(lower, inputs), row(upper, inputs), row(rates, inputs)
    of_states = row(lower, states), row(upper, states)
    return Stage(plant, period, n, values, *of_inputs, *of_states, where, grown)


def plant_of(name: str, plant: AnyModel) -> Block:
    """Return the Block of a plant.

    Raises
    ------
    InputError
        If it has parts that tick, has delayed inputs, or lacks states or inputs.
    """
    block = plant if isinstance(plant, Block) else plant.plant()
    block.need_no_ticks("prediction")
    block.need_prompt_inputs("the prediction")
    if not block.states or not block.inputs:
        raise InputError(f"{name}: block {block.name!r} needs states and inputs")
    return block


def substeps_of(name: str, plant: Block, period: float, given: int | None = None) -> int:
    """Return the given number of steps, or one that is stable for the fastest mode at start and at rest.

    Of a sampled plant it is the number of its own steps.

    Parameters
    ----------
    period : float
        [s]

    Raises
    ------
    InputError
        If a number is given for a sampled plant, or the period is no multiple of its period.
    """
    if plant.period:
        if given is not None:
            text = f"{name}: substeps: block {plant.name!r} is sampled and takes its own steps, found {given}"
            raise InputError(text)
        return whole_periods(f"{name}: period", period, plant.period)
    if given is not None:
        return at_least(f"{name}: substeps", given, 1)
    f, u = numpy_functions(plant), [s.start for s in plant.inputs]
    fastest = 0.0
    for x in ([s.start for s in plant.states], [0.0] * len(plant.states)):
        with np.errstate(all="ignore"):
            F = f.jacobian(0.0, x, u)
        if np.isfinite(F).all():
            fastest = max(fastest, float(np.abs(np.linalg.eigvals(F)).max()))
    return min(max(1, math.ceil(period * fastest / 2.0)), 50)  # Runge-Kutta is stable up to |lambda| h = 2.78


def by_name(
    where: str, given: Mapping[str, float], names: Sequence[str], default: float = 0.0
) -> dict[str, float]:
    """Return a number of at least 0 for each name.

    Raises
    ------
    InputError
        If a name is unknown or a number is negative.
    """
    found = dict.fromkeys(names, default)
    for key, value in given.items():
        if key not in found:
            raise InputError(f"{where}: no signal {key!r}{did_you_mean(key, names)}")
        if finite(f"{where}: {key}", value) < 0.0:
            raise InputError(f"{where}: {key}: expected a number of at least 0, found {value!r}")
        found[key] = float(value)
    return found


def points_of(name: str, waypoints: ArrayLike) -> Array:
    """Return positions, shape (n, 2).

    Raises
    ------
    InputError
        If they have another shape or are not finite.
    """
    points = np.asarray(waypoints, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
        raise InputError(
            f"{name}: waypoints: expected finite positions, shape (n, 2), found shape {points.shape}"
        )
    return points


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
        check_known(key, states, f"{name}: position: no state {key!r}")
    return tuple(states.index(key) for key in position), circles
