"""python-control: a call of a Block's system over that of a hand-written one, and optimal control.

Times are processor time of one thread. The hand-written system is a ``control.nlsys`` of the same equations
on plain floats, as a user would write it for speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from time import process_time
from typing import Any

import control
import numpy as np
from control import optimal

from benchmarks.step import per_call
from hovercontrol.blocks.backends.optimal_control import solve_ocp
from hovercontrol.craft.models.vehicles import vehicle

X, U = np.array([0.1, -0.2, 0.3, 0.5, -0.1, 0.8]), np.array([1.5, 0.2])


def by_hand() -> control.NonlinearIOSystem:
    """Return C17's craft (11) written by hand, dry friction smoothed by tanh."""

    def rates(t: float, states: Any, inputs: Any, params: dict[str, float]) -> Any:
        _, _, psi, u, v, r = states.tolist()
        thrust, rudder = inputs.tolist()
        c, p = (math.cos(psi), math.sin(psi)), params
        width = p["width"]
        return np.array(
            [
                u * c[0] - v * c[1],
                u * c[1] + v * c[0],
                r,
                v * r - p["c1"] * math.tanh(u / width) - p["c2"] * u + p["c7"] * thrust * math.cos(rudder),
                -u * r - p["c3"] * math.tanh(v / width) - p["c4"] * v + p["c7"] * thrust * math.sin(rudder),
                -p["c5"] * math.tanh(r / width) - p["c6"] * r - p["c8"] * thrust * math.sin(rudder),
            ]
        )

    values = {"c1": 1.35, "c2": 0.0, "c3": 0.0, "c4": 1.2, "c5": 0.83, "c6": 0.48, "c7": 0.75, "c8": 6.1425}
    outputs = lambda t, x, u, params: x  # noqa: E731
    params = {**values, "width": 0.01}
    return control.nlsys(rates, outputs, states=6, inputs=2, outputs=6, params=params, name="hand")


def optimum(system: control.NonlinearIOSystem, solve: Any, steps: int) -> tuple[int, float]:
    """Return simulations and time [s] of an optimal control problem: 9 times to 2 s, SLSQP."""
    start, end, held = (
        np.array([0, 0, 0, 0.5, 0, 0]),
        np.array([1.5, 0.3, 0, 0.5, 0, 0]),
        np.array([2.0, 0.0]),
    )
    weights = np.diag([1, 1, 0.1, 0.1, 0.1, 0.1])
    cost = optimal.quadratic_cost(system, weights, 0.1 * np.eye(2), end, held)
    last = optimal.quadratic_cost(system, 10 * weights, None, end, held)
    begin = process_time()
    result = solve(
        system,
        np.linspace(0, 2, 9),
        start,
        cost,
        [optimal.input_range_constraint(system, [0, -0.6], [6, 0.6])],
        terminal_cost=last,
        trajectory_method="shooting",
        initial_guess=held,
        minimize_method="SLSQP",
        minimize_options={"maxiter": steps},
        print_summary=False,
    )
    return result.problem.system_simulations, process_time() - begin


def optimal_control(system: control.NonlinearIOSystem) -> float:
    """Return what a simulation costs in that problem [s], in three steps."""
    simulations, spent = optimum(system, optimal.solve_ocp, 3)
    return spent / simulations


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    block, hand = vehicle("c17_simulation").plant(), by_hand()
    system = block.to_control()
    assert np.allclose(system.dynamics(0, X, U), hand.dynamics(0, X, U), rtol=1e-12)
    for what in ("dynamics", "output"):
        own, native = (per_call(partial(getattr(s, what), 0.0, X, U)) for s in (system, hand))
        yield f"system.{what}(t, x, u) by hand", f"{1e6 * native:.2f} us", "", None
        over = 1e6 * (own - native)
        text = f"{1e6 * own:.2f} us ({own / native:.2f} x, {over:+.2f} us)"
        yield f"system.{what}(t, x, u) of the Block", text, "<= 5 us over", over <= 5.0
    given = {"plant.thrust": 0.8}
    call = per_call(lambda: system.dynamics(0.0, X, U, given))
    yield "the same with params", f"{1e6 * call:.2f} us", "", None
    for step in (0.02, 0.25):
        stepped = block.to_control(step=step)
        call = per_call(partial(stepped.dynamics, 0.0, X, U))
        yield f"to_control(step={step}).dynamics(t, x, u)", f"{1e6 * call:.2f} us", "", None
    before = optimal_control(hand)
    for what, one in (("to_control()", system), ("to_control(step=0.25)", block.to_control(step=0.25))):
        each = optimal_control(one)
        text = f"{1e3 * each:.2f} ms ({before / each:.1f} x as fast as by hand)"
        yield f"solve_ocp, {what}, a simulation", text, "", None
    stepped = block.to_control(step=0.25)
    optimum(stepped, solve_ocp, 100)  # builds its library
    for what, solve in (("ct.optimal.solve_ocp", optimal.solve_ocp), ("hc.solve_ocp", solve_ocp)):
        simulations, spent = optimum(stepped, solve, 100)
        yield f"{what} to the optimum", f"{simulations} simulations, {spent:.2f} s", "", None
