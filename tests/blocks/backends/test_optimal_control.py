"""Optimal control with gradients: those of SciPy's differences, python-control's optimum."""

import warnings

import control
import numpy as np
import pytest
import sympy as sp
from control import flatsys, optimal
from scipy.optimize import LinearConstraint, NonlinearConstraint

import hovercontrol as hc
from hovercontrol.blocks.backends.optimal_control import GradientProblem

BLOCK = hc.vehicle("c17_simulation").plant()
START, END, HELD = np.array([0, 0, 0, 0.5, 0, 0]), np.array([1.5, 0.3, 0, 0.5, 0, 0]), np.array([2.0, 0.0])
TIMES = np.linspace(0, 2, 9)
WEIGHTS = np.diag([1, 1, 0.1, 0.1, 0.1, 0.1])


def craft(way):
    return BLOCK.to_control(step=0.25) if way == "shooting" else BLOCK.to_control()


def costs(system):
    cost = optimal.quadratic_cost(system, WEIGHTS, 0.1 * np.eye(2), END, HELD)
    return cost, optimal.quadratic_cost(system, 10 * WEIGHTS, None, END, HELD)


def solved(function, system):
    cost, last = costs(system)
    with warnings.catch_warnings(action="ignore"):
        return function(
            system, TIMES, START, cost, [optimal.input_range_constraint(system, [0, -0.6], [6, 0.6])],
            terminal_cost=last, initial_guess=HELD, print_summary=False, minimize_method="SLSQP",
        )  # fmt: skip


def differences(of, c):
    """Central differences; a simulation is exact to 1e-10, so that their rounding is about 1e-6."""
    steps = 1e-4 * np.eye(len(c))
    return np.array([(np.array(of(c + s)) - np.array(of(c - s))) / 2e-4 for s in steps]).T


def test_it_is_python_control_s_optimum_with_a_tenth_of_the_simulations():
    system = craft("shooting")
    ours, theirs = solved(hc.solve_ocp, system), solved(optimal.solve_ocp, system)
    assert ours.success and isinstance(ours, optimal.OptimalControlResult)
    assert ours.cost <= theirs.cost + 1e-6 * abs(theirs.cost)
    assert ours.inputs[:, :-1] == pytest.approx(theirs.inputs[:, :-1], abs=2e-3)
    assert ours.problem.system_simulations <= theirs.problem.system_simulations / 10
    # the states are those of python-control's own simulation of the inputs
    again = control.input_output_response(system, TIMES, ours.inputs, START)
    assert ours.states == pytest.approx(again.states, abs=1e-9)


@pytest.mark.parametrize("way", ["shooting", "collocation", "basis", "switching"])
def test_gradients_are_the_differences_of_the_functions(way, rng):
    options = {}
    system = craft(way if way == "collocation" else "shooting")
    if way == "switching":
        import sympy as sp

        v, a, on = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), hc.Signal("on", "s", start=0.6)
        k = hc.Signal("k", "1/m", start=0.4)
        push = sp.Piecewise((a.symbol, hc.time < on.symbol), (2 * a.symbol, True))
        system = hc.Block(
            "v", [v], [a], [v], [k, on], derivatives={"v": push - k.symbol * v.symbol**2}
        ).to_control(step=0.25)
    if way == "basis":
        options["basis"] = flatsys.BezierFamily(4, T=2.0)
    n, m = system.nstates, system.ninputs
    problem = GradientProblem(
        system,
        TIMES,
        lambda x, u: np.sum(np.sin(x) ** 2) + np.sum(u**4),
        trajectory_constraints=[
            NonlinearConstraint(lambda x, u: x[0] ** 2 + np.exp(0.1 * u[0]), 0.3, np.inf),
            LinearConstraint(np.ones((1, n + m)), -1.0, 1.0),
        ],
        terminal_cost=lambda x, u: np.cosh(x[0]),
        terminal_constraints=NonlinearConstraint(lambda x, u: x[:1] * x[-1:], 0.5, 0.5),
        **options,
    )
    problem.x = START[:n]
    size = problem.initial_guess.size
    c = np.abs(rng.normal(1.0, 0.3, size))
    assert problem._gradient(c) == pytest.approx(differences(problem._cost_function, c), rel=1e-5, abs=1e-5)
    assert len(problem.constraints) == 2 + (way == "collocation")
    for one in problem.constraints:
        found, expected = one.jac(c), np.atleast_2d(differences(one.fun, c))
        assert found.shape == expected.shape
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("system", "times", "options", "said"),
    [
        (control.tf([1], [1, 1]), TIMES, {}, "expected the system of a Block"),
        (craft("shooting"), [0.0, 0.5], {}, r"expected times 0.25 s apart, the step of 'plant', found 0.5"),
        (craft("shooting"), [0.5, 0.25], {}, "increasing times"),
        (craft("collocation"), TIMES, {"trajectory_method": "shooting"}, r"use to_control\(step=...\)"),
        (
            craft("shooting"),
            TIMES,
            {"terminal_constraints": [(1, 2)]},
            r"terminal_constraints: expected Linear",
        ),
        (craft("shooting"), TIMES, {"trajectory_constraints": range(2)}, r"of SciPy, found 0"),
    ],
)
def test_wrong_input_is_refused_in_one_line(system, times, options, said):
    with pytest.raises(hc.InputError, match=said):
        hc.solve_ocp(system, times, START, lambda x, u: 0.0, **options)


def test_an_initial_state_of_another_size_is_refused_in_one_line():
    with pytest.raises(hc.InputError, match=r"initial_state: expected 6 values, found shape \(2,\)"):
        hc.solve_ocp(craft("shooting"), TIMES, [0.0, 0.0], lambda x, u: 0.0)


V, N = hc.Signal("v", "m/s"), hc.Signal("n")
K, D = hc.Signal("k", "m/s^2", start=2.0), hc.Signal("d", "1/s", start=0.5)
HIDDEN = {"n abs(n)": N.symbol * sp.Abs(N.symbol), "n^2": N.symbol**2, "abs(n)": sp.Abs(N.symbol)}


@pytest.mark.parametrize("step", [0.2, None], ids=["shooting", "collocation"])
@pytest.mark.parametrize("name", HIDDEN)
def test_from_rest_it_moves_where_the_derivative_by_the_input_vanishes(name, step):
    plant = hc.Block("plant", [V], [N], [V], [K, D], {"v": K.symbol * HIDDEN[name] - D.symbol * V.symbol})
    system = plant.to_control(step=step)
    cost = optimal.quadratic_cost(system, [[1.0]], [[1e-3]], x0=[0.5])
    bounds = optimal.input_range_constraint(system, [-1.0], [1.0])
    times = np.arange(6) * 0.2
    found = hc.solve_ocp(system, times, [0.0], cost, trajectory_constraints=bounds)

    def by_hand(n):  # the cost of a constant input: v = (F/d) (1 - exp(-d t))
        v = 2.0 * abs(n) ** (1 if name == "abs(n)" else 2) / 0.5 * (1 - np.exp(-0.5 * times))
        each = (v - 0.5) ** 2 + 1e-3 * n**2
        return each[:-1].sum() if step else np.trapezoid(each, times)

    best = min(map(by_hand, np.linspace(0.0, 1.0, 101)))
    assert found.success and found.cost < 1.01 * best < 0.6 * by_hand(0.0)
