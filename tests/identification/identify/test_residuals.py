"""Residuals of a fit: noise where the model is complete, and not where it lacks a term."""

import numpy as np
import pytest
from scipy import signal

import hovercontrol as hc
from hovercontrol.identification.identify import free_run
from hovercontrol.identification.identify.residuals import WITHIN, _lagged

v, F, c = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2"), hc.Signal("c", "1/s", start=0.5)
CART = hc.Block("cart", [v], [F], [v], [c], {"v": F.symbol - c.symbol * v.symbol})


def fitted(cubic):
    """Return the residuals of v' = F - c v on a log of a cart that has also -cubic v^3."""
    rng, t = np.random.default_rng(4), 0.02 * np.arange(1500)
    force, x, rows = np.repeat(rng.uniform(-2.0, 2.0, 30), 50), 0.0, np.empty(t.size)
    for k, f in enumerate(force):
        rows[k] = x
        for _ in range(4):  # the midpoint rule
            half = x + 0.0025 * (f - 0.5 * x - cubic * x**3)
            x += 0.005 * (f - 0.5 * half - cubic * half**3)
    log = hc.Log("run", t, {"v": rows + 0.003 * rng.normal(size=t.size), "F": force})
    return hc.identify(CART, [log]).residuals(lags=20)


def test_residuals_of_a_complete_model_are_white():
    found = fitted(0.0)
    assert found.outside("v") <= 2 and found.outside("v", "F") <= 3
    assert found.limit == pytest.approx(2.5758 / np.sqrt(1500), rel=1e-3) and WITHIN == 0.99
    assert len(found.plot().axes) == 2


def test_a_missing_term_shows_in_them():
    assert fitted(0.5).outside("v") > 4  # by chance: 1 in a million


def test_correlations_at_lags_are_those_of_scipy():
    x, y = np.random.default_rng(1).normal(size=(2, 60))
    lags = signal.correlation_lags(60, 60)
    assert _lagged(x, y, 7) == pytest.approx(signal.correlate(x, y)[np.abs(lags) <= 7])


def test_a_free_run_says_its_fit_as_matlab_does():
    t = np.linspace(0.0, 4.0, 81)
    log = hc.Log("run", t, {"v": np.exp(-0.4 * t), "F": 0 * t})
    run = free_run(CART, log)
    y, z = run.simulated[0], run.measured[0]
    seen = np.isfinite(z)  # the log begins in motion: its first samples are left out
    assert 70 < seen.sum() < 81
    y, z = y[seen], z[seen]
    expected = 100 * (1 - np.linalg.norm(z - y) / np.linalg.norm(z - z.mean()))  # help of compare
    assert run.fit["v"] == pytest.approx(expected)
    assert f"fit {expected:.3g} %" in run.plot().axes[0].get_title(loc="right")
