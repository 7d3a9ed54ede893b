"""Model predictive control: the optimum of a linear plant, limits, obstacles and waypoints of a craft."""

import control
import numpy as np
import pytest
import scipy.linalg

import hovercontrol as hc
from hovercontrol.control.controllers.detour import way_around
from hovercontrol.control.controllers.optimizer import TOLERANCE

pytest.importorskip("casadi")

CRAFT = hc.vehicle("c17_simulation")
LIMITS = {"thrust": (0.0, 4.0), "rudder": (-0.6, 0.6)}
WEIGHTS = {"x": 20, "y": 20, "psi": 5, "r": 0.1, "v": 0.5, "thrust": 0.02, "rudder": 0.1}


def cart(position="x"):
    x, v, a = hc.Signal(position, "m"), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    return hc.Block("cart", [x, v], [a], [x, v], derivatives={position: v.symbol, "v": a.symbol})


def riccati(horizon, h=0.1):
    """The optimal gain of a cart for a finite horizon, weights 3 and 1 of states, 0.2 of the input."""
    A, B = np.array([[1.0, h], [0.0, 1.0]]), np.array([[h**2 / 2], [h]])
    Q, R = np.diag([3.0, 1.0]), np.array([[0.2]])
    P = Q
    for _ in range(horizon):
        K = scipy.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    return K


@pytest.mark.parametrize("solver", ["rti", "ipopt"])
def test_without_limits_it_is_the_linear_quadratic_regulator(solver):
    controller = hc.mpc(cart(), period=0.1, horizon=8, weights={"x": 3, "v": 1, "a": 0.2}, solver=solver)
    for x in ([1.0, 0.0], [-0.3, 2.0]):
        controller.reset()
        # OSQP meets the optimality conditions H w + c + A'y = 0 to 1e-5 of their terms, up to 6 |x|. An
        # input's own part of H is 2 R = 0.4 at least: its error is that over 0.4.
        error = TOLERANCE * (1 + 6 * np.abs(x).max()) / 0.4
        assert controller.control(x) == pytest.approx(-riccati(8) @ x, abs=error)


def test_limits_of_inputs_and_their_rates_hold_exactly():
    controller = hc.mpc(
        cart(), period=0.1, weights={"x": 3, "v": 1}, limits={"a": (-1.0, 0.5)}, rate_limits={"a": 2.0}
    )
    run = controller.simulate(12.0, {"x": 3.0}, rows=1)
    assert run.inputs.min() == -1.0 and run.inputs.max() <= 0.5
    assert np.abs(np.diff(run.inputs, prepend=0.0)).max() <= 0.2 + 1e-12
    assert abs(run.states[0, -1]) < 0.3


def test_a_limit_of_a_state_holds():
    controller = hc.mpc(
        cart(), period=0.1, weights={"x": 3, "a": 0.01}, limits={"a": (-2, 2), "v": (-0.4, 0.4)}
    )
    run = controller.simulate(4.0, {"x": 1.0})
    assert -0.401 < run.states[1].min() < -0.39


@pytest.mark.slow
def test_the_craft_passes_waypoints_around_an_obstacle_within_its_limits():
    controller = hc.mpc(
        CRAFT, horizon=20, weights=WEIGHTS, rate_weights={"thrust": 0.05, "rudder": 0.5}, limits=LIMITS,
        obstacles=[(1.2, 0.05, 0.4)], waypoints=[[2.5, 0.0], [2.5, 1.0]],
    )  # fmt: skip
    run = controller.simulate(10.0)
    x, y = run.states[:2]
    assert np.hypot(x - 1.2, y - 0.05).min() >= 0.4
    assert np.hypot(x - 2.5, y).min() < 0.2 and np.hypot(x[-1] - 2.5, y[-1] - 1.0) < 0.25
    for u, (low, high) in zip(run.inputs, LIMITS.values(), strict=True):
        assert low <= u.min() and u.max() <= high


def test_python_control_runs_the_same_loop():
    options = {"period": 0.1, "horizon": 5, "weights": {"x": 3, "v": 1, "a": 0.2}, "limits": {"a": (-1, 1)}}
    controller = hc.mpc(cart(), **options)
    loop = control.interconnect(
        [cart().to_control(step=0.1), controller.to_control()], inputs=["x_ref", "v_ref"], outputs=["x", "a"],
        check_unused=False,
    )  # fmt: skip
    t = np.arange(11) * 0.1
    found = control.input_output_response(loop, t, [np.full(11, 0.5), np.zeros(11)])
    run = hc.mpc(cart(), **options).simulate(1.0, reference={"x": 0.5}, rows=1)
    assert found.outputs[0] == pytest.approx(run.states[0], abs=1e-6)


def test_an_angle_takes_the_shorter_turn():
    r, a, psi = hc.Signal("r", "rad/s"), hc.Signal("a", "rad/s^2"), hc.Signal("psi", "rad")
    top = hc.Block("top", [psi, r], [a], [psi], derivatives={"psi": r.symbol, "r": a.symbol})
    assert hc.mpc(top, weights={"psi": 1, "a": 0.1}).control([3.0, 0.0], {"psi": -3.0}) > 0.0


def test_the_way_around_two_obstacles_is_tangents_and_arcs():
    circles = np.array([[2.0, 0.1, 0.5], [5.0, -0.2, 0.8]])
    way = way_around(np.array([[0.0, 0.0], [8.0, 0.0]]), circles)
    x, y = way.at(np.linspace(0.0, way.length, 2000))
    for cx, cy, radius in circles:
        assert np.hypot(x - cx, y - cy).min() == pytest.approx(radius, rel=1e-2)
    assert 8.0 < way.length < 8.5


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"weights": {"z": 1}}, "mpc: weights: no signal 'z'"),
        ({"weights": {"thrust": 1}}, "at least one state"),
        ({"weights": {"x": -1}}, "mpc: weights: x: expected a number of at least 0"),
        ({"limits": {"truhst": (0, 1)}}, "no state or input 'truhst'; did you mean 'thrust'"),
        ({"limits": {"thrust": (1, 0)}}, "expected .lower, upper."),
        ({"obstacles": [(0, 0, -1)]}, "positive radius"),
        ({"waypoints": [1.0, 2.0]}, "shape .n, 2."),
        ({"waypoints": [[0, 0], [2, 0]], "obstacles": [(2, 0.1, 0.5)]}, "waypoint 2 .* lies within"),
        ({"horizon": 1}, "horizon"),
        ({"position": ("x", "q")  , "obstacles": [(2, 0.1, 0.5)]}, "position: no state 'q'"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_in_one_line(options, said):
    with pytest.raises(hc.InputError, match=said):
        hc.mpc(CRAFT, **({"weights": {"x": 1, "y": 1}} | options))


def test_a_reference_of_a_state_without_weight_is_refused():
    with pytest.raises(hc.InputError, match="no weight on a state 'v'"):
        hc.mpc(cart(), weights={"x": 1}).control([0.0, 0.0], {"v": 1.0})
