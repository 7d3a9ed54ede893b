"""Where something is missing that has no name, the next experiment goes where least is known of it."""

import numpy as np
import pytest

import hovercontrol as hc

V, K = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=0.5)
F = hc.Signal("F", "m/s^2", lower=0.0, upper=2.0)
CART = hc.Block("cart", (V,), (F,), (V,), (K,), {"v": F.symbol - K.symbol * V.symbol})


def driven(time, push, extra, seed=0):
    """A cart with more drag than 0.5 v, by Euler's method in small steps."""
    v, rows, rng = 0.0, [], np.random.default_rng(seed)
    for k, force in enumerate(push):
        rows.append(v)
        for _ in range(20):
            v += (time[1] - time[0]) / 20 * (force - 0.5 * v - extra(v, k))
    return hc.Log("run", time, {"v": np.array(rows) + 2e-3 * rng.normal(size=time.size), "F": push})


def gentle(extra):
    t, rng = np.arange(0.0, 30.0, 0.1), np.random.default_rng(1)
    return driven(t, np.repeat(rng.uniform(0.1, 1.0, 30), 10), extra)


def test_it_visits_what_no_log_has_shown_and_says_what_it_will_show():
    def hump(v, k):
        return 0.5 * np.exp(-(((v - 0.8) / 0.1) ** 2))

    log = gentle(hump)
    found = hc.diagnose(CART, [log], names=[])
    assert found.verdict == "unexplained"
    assert "what v' lacks, as a function of v from" in found.advice
    e = found.experiment
    assert e.commands["F"].max() <= 2.0
    again = driven(e.time, e.commands["F"], hump, 2)
    assert again["v"].max() > 1.3 * log["v"].max()
    # the error of the function, over the speeds of both logs, falls at least as stated
    before, after = (
        np.interp(np.linspace(0.1, log["v"].max(), 30), y.at, y.std).mean()
        for d in (found, hc.diagnose(CART, [log, again], names=[]))
        for y in d.yardsticks
    )
    assert after < before


@pytest.mark.slow
def test_gusts_are_no_function_of_signals_and_have_no_experiment():
    push = np.repeat(np.random.default_rng(3).normal(size=300), 1) * 0.3
    found = hc.diagnose(CART, [gentle(lambda v, k: push[k])], names=[])
    assert found.verdict == "unexplained" and found.experiment is None
    assert (
        found.advice
        == "what remains in v' is not a function of signals in these logs: no manoeuvre shows its form"
    )
