"""Every craft through python-control's own functions, against a system written by hand."""

import warnings

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from control import optimal

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.vehicles import vehicle

from .craft_by_hand import NAMES, X, by_hand, commands, linear_by_hand

every_craft = pytest.mark.parametrize("name", NAMES)
WEIGHTS = np.diag([1.0, 1.0, 0.5, 0.1, 0.1, 0.1])


def craft(name):
    return vehicle(name).plant().to_control()


@pytest.fixture(autouse=True)
def figures():
    yield
    plt.close("all")


def close(found, expected, rtol=1e-9):
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-9)


@every_craft
def test_dynamics_and_outputs_are_those_written_by_hand(name, rng):
    system, hand = craft(name), by_hand(name)
    for _ in range(10):
        x, u = rng.normal(size=6), rng.normal(size=system.ninputs)
        given = {next(key for key in system.params if "drag" in key or "thrust" in key): rng.uniform()}
        for params in (None, given):
            close(system.dynamics(0.0, x, u, params), hand.dynamics(0.0, x, u, params), 1e-12)
            close(system.output(0.0, x, u, params), hand.output(0.0, x, u, params), 1e-12)


@every_craft
def test_linearisation_and_its_regulator(name):
    u = commands(name)
    linear, hand = ct.linearize(craft(name), X, u), linear_by_hand(name, X, u)
    for matrix in "ABCD":
        close(getattr(linear, matrix), getattr(hand, matrix))
    R = np.eye(len(u))
    for found, expected in zip(ct.lqr(linear, WEIGHTS, R), ct.lqr(hand, WEIGHTS, R), strict=True):
        close(np.sort_complex(found.ravel()), np.sort_complex(expected.ravel()), 1e-6)


@every_craft
def test_an_operating_point_at_a_steady_speed(name):
    start, n = np.array([0, 0, 0, 1.0, 0, 0]), len(commands(name))
    free = {"y0": start, "iy": [3], "ix": [0, 1, 2], "idx": [3, 4, 5]}
    guess = np.zeros(n) + 0.1 * (np.arange(n) == 0)
    # The front fans stand still, and the craft does not turn; the rudder is straight.
    free |= {"iu": [2, 3], "ix": [0, 1, 2, 5]} if name == "four_fan" else {"iu": [1]}
    points = [ct.find_operating_point(s, start, guess, **free) for s in (craft(name), by_hand(name))]
    close(points[0].states, points[1].states, 1e-7)
    close(points[0].inputs, points[1].inputs, 1e-7)
    close(by_hand(name).dynamics(0.0, points[0].states, points[0].inputs)[3:], 0.0)


def yaw_alone(name):
    """The craft turned back by its own actuators, at rest otherwise: a planar system without inputs."""
    block = vehicle(name).plant()
    heading, rate = (block.signal(s) for s in ("psi", "r"))
    turn = sp.tanh(heading.symbol)
    if name == "four_fan":
        law = {"rear_left": 0.1 * turn, "rear_right": -0.1 * turn, "front_left": 0, "front_right": 0}
    else:
        law = {"thrust": sp.S.One, "rudder": 0.3 * turn}
    law |= {"u": 0, "v": 0}
    swap = {sp.Symbol(key, real=True): value for key, value in law.items()}
    still = block.unchecked(
        name="yaw",
        states=(heading, rate),
        inputs=(),
        outputs=(heading,),
        derivatives=Expressions((k, block.expand(block.derivatives[k]).xreplace(swap)) for k in ("psi", "r")),
        output_expressions=Expressions({"psi": heading.symbol}),
        definitions=Expressions(),
        definition_signals=(),
    )
    hand = by_hand(name)

    def rates(t, x, u, params):
        turn = np.tanh(x[0])
        u = [0.1 * turn, -0.1 * turn, 0, 0] if name == "four_fan" else [1.0, 0.3 * turn]
        return hand.updfcn(t, [0, 0, x[0], 0, 0, x[1]], u, hand.params)[[2, 5]]

    return still, ct.nlsys(rates, lambda t, x, u, p: x[:1], states=2, inputs=0, outputs=1, name="hand")


@pytest.mark.slow("c17_experiment", "four_fan", "hoverdemon")
@pytest.mark.filterwarnings("ignore")  # separatrices are followed back in time, out of all bounds
@every_craft
def test_the_phase_plane_of_one_output_and_no_inputs(name):
    block, hand = yaw_alone(name)
    system = block.to_control()
    assert (system.ninputs, system.noutputs) == (0, 1)
    box = [-1.0, 1.0, -1.0, 1.0]
    arrows = [ct.phaseplot.vectorfield(s, box, gridspec=[7, 7]) for s in (system, hand)]
    close(arrows[0].U, arrows[1].U)
    close(arrows[0].V, arrows[1].V)
    linear = ct.linearize(system, [0.0, 0.0])
    close(linear.dynamics(0, [0.02, 0.001]), linear.A @ [0.02, 0.001])
    close(ct.linearize(linear, [0.0, 0.0]).A, linear.A)
    for planar in (system, linear):
        assert ct.phase_plane_plot(planar, box, 0.3, gridspec=[2, 2]).figure is not None


def test_a_linear_system_without_inputs_is_sampled_as_any_other():
    block, _ = yaw_alone("hoverdemon")
    linear = ct.linearize(block.to_control(), [0.0, 0.0])
    with_one = ct.ss(linear.A, np.zeros((2, 1)), linear.C, 0)
    for method in ("zoh", "bilinear", "euler"):
        found, expected = ct.c2d(linear, 0.1, method), ct.c2d(with_one, 0.1, method)
        close(found.A, expected.A)
        close(found.C, expected.C)
        assert (found.dt, found.ninputs, found.name) == (0.1, 0, "yaw$linearized$sampled")
        assert found.state_labels == ["psi", "r"]
    plain = ct.c2d(linear, 0.1, copy_names=False)
    assert plain.state_labels == ["x[0]", "x[1]"]
    with pytest.raises(ValueError, match="continuous"):
        found.sample(0.1)


@every_craft
def test_a_gain_scheduled_state_feedback(name, rng):
    """Gains over the surge velocity, by python-control's own interpolation."""
    speeds = [0.0, 0.5, 1.0, 1.5]  # python-control begins its iteration at 0
    loops = []
    for system, linear in ((craft(name), ct.linearize), (by_hand(name), None)):
        gains = []
        for speed in speeds:
            x, u = np.where(np.arange(6) == 3, max(speed, 0.5), X), commands(name)
            at = linear(system, x, u) if linear else linear_by_hand(name, x, u)
            gains.append(ct.lqr(at, WEIGHTS, np.eye(len(u)))[0])
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # as "cannot verify system output is system state"
            loops.append(ct.create_statefbk_iosystem(system, (gains, speeds), gainsched_indices=["u"])[1])
    assert loops[0].input_labels == loops[1].input_labels
    for _ in range(5):
        x, r = X + 0.3 * rng.normal(size=6), rng.normal(size=loops[0].ninputs)
        close(loops[0].dynamics(0.0, x, r), loops[1].dynamics(0.0, x, r), 1e-6)


@every_craft
def test_an_estimator_of_the_linearised_craft(name, rng):
    u = commands(name)
    n, pose = len(u), np.eye(6)[:3]
    for step in (None, 0.1):
        linear, hand = ct.linearize(craft(name), X, u), linear_by_hand(name, X, u)
        if step:
            linear, hand = ct.c2d(linear, step), ct.c2d(hand, step)
        made = [
            ct.create_estimator_iosystem(s, 0.1 * np.eye(n), 0.01 * np.eye(3), np.eye(6), C=pose)
            for s in (linear, hand)
        ]
        assert made[0].dt == (step or 0)
        x, given = rng.normal(size=42), rng.normal(size=3 + n)
        close(made[0].dynamics(0.0, x, given), made[1].dynamics(0.0, x, given))


@every_craft
def test_optimal_control_by_collocation(name):
    """The same problem of both; the optimiser's differences amplify rounding by 1e8."""
    n, times = len(commands(name)), np.linspace(0, 0.5, 4)
    found = []
    for system in (craft(name), by_hand(name)):
        cost = optimal.quadratic_cost(system, np.eye(6), 0.1 * np.eye(n), x0=X + 0.1)
        limit = optimal.input_range_constraint(system, np.full(n, -1.0), np.full(n, 1.0))
        with warnings.catch_warnings(action="ignore"):  # four iterations are too few for an optimum
            found.append(
                optimal.solve_ocp(
                    system, times, X, cost, limit, print_summary=False, minimize_options={"maxiter": 4}
                )
            )
    assert found[0].cost == pytest.approx(found[1].cost, rel=1e-5)
    close(found[0].inputs, found[1].inputs, 1e-3)


# ---- describing functions ----------------------------------------------------------------------------------


def static(expression, argument, *parameters):
    output = Signal("y", "1")
    return Block("law", [], [argument], [output], list(parameters), output_expressions={"y": expression})


def test_the_describing_function_of_a_saturation_block():
    """A limit cycle of python-control's own example, with a Block in place of its nonlinearity."""
    u = Signal("a", "1")
    law = static(sp.Max(-1, sp.Min(1, u.symbol)), u).to_control()
    amplitudes = np.linspace(1, 4, 10)
    linear = ct.tf([8], [1, 2, 2, 1])
    found, expected = (
        ct.describing_function_response(linear, f, amplitudes, np.logspace(-1, 1, 200))
        for f in (law, ct.saturation_nonlinearity(1))
    )
    assert len(found.intersections) == len(expected.intersections) == 1
    close(found.intersections[0], expected.intersections[0], 1e-3)
    assert found.plot() is not None


@every_craft
def test_the_describing_function_of_dry_friction_on_each_craft(name):
    """For a relay of height M: N(A) = 4 M / (pi A) (Slotine and Li, Applied Nonlinear Control, 5.3)."""
    speed, width = Signal("speed", "m/s"), Signal("width", "m/s", start=1e-4)
    height = vehicle(name).plant().default_parameters.get("plant.surge_coulomb", 1.35)
    law = static(height * sgn(speed.symbol, width.symbol), speed, width).to_control()
    amplitudes = np.array([0.1, 0.5, 2.0])
    found = ct.describing_function(law, amplitudes, num_points=2000)
    np.testing.assert_allclose(found.real, 4 * height / (np.pi * amplitudes), rtol=2e-3)
    np.testing.assert_allclose(found.imag, 0.0, atol=1e-9)


def test_the_describing_function_of_a_nonlinearity_with_memory():
    """Backlash as a sampled Block; python-control takes any function with a memory of its own."""
    a, z = Signal("a", "1"), Signal("z", "1")
    following = sp.Max(a.symbol - sp.S.Half, sp.Min(a.symbol + sp.S.Half, z.symbol))
    y = Signal("y", "1")
    backlash = Block("backlash", [z], [a], [y], [], {"z": following}, {"y": following}, period=1.0)
    system, state = backlash.to_control(), np.zeros(1)

    def law(value):
        output = system.output(0.0, state, [value])
        state[:] = system.dynamics(0.0, state, [value])
        return output

    amplitudes = np.array([1.0, 2.0, 5.0])
    found = ct.describing_function(law, amplitudes, num_points=2000)
    expected = ct.describing_function(ct.friction_backlash_nonlinearity(1), amplitudes)
    np.testing.assert_allclose(found, expected, rtol=5e-3)
