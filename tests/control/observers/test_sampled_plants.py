"""Estimators of plants that are sampled themselves, against textbook filters and python-control."""

import control as ct
import numpy as np
import pytest
import scipy.linalg

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import simulate_runs

H = 0.1
A, B, C = np.array([[0.9, 0.3], [-0.2, 1.05]]), np.array([[0.0], [0.4]]), np.array([[1.0, 0.0]])
Q, R = np.diag([0.0, 0.3**2]), 0.05**2
NOISE = {"process_noise": {"b": 0.3}, "measurement_noise": {"a": 0.05}}


def plant():
    system = ct.ss(A, B, C, 0, H, states=["a", "b"], inputs=["u"], outputs=["a"], name="plant")
    return hc.from_control(system)


def record(n=60, seed=2):
    rng = np.random.default_rng(seed)
    x, u, y = np.zeros(2), rng.normal(size=n), np.zeros(n)
    for k in range(n):
        y[k] = x[0] + 0.05 * rng.normal()
        x = A @ x + B[:, 0] * u[k] + [0.0, 0.3 * rng.normal()]
    return u, y


def kalman(u, y, every=1):
    """Textbook filter: corrected at every `every`-th row, predicted by the map at each."""
    x, P, found = np.zeros(2), np.eye(2), []
    for k in range(len(u)):
        if k % every == 0:
            gain = P @ C.T / (C @ P @ C.T + R)
            x, P = x + gain[:, 0] * (y[k] - x[0]), P - gain @ C @ P
            found.append(np.r_[x, np.sqrt(np.diag(P))])
        x, P = A @ x + B[:, 0] * u[k], A @ P @ A.T + Q
    return np.array(found)


@pytest.mark.parametrize("make", [hc.extended_kalman, hc.unscented_kalman])
@pytest.mark.parametrize("every", [1, 3])
def test_the_filters_of_a_linear_map_are_kalmans(make, every):
    u, y = record()
    u = np.repeat(u[::every], every)  # held while the filter waits
    block = make(plant(), ["a"], **NOISE, period=every * H)
    assert block.period == pytest.approx(every * H)
    run = simulate_runs(block, {"a": y[::every], "u": u[::every]})
    found = np.column_stack([run[name][:, 0] for name in ("a_hat", "b_hat", "a_std", "b_std")])
    assert found == pytest.approx(kalman(u, y, every), abs=1e-9)


def test_the_period_is_the_plants_if_none_is_given_and_the_noise_is_per_step():
    block = hc.extended_kalman(plant(), ["a"], **NOISE)
    assert block.period == H
    assert block.signal("estimator.process_noise_b").unit == "1"
    gain = np.linalg.solve(A, ct.dlqe(A, np.eye(2), C, Q, [[R]])[0])  # dlqe: of the prediction, A K
    run = simulate_runs(block, {"a": np.r_[np.zeros(300), 1.0], "u": np.zeros(301)})
    assert run["b_hat"][-1, 0] == pytest.approx(gain[1, 0], rel=1e-6)


def logistic():
    y, r = hc.Signal("y", start=0.3), hc.Signal("r", start=3.1)
    return hc.Block("logistic", [y], [], [y], [r], {"y": r.symbol * y.symbol * (1 - y.symbol)}, period=H)


def test_the_extended_filter_of_a_nonlinear_map_is_gelbs():
    rng = np.random.default_rng(5)
    seen = 0.6 + 0.2 * rng.normal(size=20)
    block = hc.extended_kalman(
        logistic(), ["y"], process_noise={"y": 0.02}, measurement_noise={"y": 0.1}, start_std={"y": 0.2}
    )
    x, P, wanted = 0.3, 0.04, []
    for value in seen:
        gain = P / (P + 0.01)
        x, P = x + gain * (value - x), (1 - gain) * P
        wanted.append(x)
        x, P = 3.1 * x * (1 - x), (3.1 * (1 - 2 * x)) ** 2 * P + 0.02**2
    assert simulate_runs(block, {"y": seen})["y_hat"][:, 0] == pytest.approx(wanted, abs=1e-12)


def test_the_moving_horizon_estimate_of_a_linear_map_ends_at_kalmans():
    u, y = record(8)
    problem = hc.moving_horizon(plant(), ["a"], horizon=8, **NOISE)
    assert problem.timepts[1] == H
    found = problem.compute_estimate(y[None], u[None])
    assert found.states[:, -1] == pytest.approx(kalman(u, y)[-1, :2], abs=1e-5)


def test_a_disturbance_is_added_to_the_next_value():
    observer = hc.disturbance_observer(
        plant(), ["a"], disturbance_noise={"b": 0.02}, measurement_noise={"a": 0.05}
    )
    u = np.zeros(400)
    x, y = np.zeros(2), np.zeros(400)
    for k in range(400):
        y[k] = x[0]
        x = A @ x + [0.0, 0.25]
    run = simulate_runs(observer, {"a": y, "u": u})
    assert run["disturbance_b_hat"][-1, 0] == pytest.approx(0.25, abs=1e-6)
    larger = hc.with_disturbances(plant(), ["b"], correlation_time=0.5)
    assert larger.linearize(np.zeros(3)).A[2, 2] == pytest.approx(np.exp(-H / 0.5))


def test_observability_is_judged_over_steps():
    found = hc.observability(plant(), {}, ["a"])
    assert found.gramian == pytest.approx(ct.obsv(A, C).T @ ct.obsv(A, C))
    assert found.observable and found.window == pytest.approx(2 * H)
    stable = hc.from_control(ct.ss(0.5 * A, B, C, 0, H, outputs=["y"]))
    long = hc.observability(stable, {}, ["y"], window=500 * H)
    assert long.gramian == pytest.approx(scipy.linalg.solve_discrete_lyapunov(0.5 * A.T, C.T @ C))


@pytest.mark.parametrize(("mode", "detectable"), [(0.9, True), (-0.5, True), (1.0, False), (-1.1, False)])
def test_a_hidden_mode_decays_inside_the_unit_circle(mode, detectable):
    system = ct.ss(np.diag([0.5, mode]), [[1.0], [1.0]], [[1.0, 0.0]], 0, H, outputs=["y"])
    found = hc.observability(hc.from_control(system), {}, ["y"])
    assert (found.rank, found.detectable) == (1, detectable)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda p: hc.extended_kalman(p, ["a"], **NOISE, period=0.15),
         "a multiple of the plant's period, 0.1 s"),
        (lambda p: hc.unscented_kalman(p, ["a"], **NOISE, substeps=2), "is sampled and takes its own steps"),
        (lambda p: hc.moving_horizon(p, ["a"], **NOISE, step=0.05), "the nearest is 0.1 s"),
        (lambda p: hc.extended_kalman(p, ["a"], **NOISE, period=5.0), "50 steps of block 'plant'"),
    ],
)  # fmt: skip
def test_other_periods_are_refused_in_one_line(make, text):
    with pytest.raises(InputError, match=text):
        make(plant())
