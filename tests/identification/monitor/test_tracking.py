"""Explanations whose size wanders: their likelihood against that of the joint normal distribution."""

from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy import stats

import hovercontrol as hc
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.identification.monitor.tracking import track

M, PUSH, C, JOLT, PHI, WALK, FIRST, SPREAD = (
    0.8,
    0.5,
    1.3,
    0.4,
    1.2,
    0.3,
    (0.2, 0.7),
    ((2.0, 0.5), (0.5, 1.0)),
)


def test_the_likelihood_is_that_of_the_joint_normal_distribution(rng):
    """e_k = C d_k + JOLT a_k + n_k, d_k+1 = M d_k + PUSH a_k + 0.1, a_k+1 = a_k + w_k."""
    write, e, begins = Equations(), hc.Signal("e"), hc.Signal("begins")
    bank = SimpleNamespace(C=sp.Matrix([[C]]), whitened=[e.symbol])
    found = track(
        write, "t", [hc.Signal("d")], bank, sp.Matrix([[M]]), sp.Matrix([[PUSH]]), sp.Matrix([[JOLT]]),
        sp.Matrix([0.1]), sp.Float(PHI), [sp.Float(WALK)], begins.symbol, sp.Matrix(FIRST), sp.Matrix(SPREAD),
    )  # fmt: skip
    block = hc.Block("one").unchecked(
        states=found.states, inputs=(e, begins), outputs=(hc.Signal("told"),), period=0.1,
        derivatives=Expressions(found.next_values), definitions=Expressions(write.definitions),
        output_expressions=Expressions({"told": found.likelihood}),
    )  # fmt: skip
    run, seen = Ticking(block), rng.normal(size=6)
    run.tick(0.0, {"e": 0.0, "begins": 1.0})
    told = sum(run.tick(0.1 * k, {"e": value, "begins": 0.0})["told"] for k, value in enumerate(seen, 1))
    F, G, c = np.array([[M, PUSH], [0.0, 1.0]]), np.array([0.0, 1.0]), np.array([C, JOLT])
    mean, cov, x = np.empty(6), PHI * np.eye(6), np.array(FIRST)
    for k in range(6):
        mean[k], x = c @ x, F @ x + [0.1, 0.0]
        for i in range(6):
            rows = c @ np.linalg.matrix_power(F, k), c @ np.linalg.matrix_power(F, i)
            cov[k, i] += rows[0] @ np.array(SPREAD) @ rows[1]
            for j in range(min(i, k)):
                later = [c @ np.linalg.matrix_power(F, at - 1 - j) @ G for at in (k, i)]
                cov[k, i] += WALK * later[0] * later[1]
    exact = stats.multivariate_normal(mean, cov).logpdf(seen)
    assert told == pytest.approx(2.0 * exact + 6 * np.log(2.0 * np.pi), rel=1e-9)
