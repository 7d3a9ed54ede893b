"""Whitening against the dense Gaussian likelihood of the same linear system."""

import numpy as np
import pytest

from hovercontrol.discrepancy.noise import Noise, estimate, whiten
from hovercontrol.discrepancy.reduce import reduce, scaled_inverse


class Linear:
    """A response of W windows with constant matrices."""

    def __init__(self, A, B, C, dt, W, K):
        n = len(A)
        self.A = np.broadcast_to(A, (K - 1, W, n, n))
        self.B = np.broadcast_to(B, (K - 1, W, n, n))
        self.C = np.broadcast_to(C, (K, W, *C.shape)).copy()
        self.dt = np.full((K - 1, W), dt)
        self.pace = np.full((W, K, len(C)), 0.7)

    def of(self, windows):
        part = object.__new__(Linear)
        part.A, part.B, part.C = self.A[:, windows], self.B[:, windows], self.C[:, windows]
        part.dt, part.pace = self.dt[:, windows], self.pace[windows]
        return part


DT, K, W = 0.05, 12, 3
A = np.array([[1.0, DT], [0.0, 0.9]])
B = DT * np.array([[1.0, DT / 2], [0.0, 1.0]])
C = np.array([[1.0, 0.0], [0.3, 1.0]])
RESPONSE = Linear(A, B, C, DT, W, K)


def covariance(noise):
    """Of one window's measurements, (K * 2, K * 2), written down without a filter."""
    n, steps = 2, K
    fade = np.exp(-DT / noise.seconds)
    ou = noise.process[1] ** 2 * fade ** np.abs(np.subtract.outer(np.arange(steps), np.arange(steps)))
    reach = np.zeros((steps * n, steps))
    for k in range(1, steps):
        for j in range(k):
            reach[n * k : n * k + n, j] = np.linalg.matrix_power(A, k - 1 - j) @ B[:, 1]
    out = np.kron(np.eye(steps), C)
    R = np.diag(noise.measured**2) + noise.clock**2 * 0.49 * np.ones((2, 2))
    return out @ reach @ ou @ reach.T @ out.T + np.kron(np.eye(steps), R)


@pytest.mark.parametrize(
    "noise",
    [
        Noise(np.array([0.02, 0.05]), np.array([0.0, 0.8]), 0.3),
        Noise(np.array([0.02, 0.05]), np.array([0.0, 0.0])),
        Noise(np.array([0.02, 0.05]), np.array([0.0, 0.0]), clock=0.1),
        Noise(np.array([0.02, 0.05]), np.array([0.0, 0.4]), 0.1, clock=0.05),
    ],
)
def test_whitened_products_and_determinant_are_those_of_the_covariance(noise):
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(W, K, 2, 3))
    white, determinant = whiten(columns, np.ones((W, K, 2), bool), noise, RESPONSE)
    S = covariance(noise)
    for w in range(W):
        X, Z = columns[w].reshape(-1, 3), white[w].reshape(-1, 3)
        np.testing.assert_allclose(Z.T @ Z, X.T @ np.linalg.solve(S, X), rtol=1e-8)
        assert determinant[w] == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-9)


def test_what_was_not_measured_counts_for_nothing():
    noise = Noise(np.array([0.02, 0.05]), np.array([0.0, 0.8]), 0.3)
    rng = np.random.default_rng(1)
    seen = rng.random((W, K, 2)) > 0.3
    columns = np.where(seen[..., None], rng.normal(size=(W, K, 2, 2)), 0.0)
    part = RESPONSE.of(np.arange(W))
    part.C = part.C * seen.transpose(1, 0, 2)[..., None]
    white, determinant = whiten(columns, seen, noise, part)
    S = covariance(noise)
    for w in range(W):
        rows = np.flatnonzero(seen[w].ravel())
        X, Z = columns[w].reshape(-1, 2)[rows], white[w].reshape(-1, 2)[rows]
        np.testing.assert_allclose(Z.T @ Z, X.T @ np.linalg.solve(S[np.ix_(rows, rows)], X), rtol=1e-8)
        assert determinant[w] == pytest.approx(np.linalg.slogdet(S[np.ix_(rows, rows)])[1], rel=1e-9)


def test_the_level_of_process_noise_comes_back():
    truth = Noise(np.array([0.02, 0.05]), np.array([0.0, 0.8]), 0.3)
    rng = np.random.default_rng(2)
    many = 200
    samples = np.linalg.cholesky(covariance(truth)) @ rng.normal(size=(K * 2, many))
    columns = samples.T.reshape(many, K, 2, 1)
    start = np.stack([np.linalg.matrix_power(A, k) for k in range(K)])
    free = np.broadcast_to(C @ start, (many, K, 2, 2))
    columns = np.concatenate([columns, free], axis=-1)
    response = Linear(A, B, C, DT, many, K)
    found, fall = estimate(
        columns, np.ones((many, K, 2), bool), 2, truth.but(process=np.zeros(2)), response, [1]
    )
    assert found.process[1] == pytest.approx(0.8, rel=0.2)
    assert fall > 100


def test_eliminated_states_leave_the_least_squares_solution():
    rng = np.random.default_rng(3)
    white = rng.normal(size=(4, 10, 2, 1 + 2 + 3))
    normal = reduce(white, 2)
    X = np.zeros((4 * 20, 4 * 2 + 3))
    for w in range(4):
        rows = slice(20 * w, 20 * w + 20)
        X[rows, 2 * w : 2 * w + 2] = white[w, ..., 1:3].reshape(20, 2)
        X[rows, 8:] = white[w, ..., 3:].reshape(20, 3)
    y = white[..., 0].ravel()
    best, rest, *_ = np.linalg.lstsq(X, y, rcond=None)
    step = scaled_inverse(normal.S) @ normal.g
    np.testing.assert_allclose(step, best[8:], rtol=1e-6)
    assert normal.rest - normal.g @ step == pytest.approx(rest[0], rel=1e-6)
