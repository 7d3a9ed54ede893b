"""The quickest manoeuvre of a sampled plant: the fewest steps with which its end can be reached.

The duration is a whole number N of steps. For a given N the problem of :mod:`.time_optimal` has a solution or
none. N is doubled until there is one; the fewest steps lie between the last two numbers and are found by
bisection.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.control.controllers.shooting import Stage
from hovercontrol.control.controllers.time_optimal import SOLVED, Ends, Plan, solve

#: Most steps that are tried.
MOST = 1024


def fewest_steps(
    name: str, stage: Stage, ends: Ends, first: int, guess: Callable[[int], Plan], tolerance: float
) -> tuple[Plan, Array, float]:
    """Return the plan with the fewest steps, the states along it and how far the plan's differ from them.

    Parameters
    ----------
    name : str
        Of the function, for error messages.
    stage : Stage
        Of a sampled plant.
    ends : Ends
    first : int
        Number of steps to begin with.
    guess : callable
        Returns the guess of a number of steps.
    tolerance : float
        Largest difference of a state from that of the map itself [its unit].

    Raises
    ------
    InputError
        If the end is not reached within :data:`MOST` steps.
    """

    def found(steps: int) -> tuple[Plan, Array, float] | None:
        plan = solve(stage, ends, guess(steps))
        if plan.said not in SOLVED:
            return None
        states = _states(stage, ends, plan)
        error = float(np.abs(states - plan.states).max())
        return (plan, states, error) if error <= tolerance else None

    low, high = 0, first
    best = found(high)
    while best is None:
        low, high = high, 2 * high
        if high > MOST:
            raise InputError(f"{name}: no manoeuvre found within the limits and {MOST} steps")
        best = found(high)
    while high - low > 1:
        middle = (low + high) // 2
        better = found(middle)
        if better is None:
            low = middle
        else:
            high, best = middle, better
    return best


def _states(stage: Stage, ends: Ends, plan: Plan) -> Array:
    """Return the states of the map itself under the plan's inputs, shape (n_states, n + 1)."""
    f, h = numpy_functions(stage.plant), stage.plant.period
    params = dict(zip(stage.plant.default_parameters, stage.parameters, strict=True))
    states = [ends.start]
    for k, u in enumerate(plan.inputs.T):
        states.append(f.derivatives(k * h, states[-1], u, params))
    return np.array(states).T
