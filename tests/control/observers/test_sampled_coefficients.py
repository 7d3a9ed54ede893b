"""Coefficients of a sampled Block, tick by tick: a Kalman filter of next values written with matrices."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers import kalman_bucy, sampled_estimator

T, N = 0.05, 300
R, Q, P0 = 4e-6, (1e-5, 1e-6, 1e-6), 0.5


def tank():
    y, u = hc.Signal("y", "m"), hc.Signal("u", "m")
    a, b = hc.Signal("a", "1", start=0.5), hc.Signal("b", "1", start=0.5)
    return hc.Block("tank", [y], [u], [y], [a, b], {"y": a.symbol * y.symbol + b.symbol * u.symbol}, period=T)


def record():
    rng = np.random.default_rng(1)
    u, y = np.repeat(rng.uniform(-1, 1, N // 10), 10), np.zeros(N)
    for k in range(N - 1):
        y[k + 1] = 0.8 * y[k] + 0.3 * u[k]
    return y + 0.01 * rng.normal(size=N), u


def by_hand(y, u):
    """x+ = x + (a - 1) y + b u, with the measured y: xi = [x, a, b], the variance R/T of a sample."""
    xi, P, found = np.array([y[0], 0.5, 0.5]), np.diag([R / T, P0, P0]), [[0.5, 0.5]]
    H = np.array([[1.0, 0.0, 0.0]])
    for k in range(N - 1):
        A = np.array([[1.0, y[k], u[k]], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        xi, P = A @ xi - [y[k], 0.0, 0.0], A @ P @ A.T + T * np.diag(Q)
        K = P @ H.T / (H @ P @ H.T + R / T)
        xi, P = xi + (K * (y[k + 1] - xi[0])).ravel(), (np.eye(3) - K @ H) @ P
        found.append(xi[1:])
    return np.array(found)


def test_kalman_bucy_of_a_sampled_block_is_the_filter_of_its_next_values():
    y, u = record()
    wanted = by_hand(y, u)
    filtered = Ticking(kalman_bucy(tank(), R=R, Q=Q, P0=P0))
    ticks = [filtered.tick(k * T, {"y": y[k], "u": u[k]}) for k in range(N)]
    np.testing.assert_allclose([[found["a_hat"], found["b_hat"]] for found in ticks], wanted, rtol=1e-8)
    assert abs(wanted[-1] - [0.8, 0.3]).max() < 0.03


def test_another_period_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"period: expected that of the block, 0.05 s, found 0.1"):
        sampled_estimator(tank(), period=0.1)
