"""Two changes at once: their sums against a joint least squares, and a cart with two changes."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.identification.monitor.pairs import pair
from tests.identification.monitor.cart import cart_monitor, log

ROWS, PHI, PRIOR = 60, 1.3, np.array([[2.0, 0.5], [0.5, 1.0]])


def test_amplitudes_and_their_errors_are_those_of_a_joint_least_squares(rng):
    """e = r d0 + sum of theta_j eta_j + n, with d0 ~ N(0, PRIOR) and n ~ N(0, PHI): rows weighted by hand."""
    r, eta = rng.normal(size=(ROWS, 2)), rng.normal(size=(ROWS, 3))
    seen = r @ [0.8, -0.5] + eta @ [1.0, 0.0, -2.0] + np.sqrt(PHI) * rng.normal(size=ROWS)
    names = ["e", "r0", "r1", "eta0", "eta1", "eta2", "age", "begins"]
    inputs = [hc.Signal(n) for n in names]
    e, r0, r1, *columns, age, begins = (s.symbol for s in inputs)
    write, zero = Equations(), sp.S.Zero
    bank = SimpleNamespace(
        whitened=[e], rows=sp.Matrix([[r0, r1]]), since=[[c] for c in columns], dispersion=[sp.Float(PHI)] * 3,
        age=[age],
    )  # fmt: skip
    found = pair(
        write, bank, [hc.Signal("p"), hc.Signal("v")], begins, sp.Matrix(PRIOR), sp.Float(PHI), [zero, zero],
        3, [], 9.2,
    )  # fmt: skip
    both = zip(*(found.numbers, found.theta, found.variance), strict=True)
    shown = dict(zip(["n1", "theta1", "var1", "n2", "theta2", "var2"], [x for one in both for x in one]))
    block = hc.Block("one").unchecked(
        states=found.states, inputs=tuple(inputs), outputs=tuple(hc.Signal(n) for n in shown), period=0.1,
        derivatives=Expressions((s.name, found.next_values[s.name]) for s in found.states), definitions=Expressions(write.definitions),
        output_expressions=Expressions(shown),
    )  # fmt: skip
    run = Ticking(block)
    run.tick(0.0, dict.fromkeys(names, 0.0) | {"begins": 1.0})
    for k in range(ROWS):
        row = [seen[k], *r[k], *eta[k], k + 1.0, 0.0]
        out = run.tick(0.1 * (k + 1), dict(zip(names, row, strict=True)))

    prior = np.linalg.cholesky(np.linalg.inv(PRIOR)).T
    fits = {}
    for two in itertools.combinations(range(3), 2):
        rows = np.vstack([np.c_[r, eta[:, two]] / np.sqrt(PHI), np.c_[prior, np.zeros((2, 2))]])
        x, rest, *_ = np.linalg.lstsq(rows, np.r_[seen / np.sqrt(PHI), 0.0, 0.0], rcond=None)
        fits[two] = rest[0], x[2:], np.diag(np.linalg.inv(rows.T @ rows))[2:]
    best, (_, theta, variance) = min(fits.items(), key=lambda item: item[1][0])
    by_hand = {j + 1.0: (theta[i], variance[i]) for i, j in enumerate(best)}
    for k in (1, 2):
        assert by_hand[out[f"n{k}"]] == pytest.approx((out[f"theta{k}"], out[f"var{k}"]), rel=1e-9)
    assert set(by_hand) == {1.0, 3.0}
