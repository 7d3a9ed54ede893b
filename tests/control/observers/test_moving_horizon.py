"""Moving-horizon estimation: python-control's, with a Block's exact Jacobians."""

import control
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import approx_fprime

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from tests.control.observers.observed_plants import (
    CRAFT_NOISE,
    NOISE,
    START,
    H,
    by_hand,
    cart,
    matrices,
    soft_craft,
    truth,
)

CART = NOISE | {"step": H, "start_std": {"x": 0.2, "v": 0.3}}


def kalman(samples, push):
    """The Kalman filter of the cart, its noise held over each step; NaN is no sample."""
    A, B, C = matrices()
    whole = expm(np.block([[A, B], [np.zeros((1, 3))]]) * H)
    Phi, Gamma = whole[:2, :2], whole[:2, 2]
    x, P = np.zeros(2), np.diag([0.04, 0.09])
    for y, u in zip(samples, push, strict=True):
        if np.isfinite(y):
            K = P @ C.T / (C @ P @ C.T + 0.02**2)
            x, P = x + (K * (y - x[0]))[:, 0], P - K @ C @ P
        yield x
        x, P = Phi @ x + Gamma * u, Phi @ P @ Phi.T + np.outer(Gamma, Gamma) * 0.3**2 / H


def test_of_a_linear_plant_its_last_estimate_is_the_kalman_filter_s_also_without_samples():
    rng = np.random.default_rng(0)
    samples, push = 0.1 * rng.normal(size=8), rng.normal(size=8)
    samples[[2, 5]] = np.nan
    problem = hc.moving_horizon(cart(), ["x"], horizon=8, **CART)
    problem.minimize_kwargs["options"] = {"ftol": 1e-14}
    estimate = problem.compute_estimate(samples[None], push[None])
    *_, last = kalman(samples, push)
    assert estimate.success
    np.testing.assert_allclose(estimate.states[:, -1], last, rtol=0, atol=2e-6)


def craft_problem(horizon=6, **options):
    craft = soft_craft().with_values(START)
    problem = hc.moving_horizon(craft, step=H, horizon=horizon, substeps=1, **CRAFT_NOISE, **options)
    motion, samples, commands = truth(craft, H, horizon, 1, [0, 0, 3.13, 1.2, -0.2, 0.4])
    return problem, motion, samples, commands


def test_gradient_and_constraints_have_the_slopes_of_finite_differences():
    problem, motion, samples, commands = craft_problem(noise_bounds={"r": 0.5, "u": 0.1})
    problem.compute_estimate(samples.T, commands.T)
    at = np.r_[motion.T.ravel(), 0.1 * np.random.default_rng(3).normal(size=18)]
    wanted = approx_fprime(at, problem._cost_function, 1e-7)
    np.testing.assert_allclose(problem.minimize_kwargs["jac"](at), wanted, rtol=0, atol=0.05)
    for constraint in problem.constraints:
        slopes = approx_fprime(at, lambda z, c=constraint: c.fun(z).copy(), 1e-7)
        np.testing.assert_allclose(constraint.jac(at), slopes, rtol=0, atol=1e-6)


def test_on_a_craft_it_agrees_with_the_extended_kalman_filter():
    problem, _, samples, commands = craft_problem()
    P = np.diag([CRAFT_NOISE["start_std"][n] for n in ("x", "y", "psi", "u", "v", "r")]) ** 2
    Q, R = np.diag([0, 0, 0, 0.01, 0.01, 0.04]), np.diag([1e-4, 1e-4, 4e-4])
    start = np.array([0, 0, 3.13, 1.2, -0.2, 0.4])
    *_, (x, P) = by_hand(problem_plant(), start, P, Q, R, H, samples, commands, np.ones(6))
    samples[:, 2] = np.angle(np.exp(1j * samples[:, 2]))  # as a compass has it
    estimate = problem.compute_estimate(samples.T, commands.T)
    assert estimate.success
    assert np.abs((estimate.states[:, -1] - x) / np.diag(P) ** 0.5).max() < 0.2


def problem_plant():
    return soft_craft().with_values(START)


def test_noise_keeps_its_bounds():
    problem, _, samples, commands = craft_problem(noise_bounds={"u": 0.05})
    free, *_ = craft_problem()
    samples = samples.T + np.array([0.02, 0.0, 0.0])[:, None] * np.arange(6)
    bounded, unbounded = (p.compute_estimate(samples, commands.T).inputs for p in (problem, free))
    assert np.abs(unbounded[0]).max() > 0.1
    assert np.abs(bounded[0]).max() == pytest.approx(0.05, abs=1e-6)


def test_as_a_system_of_python_control_it_predicts_one_step():
    problem = hc.moving_horizon(cart(), ["x"], horizon=6, **CART)
    system = problem.create_mhe_iosystem(estimate_labels=["x_hat", "v_hat"])
    assert (system.input_labels, system.output_labels) == (["x", "push"], ["x_hat", "v_hat"])
    t = np.arange(16) * H
    push = np.sin(t)
    x, v = hc.simulate(cart(), t, {"push": push}).states
    run = control.input_output_response(system, t, [x, push], 0)
    # At t the system has the samples before t, so that it shows the prediction for t.
    np.testing.assert_allclose(run.outputs[1, 10:], v[10:], rtol=0, atol=5e-3)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"step": 0.0}, "step must be positive"),
        ({"horizon": 1}, "horizon: expected 2 or more, found 1"),
        ({"process_noise": {"v": 0.0}}, "expected a positive number for at least one state"),
        ({"start_std": {"v": 0.0}}, "start_std: expected a positive number for 'v', found 0"),
        ({"noise_bounds": {"x": 1.0}}, "noise_bounds: no process noise of 'x'"),
        ({"noise_bounds": {"v": 0.0}}, "noise_bounds: v must be positive"),
    ],
)
def test_what_it_cannot_use_is_refused_in_one_line(changes, said):
    with pytest.raises(InputError, match=said):
        hc.moving_horizon(cart(), ["x"], **(CART | changes))
