"""The Kalman-Bucy estimator against C17 sections III and V, written with full matrices in NumPy."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_are

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan, hoverdemon

N, M = 3, 8
UPPER = [(i, j) for i in range(N + M) for j in range(i, N + M)]


def c17_regressor(u, v, r, T, theta, width=0.01):
    """h and G of C17 (12) for zeta = c1 ... c8."""
    su, sv, sr = np.tanh(u / width), np.tanh(v / width), np.tanh(r / width)
    fx, fy = T * np.cos(theta), T * np.sin(theta)
    G = np.array(
        [
            [-su, -u, 0, 0, 0, 0, fx, 0],
            [0, 0, -sv, -v, 0, 0, fy, 0],
            [0, 0, 0, 0, -sr, -r, 0, -fy],
        ]
    )
    return np.array([v * r, -u * r, 0.0]), G


def kalman_bucy_rhs(xi, P, measured, command, R, Q):
    """xi' = A xi + [h, 0] + P C' R^-1 (y - C xi), P' = A P + P A' + Q - P C' R^-1 C P."""
    h, G = c17_regressor(*measured, *command)
    A = np.zeros((N + M, N + M))
    A[:N, N:] = G
    C = np.hstack([np.eye(N), np.zeros((N, M))])
    gain = P @ C.T @ np.linalg.inv(R)
    dxi = A @ xi + np.concatenate([h, np.zeros(M)]) + gain @ (measured - C @ xi)
    return dxi, A @ P + P @ A.T + Q - gain @ C @ P


def test_the_estimator_is_the_matrix_equation_for_random_states_and_covariances(rng):
    R, Q = rng.uniform(0.1, 1, N), rng.uniform(0.01, 1, N + M)
    f = kalman_bucy(c17_simulation().plant(), R=R, Q=Q).to_numpy()
    names = [s.name for s in f.block.inputs]
    assert names == ["u", "v", "r", "thrust", "rudder"]
    for _ in range(120):
        root = rng.normal(size=(N + M, N + M))
        P, xi = root @ root.T, rng.normal(size=N + M)
        measured, command = rng.normal(size=3), rng.uniform(-1, 2, 2)
        found = f.derivatives(0.0, [*xi, *(P[ij] for ij in UPPER)], [*measured, *command])
        dxi, dP = kalman_bucy_rhs(xi, P, measured, command, np.diag(R), np.diag(Q))
        assert np.abs(found[: N + M] - dxi).max() < 1e-12 * np.abs(dxi).max()
        assert np.abs(found[N + M :] - [dP[ij] for ij in UPPER]).max() < 1e-12 * np.abs(dP).max()


def test_signals_follow_python_controls_estimators_and_start_at_the_models_values():
    e = kalman_bucy(c17_simulation().plant(), P0=[1, 2, 3, *range(4, 12)])
    start = {s.name: s.start for s in e.states}
    assert start["xhat[3]"] == 1.35
    assert (start["P[0,0]"], start["P[10,10]"], start["P[0,1]"]) == (1, 11, 0)
    assert [s.name for s in e.outputs][:2] == ["surge_coulomb_hat", "surge_linear_drag_hat"]
    assert {"estimator.R[0,0]", "estimator.Q[10,10]"} <= set(e.default_parameters) or "R[0,0]" in {
        p.name for p in e.parameters
    }


def test_only_the_chosen_coefficients_are_estimated_and_the_others_stay_parameters(rng):
    plant = c17_simulation().plant()
    e = kalman_bucy(plant, ["yaw_coulomb", "yaw_linear_drag"])
    assert [s.name for s in e.outputs] == ["yaw_coulomb_hat", "yaw_linear_drag_hat"]
    assert len(e.states) == 3 + 6  # one measured velocity, two coefficients
    assert "estimator.rudder_torque" in e.default_parameters
    assert "estimator.yaw_coulomb" not in e.default_parameters
    assert {s.name for s in e.inputs} == {"r", "thrust", "rudder"}


def linear_regression(g):
    """s' = g . c with constant regressors g, one row for each state."""
    g = np.atleast_2d(g)
    states = [Signal(f"s{i}", "m") for i in range(len(g))]
    c = [Signal(f"c{j}", "m/s", start=0.0) for j in range(g.shape[1])]
    rows = sp.Matrix(g) * sp.Matrix([p.symbol for p in c])
    return Block("toy", states, [], states, c, {s.name: e for s, e in zip(states, rows, strict=True)})


def covariance(e, size, column):
    P = np.zeros((size, size))
    for s, value in zip(e.states, column, strict=True):
        if s.name.startswith("P["):
            i, j = (int(k) for k in s.name[2:-1].split(","))
            P[i, j] = P[j, i] = value
    return P


@given(st.floats(0.3, 3), st.floats(0.1, 2), st.floats(0.05, 2), st.floats(0.05, 2))
def test_with_a_constant_regressor_the_covariance_settles_at_scipys_riccati_solution(
    g, r, q_state, q_coefficient
):
    e = kalman_bucy(linear_regression(g), R=r, Q=[q_state, q_coefficient], P0=1.0)
    end = simulate(e, [0.0, 200.0], {"s0": 0.0}, rtol=1e-9, atol=1e-12, method="LSODA").states[:, -1]
    A, C = np.array([[0, g], [0, 0.0]]), np.array([[1.0, 0.0]])
    expected = solve_continuous_are(A.T, C.T, np.diag([q_state, q_coefficient]), np.array([[r]]))
    assert np.allclose(covariance(e, 2, end), expected, rtol=1e-6)


def test_two_states_two_coefficients_settle_at_scipys_solution_too():
    g = np.array([[1.0, 0.5], [-0.3, 2.0]])
    e = kalman_bucy(linear_regression(g), R=[0.2, 0.5], Q=[0.1, 0.2, 0.3, 0.4], P0=0.5)
    end = simulate(e, [0.0, 100.0], rtol=1e-9, atol=1e-12).states[:, -1]
    A, C = np.zeros((4, 4)), np.hstack([np.eye(2), np.zeros((2, 2))])
    A[:2, 2:] = g
    expected = solve_continuous_are(A.T, C.T, np.diag([0.1, 0.2, 0.3, 0.4]), np.diag([0.2, 0.5]))
    assert np.allclose(covariance(e, 4, end), expected, rtol=1e-6)


def excited_run(plant, e, t, seed):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 6, 6)
    whole = interconnect([plant, e])
    inputs = {
        "thrust": 2 + np.sin(1.3 * t + phase[0]) + np.sin(3.1 * t + phase[1]),
        "rudder": 0.6 * np.sin(2.1 * t + phase[2]) + 0.3 * np.sin(4.7 * t + phase[3]),
    }
    return whole, simulate(whole, t, inputs, hold="zero", rtol=1e-7, atol=1e-10)


def test_the_covariance_stays_positive_and_the_coefficients_are_found():
    craft = c17_simulation().with_coefficients({f"{a}_coulomb": 0.0 for a in ("surge", "sway", "yaw")})
    wanted = ["surge_linear_drag", "yaw_linear_drag", "rudder_torque"]
    truth = craft.with_coefficients({"surge_linear_drag": 0.5, "yaw_linear_drag": 0.9})
    e = kalman_bucy(craft.plant(), wanted, R=1e-4, Q=[1e-6] * 2 + [1e-6] * 3, P0=[1e-3] * 2 + [1.0] * 3)
    t = np.linspace(0, 6, 61)
    whole, run = excited_run(truth.plant(), e, t, 3)
    names = [s.name.removeprefix("estimator.") for s in whole.states]
    for column in run.states.T:
        P = np.zeros((5, 5))
        for name, value in zip(names, column, strict=True):
            if name.startswith("P["):
                i, j = (int(k) for k in name[2:-1].split(","))
                P[i, j] = P[j, i] = value
        eigenvalues = np.linalg.eigvalsh(P)
        assert eigenvalues.min() > -1e-9 * eigenvalues.max()
    labels = run.output_labels
    found = [run.outputs[labels.index(f"{n}_hat"), -1] for n in wanted]
    assert found == pytest.approx([0.5, 0.9, craft.coefficients()["rudder_torque"]], rel=0.02)


def test_an_estimator_that_starts_at_the_truth_stays_there():
    craft = c17_simulation()
    e = kalman_bucy(craft.plant(), ["sway_linear_drag", "yaw_linear_drag"])
    _whole, run = excited_run(craft.plant(), e, np.linspace(0, 2, 21), 4)
    at = run.output_labels.index("yaw_linear_drag_hat")
    assert np.allclose(run.outputs[at], 0.48, atol=1e-6)


@pytest.mark.parametrize("craft", [hoverdemon, four_fan])
def test_it_is_made_for_other_craft_without_change(craft):
    e = kalman_bucy(craft().plant())
    assert [s.name.removesuffix("_hat") for s in e.outputs][:1] == [craft().linear_coefficients()[0]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"R": 0.0}, "R must be finite and positive"),
        ({"R": [1.0, 1.0]}, "R: expected one number or 3"),
        ({"Q": -1.0}, "Q must be finite and not negative"),
        ({"Q": [1.0] * 3}, "Q: expected one number or 11"),
        ({"P0": np.nan}, "P0 must be finite"),
        ({"P0": np.eye(11)}, "P0: expected one number"),
    ],
)
def test_intensities_that_make_no_sense_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        kalman_bucy(c17_simulation().plant(), **arguments)
