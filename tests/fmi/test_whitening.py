"""The model of residuals: variance, order, and when they depend on their past beyond chance."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hovercontrol.fmi.replay.whitening import whitening_of

ROWS, UNKNOWNS = 120, 8


def noise(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


def variance(white):
    return float(np.exp(white.log_det))


def test_what_the_fit_takes_is_added_to_the_variance():
    """Least squares with 8 unknowns and 120 rows: n - P in place of n, to the square of P/n."""
    t = np.linspace(-1.0, 1.0, ROWS)
    Q = np.linalg.qr(np.polynomial.legendre.legvander(t, UNKNOWNS - 1))[0]
    plain, whole = [], []
    for seed in range(300):
        w = noise(seed, ROWS)
        r = (w - Q @ (Q.T @ w))[:, None]
        alone = whitening_of([r], np.ones(1), most=0)
        L = np.sqrt(variance(alone)) * Q[:, None, :]
        plain.append(variance(alone))
        whole.append(variance(whitening_of([r], np.ones(1), most=0, taken=[L])))
    share = UNKNOWNS / ROWS
    assert np.mean(plain) == pytest.approx(1.0 - share, abs=0.02)
    assert np.mean(whole) == pytest.approx(1.0 - share**2, abs=0.02)


def test_few_white_residuals_are_said_to_depend_on_their_past():
    """Schwarz' criterion alone finds an order in some of 1200 channels."""
    found = [whitening_of([noise(seed, 400, 6)], np.ones(6)) for seed in range(200)]
    assert sum(any(w.orders) for w in found) > 5
    assert sum(any(w.coloured) for w in found) <= 1


def test_residuals_of_a_disturbed_plant_depend_on_their_past():
    e = lfilter([1.0], [1.0, -0.5], noise(0, 400, 2)[:, 0])
    white = whitening_of([np.column_stack([e, noise(1, 400)])], np.ones(2))
    assert white.coloured == (True, False)
    assert white.coefficients[0][0] == pytest.approx(0.5, abs=0.15)
    assert white.gains[0] == pytest.approx(-400 * np.log(1 - 0.25), rel=0.4)
