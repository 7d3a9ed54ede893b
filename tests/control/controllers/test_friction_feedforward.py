"""Friction as a known disturbance of the regulator: against the optimal steady state."""

import control
import numpy as np
import pytest
import scipy.linalg

import hovercontrol as hc
from hovercontrol.blocks.backends.friction_slopes import Point
from hovercontrol.control.controllers.friction_feedforward import feedforward, frictions_at_rest

A = np.array([[0, 1.0, 1.0, 0], [0, 0, 0, 1.0], [0, 0, -1.2, -1.0], [0, 0, 0, -0.48]])
B = np.array([[0], [0], [1.35], [-11.0565]])
E = np.array([[0], [0], [0], [-0.83]])
Q, R = np.diag([4.0, 1.0, 0.5, 1.0]), np.array([[2.0]])


def best_steady_state(M, B, E):
    """Minimise x'Qx + u'Ru subject to M x + B u + E = 0, by its Lagrange conditions."""
    n, m = 4, 1
    conditions = np.block(
        [
            [Q, np.zeros((n, m)), M.T],
            [np.zeros((m, n)), R, B.T],
            [M, B, np.zeros((n, n))],
        ]
    )
    z = np.linalg.solve(conditions, np.concatenate([np.zeros(n + m), -E.ravel()]))
    return z[:n], z[n : n + m]


@pytest.mark.parametrize("period", [None, 0.1])
def test_under_a_constant_disturbance_the_loop_rests_where_the_cost_is_least(period):
    if period is None:
        M, b, e = A, B, E
        K, P, _ = control.lqr(A, B, Q, R)
        F = feedforward(A, B, E, K, P, R, sampled=False)
    else:
        whole = scipy.linalg.expm(np.block([[A, B, E], [np.zeros((2, 6))]]) * period)
        M, b, e = whole[:4, :4] - np.eye(4), whole[:4, 4:5], whole[:4, 5:]
        K, P, _ = control.dlqr(whole[:4, :4], b, Q, R)
        F = feedforward(whole[:4, :4], b, e, K, P, R, sampled=True)
    x, u = best_steady_state(M, b, e)
    rest = -np.linalg.solve(M - b @ K, b @ F + e).ravel()
    assert rest == pytest.approx(x, abs=1e-9)
    assert -K @ rest + F.ravel() == pytest.approx(u, abs=1e-9)


def test_the_regulator_has_these_gains():
    plant = hc.vehicle("c17_simulation").plant()
    weights = {"y": 4.0, "psi": 1.0, "v": 0.5, "r": 1.0}
    block = hc.lqr(plant, {"u": 1.0, "thrust": 1.8}, weights, {"rudder": 2.0})
    K, P, _ = control.lqr(A, B, Q, R)
    expected = feedforward(A, B, E, K, P, R, sampled=False)[0, 0]
    assert block.default_parameters["controller.F_rudder_r"] == pytest.approx(expected, rel=1e-8)
    assert block.default_parameters["controller.r_width"] == pytest.approx(0.05)
    f, names = block.to_numpy(), [s.name for s in block.inputs]
    values = dict.fromkeys(names, 0.0) | {"r": 1.0}
    command = f.outputs(0.0, (), list(values.values()))[0]
    assert command == pytest.approx(expected - K[0, 3], rel=1e-8)


def test_friction_of_a_state_that_moves_is_part_of_the_trim():
    plant = hc.vehicle("c17_simulation").plant()

    def resting(u, r):
        point = Point(0.0, np.array([0, 0, 0, u, 0, r]), np.array([1.8, 0.0]), {})
        return [plant.states[f.state].name for f in frictions_at_rest(plant, point, range(6))]

    assert resting(1.0, 0.0) == ["r"]
    assert resting(0.0, 0.5) == ["u"]
    assert resting(1.0, 0.5) == []


def test_without_dry_friction_there_is_nothing_to_compensate():
    plant = hc.vehicle("c17_simulation").with_coefficients({"yaw_coulomb": 0.0}).plant()
    block = hc.lqr(plant, {"u": 1.0, "thrust": 1.8}, {"y": 1.0}, {"rudder": 1.0})
    assert not [key for key in block.default_parameters if "F_" in key]
