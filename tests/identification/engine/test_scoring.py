"""Scoring and feedback, on an unstable machine that feedback of its noisy measurement holds up."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.feedback import fed_back
from hovercontrol.identification.engine.fit import estimate, first_noise, scored
from hovercontrol.identification.engine.noise import Noise
from hovercontrol.identification.engine.passes import run_pass
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import LOOSE, Problem
from hovercontrol.identification.engine.scoring import Levels, scores
from hovercontrol.logs import Log

TRUE = np.array([60.0, 8.0, 1.0])
H, PUSH, NOISE = 0.01, 0.1, 2e-3


def machine(a=55.0, b=7.5, c=0.9):
    q, w, u = Signal("q", "rad"), Signal("w", "rad/s"), Signal("u", "V")
    own = [Signal("a", "1/s^2", start=a), Signal("b", "rad/s^2/V", start=b), Signal("c", "1/s", start=c)]
    rate = own[0].symbol * q.symbol + own[1].symbol * u.symbol - own[2].symbol * w.symbol
    slopes = {"q": w.symbol, "w": rate}
    return Block("machine", [q, w], [u], [q], own, slopes)


def step(a, b, c, push):
    """Transition over one row, effect of the input, and covariance of white pushes (Van Loan, 1978)."""
    F, g = np.array([[0.0, 1.0], [a, -c]]), np.array([[0.0], [b]])
    whole = expm(H * np.block([[F, g], [np.zeros((1, 3))]]))
    loan = expm(H * np.block([[-F, np.diag([0.0, push**2])], [np.zeros((2, 2)), F.T]]))
    return whole[:2, :2], whole[:2, 2], loan[2:, 2:].T @ loan[:2, 2:]


def held_up(seed, rows, held=True):
    """Return a log of the machine; if not `held`, of a stable one that answers nothing."""
    rng = np.random.default_rng(seed)
    A, g, Q = step(*(TRUE if held else (-60.0, 8.0, 1.0)), PUSH)
    root, x, last, y, u = np.linalg.cholesky(Q), np.array([0.05, 0.0]), None, [], []
    extra = np.repeat(rng.uniform(-1.0, 1.0, rows // 20 + 1), 20)
    for k in range(rows):
        y.append(x[0] + NOISE * rng.normal())
        rate, last = 0.0 if last is None else (y[-1] - last) / H, y[-1]
        u.append(extra[k] - held * (18.0 * y[-1] + 1.5 * rate))
        x = A @ x + g * u[-1] + root @ rng.normal(size=2)
    return Log("held", H * np.arange(rows), {"q": np.array(y), "u": np.array(u)})


def fitted(log, **values):
    model = as_model(machine(**values))
    problem = Problem(model, gather(model, [log]).joined)
    prior = prior_of(problem, model)
    return scored(estimate(problem, prior, first_noise(problem), gate=True), prior)


def test_the_score_is_the_derivative_of_the_likelihood_of_all_measurements(monkeypatch):
    """The density of all rows is a single normal one, whose covariance is written out."""
    monkeypatch.setattr("hovercontrol.identification.engine.data.SHARE", 0.0)  # it begins in motion
    log, push, first = held_up(1, 60), 0.2, np.array([0.03, 0.1])
    model = as_model(machine())
    problem = Problem(model, gather(model, [log]).joined)
    path = np.broadcast_to(first, problem.guess.shape)
    tau = H / 30.0
    process = np.array([push / np.sqrt(2.0 * tau)])
    noise = Noise(np.array([NOISE]), np.ones((1, 1)), process, np.array([tau]), ("w",))
    levels = Levels(np.array([0]), np.array([0]), np.empty(0, dtype=int))
    S, g = scores(problem, noise, problem.start, path, levels, np.full(3, 1.0))

    def minus_log(z):
        A, b, Q = step(*z[:3], push * np.exp(z[4]))
        mean, cov = [first], np.zeros((60, 60))
        P = np.diag((LOOSE * problem.spread) ** 2)
        for k in range(60):
            cov[k, k] = P[0, 0]
            ahead = P
            for later in range(k + 1, 60):
                ahead = A @ ahead
                cov[k, later] = cov[later, k] = ahead[0, 0]
            P = A @ P @ A.T + Q
            mean.append(A @ mean[-1] + b * log["u"][k])
        cov += np.eye(60) * (NOISE * np.exp(z[3])) ** 2
        return -multivariate_normal.logpdf(log["q"], np.array(mean)[:60, 0], cov)

    z, d = np.array([*problem.start, 0.0, 0.0]), 1e-4 * np.array([55.0, 7.5, 0.9, 1.0, 1.0])
    by_hand = [(minus_log(z + e) - minus_log(z - e)) / (2 * e.max()) for e in np.diag(d)]
    size = np.sqrt(np.diag(S.sum(axis=0)))
    np.testing.assert_allclose(-g.sum(axis=0) / size, np.array(by_hand) / size, rtol=0.02, atol=0.02)


def test_the_information_is_that_of_the_spectrum():
    """Whittle's formulas for x' = a x + w, y = x + e; the states of the path as if known give 0.8 of it."""
    a, q, r, n = 0.9, 0.1, 0.3, 4000
    rng, x, y = np.random.default_rng(0), 0.0, []
    for _ in range(n):
        y.append(x + r * rng.normal())
        x = a * x + q * rng.normal()
    v, k = Signal("v", "m/s"), Signal("a", "1", start=a)
    model = as_model(Block("lag", [v], [], [v], [k], {"v": k.symbol * v.symbol}, period=H))
    problem = Problem(model, gather(model, [Log("lag", H * np.arange(n), {"v": np.array(y)})]).joined)
    prior = prior_of(problem, model)
    noise = Noise(np.array([r]), np.ones((1, 1)), np.array([q / H]), np.array([H / 2]), ("v",))
    path = estimate(problem, prior, noise, frozen=True, levels=False).path
    S, _ = scores(problem, noise, problem.start, path, Levels.of(problem, noise, times=False), np.ones(1))
    known = run_pass(problem, noise, prior, problem.start, path, frozen=False).S
    h = 1.0 / (np.exp(-1j * np.linspace(-np.pi, np.pi, 20001)) - a)
    G = q**2 * np.abs(h) ** 2
    wiener = G / (G + r**2)
    asked = np.mean(2.0 * wiener**2 * h.real**2), np.mean(wiener**2 * np.abs(h) ** 2)
    np.testing.assert_allclose([S[:, 0, 0].sum() / n, known.sum() / n], asked, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_under_feedback_the_estimate_is_that_of_a_kalman_filter_by_hand(seed):
    log = held_up(seed, 1500)
    y, u = log["q"], log["u"]

    def cost(z):
        A, b, Q = step(*z[:3], np.exp(z[3]))
        x, P, R, total = np.array([y[0], 0.0]), np.diag([1.0, 100.0]), np.exp(2 * z[4]), 0.0
        for k in range(len(y)):
            S, e = P[0, 0] + R, y[k] - x[0]
            total += e * e / S + np.log(S)
            K = P[:, 0] / S
            x, P = x + K * e, P - np.outer(K, P[0])
            x, P = A @ x + b * u[k], A @ P @ A.T + Q
        return total

    start = np.array([*TRUE, np.log(PUSH), np.log(NOISE)])
    by_hand = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3}).x[:3]
    fit = fitted(log)
    std = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.p - by_hand) < 0.35 * std).all()
    assert (np.abs(fit.p - TRUE) < 3.0 * std).all()


def test_a_diagnosis_under_feedback_has_the_same_coefficients():
    """Stretches that began anew, and passes without scoring, left them a standard error away."""
    log = held_up(3, 600)
    fit, diagnosed = fitted(log), diagnose(machine(), [log], names=[]).selection.final
    assert (np.abs(fit.p - diagnosed.p) < 0.1 * np.sqrt(np.diag(fit.covariance))).all()


def test_inputs_that_answer_the_measurements_are_told_from_others():
    answers, others = fitted(held_up(3, 600)), fitted(held_up(3, 600, held=False), a=0.0)
    assert fed_back(answers, 0.01) and not fed_back(others, 0.01)
