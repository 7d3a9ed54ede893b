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
from tests.identification.monitor.cart import NOISE, PERIOD, cart_monitor, step

ROWS, PHI, PRIOR = 60, 1.3, np.array([[2.0, 0.5], [0.5, 1.0]])


def test_amplitudes_and_their_errors_are_those_of_a_joint_least_squares(rng):
    """e = r d0 + sum of theta_j eta_j + n, with d0 ~ N(0, PRIOR) and n ~ N(0, PHI): rows weighted by hand."""
    r, eta = rng.normal(size=(ROWS, 2)), rng.normal(size=(ROWS, 3))
    seen = r @ [0.8, -0.5] + eta @ [1.0, 0.0, -2.0] + np.sqrt(PHI) * rng.normal(size=ROWS)
    names = ["e", "r0", "r1", "eta0", "eta1", "eta2", "age", "after"]
    inputs = [hc.Signal(n) for n in names]
    e, r0, r1, *columns, age, after = (s.symbol for s in inputs)
    write, zero = Equations(), sp.S.Zero
    bank = SimpleNamespace(
        whitened=[e], rows=sp.Matrix([[r0, r1]]), since=[[c] for c in columns], age=[age],
        dispersion=[sp.Float(PHI)] * 3,
    )  # fmt: skip
    found = pair(
        write, bank, [hc.Signal("p"), hc.Signal("v")], after, sp.Matrix(PRIOR), sp.Float(PHI), [zero, zero],
        3, [], 9.2,
    )  # fmt: skip
    outputs = {"n": found.numbers, "theta": found.theta, "var": found.variance}
    shown = {f"{key}{k}": e for key, both in outputs.items() for k, e in enumerate(both, 1)}
    block = hc.Block("one").unchecked(
        states=found.states, inputs=tuple(inputs), outputs=tuple(hc.Signal(n) for n in shown), period=0.1,
        derivatives=Expressions((s.name, found.next_values[s.name]) for s in found.states),
        definitions=Expressions(write.definitions), output_expressions=Expressions(shown),
    )  # fmt: skip
    run = Ticking(block)
    run.tick(0.0, dict.fromkeys(names, 0.0))
    for k in range(ROWS):
        row = [seen[k], *r[k], *eta[k], k + 1.0, 1.0]
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


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_two_changes_at_once_are_told(seed):
    """At 30 s the drag becomes 0.9 1/s and the mass 1.6 kg; neither alone explains the samples."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(450)
    F, x, p = 2.0 * np.sign(np.sin(0.9 * t + 0.1)), np.zeros(2), []
    for k, now in enumerate(t):
        p.append(x[0] + NOISE * rng.normal())
        x = (step(0.9, 1.6) if now >= 30.0 else step(0.5)) @ [*x, F[k]]
    found = hc.replay(cart_monitor("c", "m", "p_bias"), hc.Log("cart.csv", t, {"p": np.array(p), "F": F}))
    first, second, *_ = found.alarms
    assert {(first.name, first.beside), (second.name, second.beside)} == {("c", "m"), ("m", "c")}
    assert not first.rivals and not second.rivals and "; at once with c" in found.text()
    c, m = sorted((first, second), key=lambda a: a.name)
    assert abs(c.change - 0.4) < 0.1 and abs(m.change + 0.4) < 0.15  # the response to a mass is not linear
