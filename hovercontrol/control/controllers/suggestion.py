"""The horizon and the weights of a predictive controller along waypoints, from the craft itself.

A plan that ends before a turn has paid off is no better than resting, and one that ends before the craft
could stop runs past its waypoint. So the horizon has the times to get going, to turn round and to stop::

    T = T_go + T_turn + T_stop,

each the shortest one under constant inputs at their limits or at rest, from rest: T_go to reach the speed of
the reference, T_turn to turn by pi, T_stop to fall from that speed to 1/e of it on a straight way.

Weights follow Bryson's rule, 1 over the square of an acceptable deviation (Bryson and Ho, Applied Optimal
Control, 1975, section 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.constant_inputs import constant_inputs
from hovercontrol.control.controllers.prediction_arguments import substeps_of
from hovercontrol.control.controllers.shooting import Stage

#: Whether it occurs after each step; given states, shape (n_constants, n_points + 1, n_states), and the step.
Event = Callable[[Array, float], NDArray[np.bool_]]

#: Points of a trial run, and its durations [s], of which the first that is long enough counts; the points of
#: a sampled plant are its steps at first.
POINTS, DURATIONS = 200, 0.25 * 2.0 ** np.arange(18)
#: Number of periods that is aimed at if the period is free, and the mantissas of a round period.
PERIODS, ROUND = 40, (1.0, 2.0, 5.0, 10.0)
#: Acceptable deviation of the heading [rad], of an input, and of its change in a period [its range].
HEADING, INPUT, CHANGE = 1.0, 3.0, 2.0


class Times(NamedTuple):
    """Times to get going, to turn by pi and to stop [s]; 0 where the craft cannot."""

    go: float
    turn: float
    stop: float


def times_of(stage: Stage, speed: float, heading: int) -> Times:
    """Return the times of a craft, from a stage with finite bounds of the inputs; its period does not count.

    Parameters
    ----------
    speed : float
        Of the reference [m/s].
    heading : int
        Index of the state that is the heading, -1 for none.
    """
    rest = np.clip(0.0, stage.lower, stage.upper)
    constants = constant_inputs(stage.lower, stage.upper, rest, sizes=np.ones(1))[0]
    start = np.array([s.start for s in stage.plant.states])

    def speeds(x: Array, h: float) -> Array:
        return np.linalg.norm(np.diff(x[..., list(stage.position)], axis=1), axis=2) / h

    def turned(x: Array) -> Array:
        return np.abs(x[:, 1:, heading] - x[:, :1, heading]) if heading >= 0 else np.zeros(x[:, 1:, 0].shape)

    go, moving = _first(stage, start, constants, lambda x, h: speeds(x, h) >= speed)
    turn, _ = (
        _first(stage, start, constants, lambda x, h: turned(x) >= math.pi) if heading >= 0 else (0.0, None)
    )
    stop = 0.0
    if moving is not None:
        braking = np.vstack([rest, constants])
        slow = speed / math.e
        stop, _ = _first(stage, moving, braking, lambda x, h: (speeds(x, h) <= slow) & (turned(x) <= HEADING))
    return Times(go, turn, stop)


def _first(stage: Stage, start: Array, constants: Array, event: Event) -> tuple[float, Array | None]:
    """Return the earliest time at which an event occurs under a constant input [s], and the state; or 0."""
    own = stage.plant.period
    for duration in DURATIONS:
        h = duration / DURATIONS[0] * own if own else duration / POINTS
        n = substeps_of("", stage.plant, h)
        each = replace(stage, substeps=1).step(h / n).mapaccum(POINTS * n)
        runs = [np.array(each(start, np.tile(u[:, None], POINTS * n)))[:, n - 1 :: n] for u in constants]
        x = np.array([np.column_stack([start, run]).T for run in runs])
        with np.errstate(all="ignore"):  # where a run diverges nothing occurs
            found = event(x, h)
        if found.any():
            k = int(np.argmax(found.any(axis=0)))
            return (k + 1) * h, x[int(np.argmax(found[:, k])), k + 1]
    return 0.0, None


def suggested_periods(times: Times, period: float | None) -> tuple[float, int]:
    """Return the period [s] and the number of periods; a free period is a round number.

    Examples
    --------
    >>> suggested_periods(Times(0.3, 0.8, 3.5), None)
    (0.1, 46)
    """
    total = sum(times)
    if period is None:
        wanted = total / PERIODS
        decade = 10.0 ** math.floor(math.log10(wanted))
        period = min((r * decade for r in ROUND), key=lambda r: abs(math.log(r / wanted)))
    return period, max(2, math.ceil(total / period))


def suggested_weights(
    stage: Stage, acceptance: float, heading: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the weights of states and inputs, and of the changes of inputs, by name.

    Parameters
    ----------
    acceptance : float
        Acceptable distance from the reference [m].
    """
    states = [s.name for s in stage.plant.states]
    weights = {states[i]: acceptance**-2 for i in stage.position}
    if heading >= 0:
        weights[states[heading]] = HEADING**-2
    ranges = {s.name: float(r) for s, r in zip(stage.plant.inputs, stage.upper - stage.lower, strict=True)}
    weights |= {key: (INPUT * r) ** -2 for key, r in ranges.items()}
    return weights, {key: (CHANGE * r) ** -2 for key, r in ranges.items()}
