"""python-control linearises Blocks: each way in which its users call it, against central differences."""

import control as ct
import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import pade
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.references import circle
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import VEHICLES, c17_simulation, vehicle

X, U = np.array([0.1, -0.2, 0.3, 0.5, -0.1, 0.8]), np.array([1.5, 0.2])
RATE = Signal("w", "1/s", start=1.0)


def differences(function, x, u, h=1e-6):
    """Return the matrices of f(x, u) by central differences."""
    by_x = [(function(x + h * e, u) - function(x - h * e, u)) / (2 * h) for e in np.eye(len(x))]
    by_u = [(function(x, u + h * e) - function(x, u - h * e)) / (2 * h) for e in np.eye(len(u))]
    rows = len(function(x, u))
    return np.reshape(by_x, (-1, rows)).T, np.reshape(by_u, (-1, rows)).T


def assert_is_linearisation(linear, block, x, u):
    f, x, u = block.to_numpy(), np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    A, B = differences(lambda x, u: f.derivatives(0.0, x, u), x, u)
    C, D = differences(lambda x, u: f.outputs(0.0, x, u), x, u)
    for found, expected in ((linear.A, A), (linear.B, B), (linear.C, C), (linear.D, D)):
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def linear_law(state, other, sign=1):
    """A first-order Block from `other` to `state`."""
    x, u = Signal(state, "1", start=1.0), Signal(other, "1")
    return Block(state.upper(), [x], [u], [x], [RATE], {state: RATE.symbol * (sign * u.symbol - x.symbol)})


def decay():
    x = Signal("x", "1", start=1.0)
    return Block("decay", [x], [], [x], [RATE], {"x": -RATE.symbol * x.symbol})


# ---- every craft, every way of calling -------------------------------------------------------------------


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize(
    ("call", "commanded"),
    [
        (lambda s, x, u: ct.linearize(s, x), False),
        (lambda s, x, u: ct.linearize(s, list(x), None), False),
        (lambda s, x, u: ct.linearize(s, x, 0), False),
        (lambda s, x, u: ct.linearize(s, x, u), True),
        (lambda s, x, u: ct.linearize(s, [x[:2], x[2:]], list(u)), True),
        (lambda s, x, u: ct.linearize(s, ct.OperatingPoint(x, u)), True),
        (lambda s, x, u: ct.linearize(s, ct.OperatingPoint(x, 0 * u), u), True),
        (lambda s, x, u: s.block.linearize(x), False),
        (lambda s, x, u: s.block.linearize(ct.OperatingPoint(x, u)), True),
    ],
)
def test_each_craft_is_linearised_as_by_differences(name, call, commanded):
    block = vehicle(name).plant()
    u = np.linspace(0.8, 0.2, len(block.inputs))
    linear = call(block.to_control(), X, u)
    assert_is_linearisation(linear, block, X, u if commanded else 0 * u)


def test_an_operating_point_that_python_control_finds_leads_to_a_regulator_that_is_stable():
    block = c17_simulation().with_coefficients({"surge_coulomb": 0.0, "surge_linear_drag": 0.5}).plant()
    system = block.to_control()
    free = {"iu": [1], "ix": [0, 1, 2], "iy": [3], "idx": [3, 4, 5]}
    ahead = [0, 0, 0, 1, 0, 0]
    point = ct.find_operating_point(system, ahead, [1.0, 0.0], y0=ahead, **free)
    linear = ct.linearize(system, point)
    assert_is_linearisation(linear, block, point.states, point.inputs)
    _, _, poles = ct.lqr(linear, np.eye(6), np.eye(2))
    assert (poles.real < 0).all()
    K, _, _ = ct.lqr(ct.linearize(system, point.states, point.inputs, name="ahead"), np.eye(6), np.eye(2))
    assert np.linalg.eigvals(linear.A - linear.B @ K) == pytest.approx(poles)


def test_an_operating_point_without_inputs_is_that_at_rest():
    position, force = Signal("x", "m"), Signal("a", "m/s")
    rate, place = Signal("k", "1/s", start=2.0), Signal("place", "m", start=0.3)
    law = {"x": -rate.symbol * (position.symbol - place.symbol) + force.symbol}
    system = Block("spring", [position], [force], [position], [rate, place], law).to_control()
    point = ct.find_operating_point(system, [0.0])
    assert point.states == pytest.approx([0.3])
    assert ct.linearize(system, point).B.item() == pytest.approx(1.0)


def test_parameters_and_names_are_those_that_are_given():
    system = c17_simulation().plant().to_control()
    changed = ct.linearize(system, X, U, params={"plant.thrust": 2.0})
    assert changed.B[3, 0] == pytest.approx(2.0 * np.cos(0.2))
    assert ct.linearize(system, X, U).B[3, 0] == pytest.approx(0.75 * np.cos(0.2))
    assert ct.linearize(system, X, copy_names=True).name == "plant$linearized"
    assert ct.linearize(system, X).input_labels == ["thrust", "rudder"]
    plain = ct.linearize(system, X, copy_names=False)
    assert (plain.input_labels, plain.state_labels[0]) == (["u[0]", "u[1]"], "x[0]")
    assert ct.linearize(system, X, name="near", inputs=["a", "b"]).input_labels == ["a", "b"]


# ---- without inputs, without states, in discrete time, with delays ---------------------------------------


@pytest.mark.parametrize("outputs", [["x"], ["x", "z"]])
def test_a_loop_without_inputs_has_no_columns_in_b(outputs):
    loop = interconnect([linear_law("x", "z", -1), linear_law("z", "x")], outputs=outputs)
    for linear in (loop.linearize([0, 0]), ct.linearize(loop.to_control(), [0, 0])):
        np.testing.assert_array_equal(linear.A, [[-1, -1], [1, -1]])
        assert_is_linearisation(linear, loop, [0.0, 0.0], [])
        t = np.linspace(0, 3, 31)
        x = np.exp(-t) * np.cos(t)  # of x'' + 2 x' + 2 x = 0 from (1, 0)
        assert ct.initial_response(linear, t, [1, 0]).states[0] == pytest.approx(x, abs=1e-9)


def test_one_state_alone_and_a_reference_alone_are_linearised():
    assert_is_linearisation(ct.linearize(decay().to_control(), [0.3]), decay(), [0.3], [])
    still = circle(1.0).to_control().linearize([])
    assert (still.A.size, still.B.shape, still.D.shape) == (0, (0, 0), (still.noutputs, 0))


def test_a_sampled_block_is_linearised_in_discrete_time():
    n, by = Signal("n"), Signal("by")
    derivatives = {"n": n.symbol**2 + by.symbol}
    counter = Block("counter", [n], [by], [n], derivatives=derivatives, period=0.1)
    linear = ct.linearize(counter.to_control(), [0.25])
    assert (linear.dt, linear.A.item(), linear.B.item()) == (0.1, 0.5, 1.0)


def test_states_that_do_nothing_stay_whatever_python_control_is_set_to():
    x, a = Signal("x", "m"), Signal("a", "m/s")
    idle = Block("idle", [x, Signal("kept", "m")], [a], [x], [], {"x": a.symbol, "kept": 0})
    with ct.config.defaults({"statesp.remove_useless_states": True}):
        assert ct.linearize(idle.to_control(), [0, 0]).nstates == 2


def test_an_input_that_acts_late_is_linearised_by_its_fraction():
    late = c17_simulation().with_effects([effect("input_delay", seconds=0.1)]).plant()
    x = np.append(X, [0.1, 0.2, 0.0, 0.1])
    assert_is_linearisation(ct.linearize(late.to_control(pade=2), x, U), pade(late, 2), x, U)


# ---- refused ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("point", "message"),
    [
        (([0.1],), "expected 6 state values, found 1"),
        ((X, [0.1]), "expected 2 input values, found 1"),
        ((np.where(X > 0.7, np.nan, X),), "state value 5 must be finite, found nan"),
        ((X, [0.1, np.inf]), "input value 1 must be finite, found inf"),
        ((X, ["full", 0]), r"expected 2 input values, found \['full', 0\]"),
    ],
)
def test_a_point_that_is_none_is_refused_in_one_line(point, message):
    with pytest.raises(InputError, match=f"block 'plant': {message}"):
        ct.linearize(c17_simulation().plant().to_control(), *point)
