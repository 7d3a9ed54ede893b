"""The quickest manoeuvre from a start to an end within limits, around obstacles and through waypoints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.simulation.reasons import StoppedError
from hovercontrol.control.controllers.detour import way_around
from hovercontrol.control.controllers.fewest_steps import fewest_steps
from hovercontrol.control.controllers.manoeuvre import Manoeuvre
from hovercontrol.control.controllers.prediction_arguments import (
    Circles,
    Limits,
    plant_of,
    points_of,
    stage_of,
    substeps_of,
)
from hovercontrol.control.controllers.shooting import Stage
from hovercontrol.control.controllers.time_optimal import SOLVED, Ends, Plan, refined, solve
from hovercontrol.craft.models.interface import AnyModel

#: Durations that the search begins with if none is given [s].
GUESSES = (3.0, 15.0)
#: Turns of the heading during the second half of the first guesses [rad]: a craft may brake tail first.
TURNS = (0.0, np.pi, -np.pi)
#: Number of first solutions, the quickest, from which the Runge-Kutta problem is solved, and how many times
#: as long as the quickest one they may take.
BEST, LONGEST = 2, 1.3
#: First solutions whose durations differ by less than this fraction are the same.
SAME = 1e-3
#: How often the number of Runge-Kutta steps is doubled, at most.
REFINEMENTS = 4


@checked
def minimum_time(
    plant: AnyModel,
    end: Mapping[str, float],
    *,
    start: Mapping[str, float] | None = None,
    waypoints: ArrayLike | None = None,
    limits: Limits | None = None,
    rate_limits: Mapping[str, float] | None = None,
    obstacles: Circles = (),
    clearance: float = 0.0,
    intervals: int = 40,
    guess: float | None = None,
    tolerance: float = 1e-3,
    position: tuple[str, str] = ("x", "y"),
    heading: str = "psi",
    params: Mapping[str, float] | None = None,
    name: str = "minimum_time",
) -> Manoeuvre:
    """Return the manoeuvre from a start to an end in minimum time.

    The inputs are constant over each interval. The problem is solved by multiple shooting with IPOPT, from
    several guesses. The inputs are then simulated by the compiled plant; if the states differ by more than
    `tolerance`, the problem is solved again with twice as many Runge-Kutta steps. The quickest of the
    solutions is returned; it may be a local minimum. The guesses pass obstacles on the shorter side.

    Of a sampled plant, whose input may change at each step, it is the manoeuvre with the fewest steps.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled.
    end : mapping of str to float
        Final values of states [unit]; states that are not named are free. An angle is taken as it is: pi and
        -pi are different turns.
    start : mapping of str to float, optional
        Initial values of states over the plant's start values, and inputs before the start, from which rate
        limits count (default: the first input is free) [unit].
    waypoints : array_like, shape (n, 2), optional
        Positions to pass in order [m]; not of a sampled plant.
    limits : mapping of str to (float, float), optional
        Lower and upper limit of inputs and states [unit], over the bounds of the inputs' signals. Each input
        needs both.
    rate_limits : mapping of str to float, optional
        Maximum change of an input from one interval to the next, per second [unit/s].
    obstacles : sequence of (x, y, radius), optional
        Circles that the position stays out of [m]; a radius includes the craft's own.
    clearance : float, optional
        Distance kept from the obstacles [m].
    intervals : int, optional
        Number of intervals from one waypoint to the next, of equal length; of a sampled plant its steps.
    guess : float, optional
        Duration with which the search begins [s] (default: 3 s and 15 s; of a sampled plant the steps that
        its inputs need to meet the end's conditions).
    tolerance : float, optional
        Largest difference between the simulated states and those of the optimisation [units of the states].
    position : tuple of str, optional
        The states that are the position [m].
    heading : str, optional
        The state that is the heading [rad].
    params : mapping, optional
        Parameter values by key.
    name : str, optional
        Used in error messages.

    Returns
    -------
    Manoeuvre
        Times, states, inputs; ``simulate()`` and ``reference()``, for tracking.

    Raises
    ------
    InputError
        If CasADi is not installed (``pip install ".[mpc]"``), the plant has parts that tick or its
        inputs are delayed, a name is unknown, a number is out of range, an input has no limits, a point lies
        within an obstacle, or no manoeuvre is found.

    Notes
    -----
    Near the end of a manoeuvre the inputs are at their limits. For tracking, plan with smaller limits than
    the controller has.

    Examples
    --------
    A cart from rest to rest takes ``2 sqrt(distance / acceleration)``: half the time forward, half back.

    >>> import hovercontrol as hc
    >>> x, v, a = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    >>> cart = hc.Block("cart", [x, v], [a], [x, v], derivatives={"x": v.symbol, "v": a.symbol})
    >>> found = minimum_time(cart, {"x": 4.0, "v": 0.0}, limits={"a": (-1.0, 1.0)})
    >>> round(found.duration, 5), found.inputs["a"][[0, 19, 20, 39]].round(4).tolist()
    (4.0, [1.0, 1.0, -1.0, -1.0])
    """
    block = plant_of(name, plant)
    at_least(f"{name}: intervals", intervals, 2)
    tolerance = positive(f"{name}: tolerance", tolerance)
    guesses = GUESSES if guess is None else (positive(f"{name}: guess", guess),)
    points = np.zeros((0, 2)) if waypoints is None else points_of(name, waypoints)
    stage = stage_of(
        name, block, block.period or 1.0, limits, rate_limits, obstacles, clearance, position, params,
        None if block.period else 1, planar=len(points) > 0,
    )  # fmt: skip
    for s, low, high in zip(block.inputs, stage.lower, stage.upper, strict=True):
        if not np.isfinite([low, high]).all():
            raise InputError(f"{name}: limits: expected finite limits of {s.name!r}, found ({low}, {high})")
    ends = _ends(name, stage, start or {}, end, points)
    _outside(name, stage, ends)
    if block.period:
        if len(points):
            text = f"waypoints: block {block.name!r} is sampled, and between waypoints are whole steps"
            raise InputError(f"{name}: {text}: plan from one waypoint to the next")
        conditions = int(np.isfinite(ends.end).sum())
        first = round(guess / block.period) if guess else math.ceil(conditions / len(block.inputs))
        straight = partial(_in_steps, stage, ends, heading)
        plan, states, error = fewest_steps(name, stage, ends, max(1, first), straight, tolerance)
    else:
        plan, states, error = _search(name, stage, ends, guesses, intervals, tolerance, heading, params)
    return Manoeuvre(
        block,
        np.r_[0.0, np.cumsum(plan.steps)],
        {s.name: row for s, row in zip(block.states, states, strict=True)},
        {s.name: np.append(row, row[-1]) for s, row in zip(block.inputs, plan.inputs, strict=True)},
        np.cumsum(plan.durations)[:-1],
        error,
        position,
        heading,
        dict(params or {}),
    )


def _in_steps(stage: Stage, ends: Ends, heading: str, steps: int) -> Plan:
    return _guess(stage, ends, steps * stage.period, steps, heading, 0.0)


Found = tuple[Plan, Array, float]


def _search(
    name: str,
    stage: Stage,
    ends: Ends,
    guesses: Sequence[float],
    intervals: int,
    tolerance: float,
    heading: str,
    params: Mapping[str, float] | None,
) -> Found:
    """Return the quickest plan with its simulated states and their difference."""
    first: list[Plan] = []
    said = set()
    headed = stage.position and any(s.name == heading for s in stage.plant.states)
    for duration in guesses:
        for turn in TURNS if headed else TURNS[:1]:
            plan = solve(stage, ends, _guess(stage, ends, duration, intervals, heading, turn), euler=True)
            if plan.said in SOLVED:
                first.append(plan)
            else:
                said.add(plan.said.replace("_", " ").lower())
    found: list[Found] = []
    tried: list[float] = []
    for plan in sorted(first, key=_duration):
        if found and (len(found) == BEST or _duration(plan) > LONGEST * tried[0]):
            break
        if any(abs(_duration(plan) - other) < SAME * other for other in tried):
            continue
        tried.append(_duration(plan))
        better = _precise(name, stage, ends, plan, tolerance, params)
        if isinstance(better, str):
            said.add(better)
        else:
            found.append(better)
    if not found:
        raise InputError(f"{name}: no manoeuvre found within the limits: {'; '.join(sorted(said))}")
    return min(found, key=lambda one: _duration(one[0]))


def _duration(plan: Plan) -> float:
    return float(plan.durations.sum())


def _precise(
    name: str, stage: Stage, ends: Ends, plan: Plan, tolerance: float, params: Mapping[str, float] | None
) -> Found | str:
    """Return a plan by Runge-Kutta steps that the simulation confirms, or the reason why there is none."""
    stage = replace(stage, substeps=substeps_of(name, stage.plant, float(plan.steps.max())))
    for _ in range(REFINEMENTS + 1):
        plan = solve(stage, ends, plan)
        if plan.said not in SOLVED:
            return plan.said.replace("_", " ").lower()
        try:
            states = _simulated(stage, ends, plan, params)
        except StoppedError as stopped:
            return str(stopped)
        error = float(np.abs(states - plan.states).max())
        if error <= tolerance:
            return plan, states, error
        stage = refined(stage)
    return f"the simulation differs by {error:.2g}, more than the tolerance {tolerance:g}"


def _simulated(stage: Stage, ends: Ends, plan: Plan, params: Mapping[str, float] | None) -> Array:
    """Return the states at the ends of intervals by the compiled plant, shape (n_states, n + 1)."""
    run = stage.plant.compile().start(ends.start, params)
    states = [ends.start]
    for u, h in zip(plan.inputs.T, plan.steps, strict=True):
        run.step(u, float(h))
        states.append(run.state)
    return np.array(states).T


def _guess(stage: Stage, ends: Ends, duration: float, intervals: int, heading: str, turn: float) -> Plan:
    """Return the shortest way at constant speed, the heading along it, other states linear in time."""
    signals = stage.plant.states
    final = np.where(np.isfinite(ends.end), ends.end, ends.start)
    phases = len(ends.waypoints) + 1
    rows = phases * intervals + 1
    states = ends.start[:, None] + (final - ends.start)[:, None] * np.linspace(0.0, 1.0, rows)
    parts = np.full(phases, 1.0 / phases)
    if stage.position:
        places = list(stage.position)
        points = np.vstack([ends.start[places], ends.waypoints, final[places]])
        ways = [way_around(np.array([a, b]), stage.obstacles) for a, b in pairwise(points)]
        along = [way.at(np.linspace(0.0, way.length, intervals + 1))[:, 1:] for way in ways]
        states[places, 1:] = np.concatenate(along, axis=1)
        lengths = np.array([way.length for way in ways])
        parts = np.maximum(lengths / max(lengths.sum(), 1e-9), 0.1 / phases)
        names = [s.name for s in signals]
        if heading in names and lengths.sum() > 0.0:
            k = names.index(heading)
            x, y = np.gradient(states[places], axis=1)
            angle = np.unwrap(np.arctan2(y, x))
            angle -= 2 * np.pi * np.round((angle[0] - ends.start[k]) / (2 * np.pi))
            states[k, 1:] = (angle + turn * np.clip(np.linspace(-1.0, 1.0, rows), 0.0, 1.0))[1:]
    middle = (stage.lower + stage.upper) / 2
    return Plan(duration * parts / parts.sum(), states, np.repeat(middle[:, None], rows - 1, axis=1))


def _ends(
    name: str, stage: Stage, start: Mapping[str, float], end: Mapping[str, float], points: Array
) -> Ends:
    """Return what is given of the motion, checked."""
    states, inputs = [s.name for s in stage.plant.states], [s.name for s in stage.plant.inputs]
    for what, given, known in (("start", start, [*states, *inputs]), ("end", end, states)):
        for key, value in given.items():
            check_known(key, known, f"{name}: {what}: no signal {key!r}")
            finite(f"{name}: {what}: {key}", value)
    if not end:
        raise InputError(f"{name}: end: expected the final value of at least one state")
    x0 = np.array([start.get(s.name, s.start) for s in stage.plant.states], dtype=float)
    before = np.array([start.get(key, np.nan) for key in inputs], dtype=float)
    return Ends(x0, before, np.array([end.get(key, np.nan) for key in states], dtype=float), points)


def _outside(name: str, stage: Stage, ends: Ends) -> None:
    """Raise if a given point lies within an obstacle."""
    places = list(stage.position)
    given = [("start", ends.start[places]), *(("a waypoint", p) for p in ends.waypoints)]
    given.append(("end", ends.end[places]))
    for what, point in given:
        for cx, cy, radius in stage.obstacles:
            if np.hypot(point[0] - cx, point[1] - cy) < radius:
                raise InputError(
                    f"{name}: {what} ({point[0]:g}, {point[1]:g}) m lies within {radius:g} m of the obstacle "
                    f"at ({cx:g}, {cy:g}) m (its radius and the clearance)"
                )
