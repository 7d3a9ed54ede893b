"""The filter and the smoother against dense Gaussian algebra of the same linear system."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import block_diag

from hovercontrol.blocks.backends.compiler import NoCompilerError
from hovercontrol.identification.engine import kalman
from hovercontrol.identification.engine.kalman import Forces, System, run_filter, run_smoother
from hovercontrol.identification.engine.kalman_compiled import Compiled, compiled

K, W, n, C, m = 9, 2, 3, 2, 3


def system(rng, process=1.0, gaps=0.3):
    """Return a random system whose path is the zero of its states, with two columns beside the residual."""
    A = np.eye(n) + 0.2 * rng.normal(size=(K - 1, W, n, n))
    G = process * rng.normal(size=(K - 1, W, n, 1))  # of rank one
    seen = rng.random((K, W, C)) > gaps
    H = np.where(seen[..., None], rng.normal(size=(K, W, C, n)), 0.0)
    R = np.where(seen, rng.uniform(0.1, 0.5, (K, W, C)), 1.0)
    P0 = np.broadcast_to(np.diag([4.0, 1.0, 0.5]), (W, n, n)).copy()
    columns = np.where(seen[..., None], rng.normal(size=(K, W, C, m)), 0.0)
    drive = 0.3 * rng.normal(size=(K - 1, W, n, m))
    none = Forces((), np.zeros((5, K - 1, W, 0)), n)
    return System(A, H, R, ((drive, columns),), P0, none, G @ np.swapaxes(G, 2, 3))


def forced(rng, sampled=False):
    """Return a random system of two plain states, driven by a missing acceleration; and columns in groups."""
    s, moments = system(rng), rng.uniform(0.1, 0.3, (5, K - 1, W, 1))
    moments[2] *= 3.0  # so that the covariance is positive
    ((drive, seen),) = s.columns
    groups = ((drive[..., :2, :1], seen[..., :1]), (drive[..., :2, 1:2], None), (None, seen[..., 2:]))
    force = Forces((1,), moments, 2, sampled)
    return System(s.A[..., :2, :2].copy(), s.H[..., :2].copy(), s.R, groups, s.P0, force)


def dense(s, w):
    """Return the covariance of all states of a block, what each column makes of them, and all channels."""
    reach = np.zeros((K, K, n, n))  # from what enters at row j to row k
    for j in range(K):
        reach[j, j] = np.eye(n)
        for k in range(j + 1, K):
            reach[k, j] = s.A[k - 1, w] @ reach[k - 1, j]
    T = reach.transpose(0, 2, 1, 3).reshape(K * n, K * n)
    enters = block_diag(s.P0[w], *s.Q[:, w])
    mean = T @ np.concatenate([np.zeros((n, m)), s.columns[0][0][:, w].reshape(-1, m)])
    H = block_diag(*s.H[:, w])
    return T @ enters @ T.T, mean, H, np.diag(s.R[:, w].ravel())


@pytest.mark.parametrize("process", [0.0, 0.5])
def test_whitened_products_and_determinant_are_those_of_the_covariance(rng, process):
    s = system(rng, process)
    found = run_filter(s, rows=True)
    for w in range(W):
        P, mean, H, R = dense(s, w)
        S = H @ P @ H.T + R
        X = s.columns[0][1][:, w].reshape(-1, m) - H @ mean
        Z = found.white[:, w].reshape(-1, m)
        np.testing.assert_allclose(Z.T @ Z, X.T @ np.linalg.solve(S, X), rtol=1e-9)
        np.testing.assert_allclose(found.products[w], Z.T @ Z, rtol=1e-9, atol=1e-12)
        assert found.log_dets[w] == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-9)
        assert found.log_det[:, w].sum() == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-9)


@pytest.mark.parametrize("process", [0.0, 0.5])
def test_smoothed_states_are_those_given_all_measurements(rng, process):
    s, weights = system(rng, process), np.array([1.0, 0.4, -0.7])
    found = run_smoother(s, run_filter(s), weights)
    for w in range(W):
        P, mean, H, R = dense(s, w)
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        e = s.columns[0][1][:, w].reshape(-1, m) @ weights - H @ mean @ weights
        np.testing.assert_allclose(found.state[:, w].ravel(), mean @ weights + gain @ e, atol=1e-9)
        known = P - gain @ H @ P
        for k in range(K):
            own = slice(n * k, n * k + n)
            np.testing.assert_allclose(found.variance[k, w], np.diag(known[own, own]), atol=1e-9)
            at = np.diag(s.H[k, w] @ known[own, own] @ s.H[k, w].T)
            np.testing.assert_allclose(found.known[k, w], at, atol=1e-9)


def test_a_stretch_that_follows_another_runs_on_from_it(rng):
    """Cut in two, with the row of the cut at the end of one and the begin of the other, nothing changes."""
    s, weights, cut = system(rng, 0.5), np.array([1.0, 0.4, -0.7]), 4
    size, pad = K - cut, K - 2 * cut - 1  # rows of the second part; of the first: cut + 1

    def parts(a, fill, last=None):
        first = np.concatenate([a[:cut], last, *[fill] * pad]) if last is not None else a[: size - 1].copy()
        return np.stack([first, a[cut:]], axis=2).reshape(len(first), -1, *a.shape[2:], order="C")

    ((drive, seen),) = s.columns
    rows = [
        parts(a, a, fill(a[:1]))
        for a, fill in ((s.H, np.zeros_like), (s.R, np.ones_like), (seen, np.zeros_like))
    ]
    assert pad == 0
    A, Q, drive = (parts(a[: K - 1], None) for a in (s.A, s.Q, drive))
    none = Forces((), np.zeros((5, len(A), 2 * W, 0)), n)
    P0, follows = np.repeat(s.P0, 2, axis=0), np.tile([False, True], W)
    both = System(A, rows[0], rows[1], ((drive, rows[2]),), P0, none, Q, follows)
    whole, found = run_filter(s, rows=True), run_filter(both, rows=True)
    np.testing.assert_allclose(found.white[:, 1::2], whole.white[cut:], atol=1e-12)
    one, other = run_smoother(s, whole, weights), run_smoother(both, found, weights)
    np.testing.assert_allclose(other.state[:, 0::2], one.state[: cut + 1], atol=1e-9)
    np.testing.assert_allclose(other.variance[:, 1::2], one.variance[cut:], atol=1e-9)


def test_weights_may_differ_from_block_to_block(rng):
    s = system(rng)
    filtered, weights = run_filter(s), np.array([[1.0, 0.4, -0.7], [1.0, 0.0, 2.0]])
    both = run_smoother(s, filtered, weights).state
    for w in range(W):
        np.testing.assert_allclose(both[:, w], run_smoother(s, filtered, weights[w]).state[:, w])


@pytest.mark.parametrize("sampled", [False, True])
def test_the_likelihood_grows_with_a_missing_acceleration_as_the_smoother_says(rng, sampled):
    """By the logarithm of its variance, which all its moments of noise have as a factor."""
    s, costs, size = forced(rng, sampled), [], 1e-5
    smooth = run_smoother(s, run_filter(s), np.array([1.0, 0.0, 0.0]))
    for change in (size, -size):
        moments = s.forces.moments * np.exp([0.0, 0.0, change, change, change])[:, None, None, None]
        f = run_filter(replace(s, forces=replace(s.forces, moments=moments)))
        costs.append(f.products[:, 0, 0] + f.log_dets)
    slope = -0.5 * (costs[0] - costs[1]) / (2.0 * size)
    np.testing.assert_allclose(slope, 0.5 * (smooth.forces[:, 0, 0] - smooth.forces[:, 0, 1]), rtol=1e-4)


def test_a_block_without_measurements_counts_for_nothing(rng):
    s = system(rng, gaps=1.1)
    found = run_filter(s, rows=True)
    assert (found.white == 0.0).all() and (found.log_det == 0.0).all()
    x = run_smoother(s, found, np.array([1.0, 0.0, 0.0])).state
    for w in range(W):
        np.testing.assert_allclose(x[:, w].ravel(), dense(s, w)[1][:, 0], atol=1e-12)


@pytest.mark.parametrize(
    "make", [system, partial(system, process=0.0), forced, partial(forced, sampled=True)]
)
def test_c_and_numpy_agree(rng, make, monkeypatch):
    try:
        library = Compiled(n, C)
    except NoCompilerError:
        pytest.skip("there is no C compiler")
    s, weights = make(rng), np.array([1.0, 0.4, -0.7])
    found = []
    for chosen in (library, None):
        monkeypatch.setattr(kalman, "compiled", lambda *sizes, chosen=chosen: chosen)
        filtered = run_filter(s, rows=True)
        found.append((filtered, run_smoother(s, filtered, weights), run_filter(s)))
    (one, smooth_one, bare), (other, smooth_other, _) = found
    np.testing.assert_array_equal(bare.products, one.products)
    for name in ("white", "log_det", "products", "log_dets", "P", "Z"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-11)
    for name in ("state", "variance", "known", "forces"):
        np.testing.assert_allclose(getattr(smooth_one, name), getattr(smooth_other, name), atol=1e-11)


def test_a_covariance_that_is_not_positive_is_refused(rng, monkeypatch):
    s = system(rng)
    broken = replace(s, P0=-100.0 * np.abs(s.P0))
    for chosen in (compiled(n, C), None):
        monkeypatch.setattr(kalman, "compiled", lambda *sizes, chosen=chosen: chosen)
        with pytest.raises(np.linalg.LinAlgError):
            run_filter(broken)
