"""Coefficients of many craft: likelihood by definition, intervals that cover, craft set apart."""

import numpy as np
import pytest
from scipy import stats

from hovercontrol.identification.fleet.random_effects import _Grid, _Logs, q_values, random_effects


def simulated(rng, craft, logs, between=1.0, within=0.3, outliers=0):
    number = np.repeat(np.arange(craft), logs)
    truth = between * rng.normal(size=craft)
    truth[:outliers] += 8.0 * between
    std = rng.uniform(0.25, 1.0, number.size)
    y = 5.0 + truth[number] + within * rng.normal(size=number.size) + std * rng.normal(size=number.size)
    return y, std**2, number, 5.0 + truth


def test_the_weights_are_the_restricted_likelihood_of_the_whole_covariance(rng):
    y, v, craft, _ = simulated(rng, 4, 3)
    logs, q = _Logs(y, v, craft, np.ones(y.size, bool)), np.array([0.2, 0.5, 0.6])
    grid = _Grid(logs, np.ones(4, bool), q, q, (1.0, 1.0))
    direct = np.empty((3, 3))
    for i, omega in enumerate(grid.omega):
        for j, tau in enumerate(grid.tau):
            V = np.diag(v + omega**2) + tau**2 * (craft[:, None] == craft)
            one = np.ones((y.size, 1))
            X = one.T @ np.linalg.solve(V, one)
            mu = float(one[:, 0] @ np.linalg.solve(V, y) / X[0, 0])
            log = stats.multivariate_normal(np.full(y.size, mu), V).logpdf(y) - 0.5 * np.log(X[0, 0])
            direct[i, j] = log - 2 * np.log1p(-q[i]) - 2 * np.log1p(-q[j])
    direct = np.exp(direct - direct.max())
    np.testing.assert_allclose(grid.weight, direct / direct.sum(), rtol=1e-9)


def test_intervals_of_craft_cover_their_values_in_95_percent(rng):
    inside = []
    for _ in range(60):
        y, v, craft, truth = simulated(rng, 20, 8)
        found = random_effects(y, v, craft, np.ones(y.size, bool))
        inside.append(np.abs(found.value - truth) < 1.96 * found.std)
    assert 0.93 < np.mean(inside) < 0.97


def test_craft_far_from_the_others_are_set_apart_though_they_are_three(rng):
    found = [
        random_effects(*(d := simulated(rng, 40, 5, outliers=3))[:3], np.ones(d[0].size, bool))
        for _ in range(10)
    ]
    apart = np.array([~f.belongs for f in found])
    assert apart[:, :3].all() and apart[:, 3:].sum() <= 5
    assert np.mean([f.between for f in found]) == pytest.approx(1.0, rel=0.2)


def test_a_coefficient_that_is_the_same_in_all_craft_is_told_as_one(rng):
    p = []
    for _ in range(100):
        y, v, craft, _ = simulated(rng, 6, 4, between=0.0)
        p.append(random_effects(y, v, craft, np.ones(y.size, bool)).p_differ)
    assert stats.kstest(p, "uniform").pvalue > 0.001


def test_q_values_are_those_of_benjamini_and_hochberg():
    p = np.array([0.01, 0.02, np.nan, 0.03, 0.5])
    np.testing.assert_allclose(q_values(p), [0.04, 0.04, np.nan, 0.04, 0.5])
