"""A continuous Block as a discrete-time system of python-control, exact for inputs that hold."""

import pickle
import shutil

import control as ct
import numpy as np
import pytest
import sympy as sp
from control import optimal
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends import discrete
from hovercontrol.blocks.backends.engines import NumpyEngine
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.controllers.references import circle
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.fmi import load

from .craft_by_hand import NAMES, X, by_hand, commands

every_craft = pytest.mark.parametrize("name", NAMES)
H = 0.05


def sampled(name, step=H):
    return vehicle(name).plant().to_control(step=step)


def flow(name, x, u, params=None, step=H):
    """The craft's equations by hand, integrated by SciPy."""
    hand = by_hand(name)
    values = {**hand.params, **(params or {})}
    run = solve_ivp(lambda t, x: hand.updfcn(t, x, u, values), (0, step), x, "DOP853", rtol=1e-12, atol=1e-13)
    return run.y[:, -1]


@every_craft
def test_a_step_is_the_solution_over_it(name, rng):
    system = sampled(name)
    assert (system.dt, system.state_labels) == (H, ["x", "y", "psi", "u", "v", "r"])
    key = next(key for key in system.params if "drag" in key or "thrust" in key)
    for params in ({}, {key: 0.7}):
        x, u = X + 0.1 * rng.normal(size=6), commands(name)
        np.testing.assert_allclose(
            system.dynamics(0.0, x, u, params), flow(name, x, u, params), rtol=0, atol=1e-9
        )
        np.testing.assert_array_equal(system.output(0.0, x, u), x)


@every_craft
def test_the_linearisation_at_an_equilibrium_is_that_of_the_linear_system_sampled(name):
    rest, none = np.zeros(6), np.zeros(len(commands(name)))
    linear = ct.linearize(vehicle(name).plant().to_control(), rest, none)
    expected, found = ct.c2d(linear, H, "zoh"), ct.linearize(sampled(name), rest, none)
    assert found.dt == H
    for matrix in "ABCD":
        np.testing.assert_allclose(getattr(found, matrix), getattr(expected, matrix), rtol=0, atol=1e-9)


@every_craft
def test_the_linearisation_along_a_moving_point_is_that_of_differences(name):
    x, u, h = X, commands(name), 1e-5
    found = sampled(name).linearize(x, u)
    by_x = [(flow(name, x + h * e, u) - flow(name, x - h * e, u)) / (2 * h) for e in np.eye(6)]
    by_u = [(flow(name, x, u + h * e) - flow(name, x, u - h * e)) / (2 * h) for e in np.eye(len(u))]
    np.testing.assert_allclose(found.A, np.transpose(by_x), rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.B, np.transpose(by_u), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.C, np.eye(6))
    assert not found.D.any()


@every_craft
def test_sample_and_c2d_give_the_same_system(name):
    system = vehicle(name).plant().to_control()
    key = next(iter(system.params))
    system.params[key] = 0.5
    for other in (system.sample(H), ct.c2d(system, H), ct.sample_system(system, H, "zoh", name="given")):
        np.testing.assert_array_equal(
            other.dynamics(0.0, X, commands(name)),
            sampled(name).dynamics(0.0, X, commands(name), {key: 0.5}),
        )
        assert (other.dt, other.input_labels) == (H, system.input_labels)
    assert (system.sample(H).name, other.name) == ("plant$sampled", "given")
    plain = system.sample(H, copy_names=False, outputs=list("abcdef"))
    assert (plain.state_labels[0], plain.output_labels[0]) == ("x[0]", "a")


@every_craft
def test_a_regulator_of_the_sampled_craft_holds_its_speed(name):
    """``ct.dlqr`` on the exact linearisation, closed around the nonlinear craft by python-control."""
    system = sampled(name)
    kept = [3, 4, 5]
    u = commands(name)
    linear = ct.linearize(system, X, u)
    K = np.zeros((len(u), 6))
    A, B = linear.A[np.ix_(kept, kept)], linear.B[kept]
    K[:, kept] = ct.dlqr(A, B, np.eye(3), np.eye(len(u)))[0]
    loop = ct.create_statefbk_iosystem(system, K)[1]
    assert loop.dt == H
    reference = np.concatenate([np.zeros(6), u + K @ X])  # u = ud - K (x - xd) is the command at X
    closed = ct.linearize(loop, X, reference)  # python-control's own differences
    np.testing.assert_allclose(closed.A, linear.A - linear.B @ K, rtol=0, atol=1e-5)
    times = np.arange(0, 40) * H
    wanted = np.vstack([np.zeros((6, 40)), np.zeros((len(u), 40))])
    run = ct.input_output_response(loop, times, wanted, [0, 0, 0, 0.05, 0.02, -0.05])
    assert np.isfinite(run.outputs).all()
    x = run.states
    for k in range(3):  # each step is that of the craft by hand under the law u = -K x
        np.testing.assert_allclose(x[:, k + 1], flow(name, x[:, k], -K @ x[:, k]), rtol=0, atol=1e-9)


def test_python_control_simulates_it_as_the_package_does():
    block, t = vehicle("c17_simulation").plant(), np.arange(0, 41) * H
    u = np.vstack([1.0 + 0.5 * np.sin(t), 0.3 * np.cos(2 * t)])
    found = ct.input_output_response(block.to_control(step=H), t, u, X)
    for run in (hc.simulate(block, t, u, X, rtol=1e-10, atol=1e-12), block.compile().simulate(t, u, X)):
        np.testing.assert_allclose(found.states, run.states, rtol=0, atol=2e-5)


def test_an_operating_point_is_that_of_the_continuous_craft():
    system = sampled("four_fan")
    free = {"y0": [0, 0, 0, 1.0, 0, 0], "iy": [3], "ix": [0, 1, 2, 5], "iu": [2, 3], "idx": [3, 4, 5]}
    point = ct.find_operating_point(system, [0, 0, 0, 1.0, 0, 0], [0.1, 0.1, 0, 0], **free)
    np.testing.assert_allclose(
        by_hand("four_fan").dynamics(0, point.states, point.inputs)[3:], 0.0, atol=1e-6
    )


def test_optimal_control_by_shooting_on_the_sampled_craft():
    """For a linear plant: against the Riccati recursion (Bertsekas, Dynamic Programming, 3.1)."""
    v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=0.5)
    cart = Block("cart", [v], [a], [v], [k], {"v": a.symbol - k.symbol * v.symbol}).to_control(step=0.5)
    A, B = np.exp(-0.25), (1 - np.exp(-0.25)) / 0.5
    cost = optimal.quadratic_cost(cart, np.eye(1), np.eye(1))
    last = optimal.quadratic_cost(cart, 2 * np.eye(1), None)
    found = optimal.solve_ocp(
        cart, np.arange(5) * 0.5, [1.0], cost, terminal_cost=last, print_summary=False,
        minimize_method="SLSQP", minimize_options={"ftol": 1e-12},
    )  # fmt: skip
    P, gains = 2.0, []
    for _ in range(4):
        gains.append(A * B * P / (1 + B * P * B))
        P = 1 + A * P * A - A * P * B * gains[-1]
    x, u = 1.0, []
    for gain in reversed(gains):
        u.append(-gain * x)
        x = A * x + B * u[-1]
    np.testing.assert_allclose(np.ravel(found.inputs)[:4], u, atol=1e-5)


# ---- an imported FMU and a craft ---------------------------------------------------------------------------


@pytest.mark.slow  # builds the FMU
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
def test_an_imported_fmu_joins_a_craft(tmp_path):
    """A yaw-rate controller with its own state as an FMU, and the craft: the loop is that of both Blocks."""
    rate, wanted, sum_ = Signal("r", "rad/s"), Signal("r_ref", "rad/s"), Signal("sum", "rad")
    rudder, thrust = Signal("rudder", "rad"), Signal("thrust", "1")
    gain, slow, level = Signal("k", "s", start=0.4), Signal("ki", "1", start=0.2), Signal("level", start=2.0)
    error = rate.symbol - wanted.symbol
    law = Block(
        "law", [sum_], [rate, wanted], [thrust, rudder], [gain, slow, level], {"sum": error},
        {"thrust": level.symbol, "rudder": gain.symbol * error + slow.symbol * sum_.symbol},
    )  # fmt: skip
    plant = vehicle("c17_simulation").plant()
    t = np.arange(0, 101) * 0.02
    with load(law.to_fmu(tmp_path / "law.fmu"), step=0.02) as fmu:
        parts = [fmu, plant.to_control(step=0.02)]
        joined = ct.interconnect(parts, inputs=["r_ref"], outputs=["psi", "r"], name="loop")
        found = ct.input_output_response(joined, t, np.full(t.size, 0.5), [0, *np.zeros(6)])
    both = [law.to_control(step=0.02), plant.to_control(step=0.02)]
    own = ct.interconnect(both, inputs=["r_ref"], outputs=["psi", "r"], name="own")
    expected = ct.input_output_response(own, t, np.full(t.size, 0.5), np.zeros(7))
    np.testing.assert_allclose(found.outputs, expected.outputs, rtol=0, atol=1e-6)
    assert abs(found.outputs[1, -1] - 0.5) < 0.1  # it turns as it is told


# ---- other Blocks ------------------------------------------------------------------------------------------


def test_a_block_without_inputs_and_one_without_states():
    x, v, w = Signal("x", "m", start=1.0), Signal("v", "m/s"), Signal("w", "1/s^2", start=4.0)
    swing = Block("swing", [x, v], [], [x], [w], {"x": v.symbol, "v": -w.symbol * x.symbol})
    system = swing.to_control(step=0.1)
    np.testing.assert_allclose(system.dynamics(0, [1, 0], []), [np.cos(0.2), -2 * np.sin(0.2)], atol=1e-9)
    turn = [[np.cos(0.2), np.sin(0.2) / 2], [-2 * np.sin(0.2), np.cos(0.2)]]
    np.testing.assert_allclose(ct.linearize(system, [0.3, 0.1]).A, turn, atol=1e-9)
    still = circle(1.0).to_control(step=0.1)
    assert (still.dt, still.nstates) == (0.1, 0)
    run = ct.input_output_response(still, np.arange(3) * 0.1, 0)
    np.testing.assert_allclose(run.outputs[0], np.cos([0.0, 0.1, 0.2]), atol=1e-12)


def test_what_switches_within_a_step_by_the_clock_is_seen():
    v, k, until = Signal("v", "m"), Signal("k", "1/s", start=1.0), Signal("until", "s", start=0.13)
    pulse = sp.Piecewise((k.symbol, time < until.symbol), (-3 * k.symbol, True))
    block = Block("pulse", [v], [], [v], [k, until], {"v": pulse * v.symbol})
    system, factor = block.to_control(step=0.2), np.exp(0.13 - 3 * 0.07)
    assert system.dynamics(0.0, [2.0], [])[0] == pytest.approx(2 * factor, abs=1e-9)
    assert system.linearize([2.0]).A.item() == pytest.approx(factor, abs=1e-9)


def test_without_a_compiler_the_numbers_are_the_same(monkeypatch):
    expected = sampled("c17_simulation").dynamics(0.0, X, commands("c17_simulation"))
    monkeypatch.setattr(discrete, "engine_of", lambda block, friction: NumpyEngine(block))
    found = sampled("c17_simulation").dynamics(0.0, X, commands("c17_simulation"))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def test_copies_and_pickles_compute_the_same():
    system = sampled("hoverdemon")
    expected = system.dynamics(0.0, X, [1.0, 0.1])
    for twin in (system.copy(name="twin"), pickle.loads(pickle.dumps(system))):
        np.testing.assert_array_equal(twin.dynamics(0.0, X, [1.0, 0.1]), expected)
        assert twin.dt == H
    assert system.updfcn(0.0, X, [1.0, 0.1], {"plant.thrust": 2.0})[3] > expected[3]
    np.testing.assert_array_equal(system.dynamics(0.0, X, [1.0, 0.1]), expected)


def test_late_inputs_are_held_in_registers():
    late = vehicle("hoverdemon").with_effects([effect("input_delay", seconds=0.1)]).plant()
    system = late.to_control(step=0.05)
    assert system.dt == 0.05


def test_a_sampled_block_has_the_step_of_its_period():
    n = Signal("n")
    counter = Block("counter", [n], [], [n], derivatives={"n": n.symbol + 1}, period=0.1)
    assert counter.to_control(step=0.1).dt == counter.to_control().dt == 0.1
    with pytest.raises(InputError, match=r"sampled every 0.1 s, found step=0.05"):
        counter.to_control(step=0.05)


@pytest.mark.parametrize("step", [0.0, -0.1, np.inf, "0.1"])
def test_a_step_that_is_none_is_refused(step):
    with pytest.raises(InputError, match="step"):
        vehicle("hoverdemon").plant().to_control(step=step)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: ct.c2d(s, 0.1, "tustin"), "method='zoh' alone, found 'tustin'"),
        (lambda s: s.sample(0.1).sample(0.1), "already discrete, with a step of 0.1 s"),
        (lambda s: s.sample(0.1).dynamics(0, X, [1, 0], {"plant.thrst": 1.0}), "did you mean 'plant.thrust'"),
    ],
)
def test_what_cannot_be_sampled_is_refused_in_one_line(call, message):
    with pytest.raises(InputError, match=message):
        call(vehicle("hoverdemon").plant().to_control())
