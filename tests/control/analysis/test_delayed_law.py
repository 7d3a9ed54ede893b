"""K06 (5.1): the sampled plant behind its delay by hand, and that no law is cheaper."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol import InputError
from hovercontrol.control.analysis.delayed_law import DelayedLoop
from hovercontrol.documents.k06.law_loop import force_craft

LINE = force_craft().linearize([1.1, 0.0, 0.0], [0.0, 0.0])


def loop(delay, period=0.3):
    return DelayedLoop(LINE.A, LINE.B, period, delay, np.diag([1.0, 1.0, 0.1]), 0.1 * np.eye(2))


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_a_step_is_the_integral_with_the_old_command_until_the_delay_is_over(delay, rng):
    first, old, new = rng.normal(size=3), rng.normal(size=2), rng.normal(size=2)
    x = first
    for begin, end, u in ((0.0, delay, old), (delay, 0.3, new)):
        if end > begin:
            slope = lambda t, s, u=u: LINE.A @ s + LINE.B @ u  # noqa: E731
            run = solve_ivp(slope, (begin, end), x, rtol=1e-10, atol=1e-12)
            x = run.y[:, -1]
    Phi, Gamma = loop(delay).step()
    assert Phi @ [*first, *old] + Gamma @ new == pytest.approx([*x, *new], abs=1e-8)


def test_without_a_delay_both_laws_are_one():
    one = loop(0.0)
    assert one.gain() == pytest.approx(one.gain(knows_delay=False), abs=1e-5)


@pytest.mark.slow
def test_no_other_gain_is_cheaper_than_5_1(rng):
    one = loop(0.15)
    best = one.gain()
    for _ in range(30):
        assert one.cost(best + 0.05 * rng.normal(size=best.shape)) > one.cost(best)


def test_the_law_that_ignores_a_long_delay_is_unstable():
    one = loop(0.25)
    assert one.growth(one.gain()) < 1 < one.growth(one.gain(knows_delay=False))
    assert one.cost(one.gain(knows_delay=False)) == np.inf


def test_the_cost_is_that_of_noisy_runs(rng):
    one = loop(0.1)
    (Phi, Gamma), L = one.step(), one.gain()
    s, total, runs = np.zeros((2000, 5)), 0.0, 60
    for k in range(2 * runs):
        u = -s @ L.T
        if k >= runs:
            total += np.mean(np.einsum("ni,ij,nj->n", s[:, :3], one.Q, s[:, :3]) + 0.1 * (u**2).sum(axis=1))
        s = s @ Phi.T + u @ Gamma.T
        s[:, :3] += rng.normal(size=(2000, 3))
    assert total / runs == pytest.approx(one.cost(L), rel=0.03)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"delay": 0.4}, "delay: expected 0 to the period, 0.3 s, found 0.4"),
        ({"period": 0.0}, "period must be positive"),
        ({"Q": np.eye(2)}, r"Q: expected shape \(3, 3\), found \(2, 2\)"),
    ],
)
def test_bad_input_is_refused(change, line):
    given = {"A": LINE.A, "B": LINE.B, "period": 0.3, "delay": 0.1, "Q": np.eye(3), "R": np.eye(2)} | change
    with pytest.raises(InputError, match=line):
        DelayedLoop(**given)
