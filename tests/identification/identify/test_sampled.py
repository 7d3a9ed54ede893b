"""A Block of next values is fitted as a map, like least squares on the output error and from row to row."""

import re

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import least_squares

import hovercontrol as hc
from hovercontrol.base.errors import InputError

T = 0.05
TRUTH = {"d": 0.04, "k": 0.12}


def cart():
    q, w, u = hc.Signal("q", "m"), hc.Signal("w", "m/s"), hc.Signal("u", "N")
    d, k, h = (
        hc.Signal("d", "1", start=0.06),
        hc.Signal("k", "m/s/N", start=0.1),
        hc.Signal("h", "s", start=T),
    )
    steps = {
        "q": q.symbol + h.symbol * w.symbol,
        "w": (1 - d.symbol) * w.symbol + k.symbol * u.symbol,
    }
    return hc.Block("cart", [q, w], [u], [q], [d, k, h], steps, period=T)


def commands(n, seed):
    return np.repeat(np.random.default_rng(seed).uniform(-1, 1, n // 15 + 1), 15)[:n]


def positions(u, d, k, start=(0.0, 0.0)):
    q, w, found = *start, np.empty(u.size)
    for i, command in enumerate(u):
        found[i] = q
        q, w = q + T * w, (1 - d) * w + k * command
    return found


def log_of(u, noise=0.002, seed=1, arriving=None, keep=None):
    q = positions(u if arriving is None else arriving, **TRUTH)
    q += noise * np.random.default_rng([seed, 5]).normal(size=q.size)
    keep = np.arange(q.size) if keep is None else keep
    return hc.Log("cart", T * keep, {"q": q[keep], "u": u[keep]})


def valve():
    y, u = hc.Signal("y", "V"), hc.Signal("u", "V")
    d, k = hc.Signal("d", "1", start=0.3), hc.Signal("k", "1", start=0.3)
    return hc.Block(
        "valve", [y], [u], [y], [d, k], {"y": (1 - d.symbol) * y.symbol + k.symbol * u.symbol}, period=T
    )


def opened(u, d, k, start=0.0):
    y, found = start, np.empty(u.size)
    for i, command in enumerate(u):
        found[i] = y
        y = (1 - d) * y + k * command
    return found


@pytest.mark.parametrize("every", [1, 5])
def test_without_process_noise_the_fit_is_least_squares_on_the_output_error(every):
    u = commands(1200 * every, 3)
    keep = np.arange(0, u.size, every)
    y = opened(u, 0.2, 0.4)[keep] + 0.01 * np.random.default_rng(8).normal(size=keep.size)
    found = hc.identify(valve(), [hc.Log("valve", T * keep, {"y": y, "u": u[keep]})])
    wanted = least_squares(lambda p: opened(u, *p)[keep] - y, [0.3, 0.3, 0.0])
    variance = 2.0 * wanted.cost / (keep.size - 3)
    std = np.sqrt(np.diag(np.linalg.inv(wanted.jac.T @ wanted.jac)) * variance)
    for c, value, error in zip(found.coefficients, wanted.x, std, strict=False):
        assert abs(c.value - value) < 0.1 * error
        assert c.std == pytest.approx(error, rel=0.2)


def test_a_dropped_row_is_a_tick_without_measurement_and_the_period_is_known():
    keep = np.flatnonzero(np.random.default_rng(2).random(1200) > 0.2)
    found = hc.identify(cart(), [log_of(commands(1200, 3), keep=keep)])
    assert [c.name for c in found.coefficients] == ["d", "k"]
    assert [(c.name, c.value, c.kept) for c in found.kept] == [("h", T, "the sampling period")]
    for c in found.coefficients:
        assert abs(c.value - TRUTH[c.name]) < 4.0 * c.std < 0.01 * c.value


def test_without_measurement_noise_the_fit_is_least_squares_from_row_to_row():
    rng = np.random.default_rng(4)
    y, u, a, b = (
        hc.Signal("y", "V"),
        hc.Signal("u", "V"),
        hc.Signal("a", "1", start=0.5),
        hc.Signal("b", "1", start=0.3),
    )
    block = hc.Block("arx", [y], [u], [y], [a, b], {"y": a.symbol * y.symbol + b.symbol * u.symbol}, period=T)
    n, steps, out = 900, rng.normal(size=900), np.zeros(900)
    for i in range(n - 1):
        out[i + 1] = 0.7 * out[i] + 0.4 * steps[i] + 0.1 * rng.normal()
    found = hc.identify(block, [hc.Log("arx", T * np.arange(n), {"y": out, "u": steps})])
    X = np.column_stack([out[:-1], steps[:-1]])
    wanted, squares = np.linalg.lstsq(X, out[1:], rcond=None)[:2]
    std = np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * squares / n)
    for c, value, error in zip(found.coefficients, wanted, std, strict=True):
        assert abs(c.value - value) < 0.1 * error
        assert c.std == pytest.approx(error, rel=0.2)


def test_rows_that_are_no_ticks_are_refused_in_one_line():
    log = log_of(commands(200, 3))
    for times in (1.3, 0.5):
        other = hc.Log("cart", times * log.time, dict(log.columns))
        with pytest.raises(
            InputError, match=f"whole periods of the model apart, 0.05 s, found {times * T:g} s"
        ):
            hc.identify(cart(), [other])


def lag(h, tau):
    y, u = hc.Signal("y", "V"), hc.Signal("u", "V")
    h, tau, k = hc.Signal("h", "s", start=h), hc.Signal("tau", "s", start=tau), hc.Signal("k", "1", start=1.0)
    step = (1 - sp.exp(-h.symbol / tau.symbol)) * (k.symbol * u.symbol - y.symbol)
    return hc.Block("lag", [y], [u], [y], [h, tau, k], {"y": y.symbol + step}, period=1.0)


def lagging(n=400):
    u = commands(n, 5)
    y = opened(u, 1 - np.exp(-1 / 4.0), 2 * (1 - np.exp(-1 / 4.0)))
    return hc.Log("lag", np.arange(n), {"y": y + 0.01 * np.random.default_rng(6).normal(size=n), "u": u})


def assert_lag(found):
    for name, true in (("tau", 4.0), ("k", 2.0)):
        assert abs(found[name].value - true) < 4.0 * found[name].std < 0.05 * true


def test_a_fit_does_not_depend_on_an_earlier_one_whose_time_constant_began_at_the_period():
    hc.identify(lag(1.0, 1.0), [lagging()], ["k"], fixed=["tau"])
    assert_lag(hc.identify(lag(1.0, 3.0), [lagging()], fixed=["h"]))


def test_of_two_times_with_the_value_of_the_period_the_user_says_which_it_is():
    for call in (hc.identify, hc.diagnose):
        with pytest.raises(
            InputError, match=r"lag: 'h' and 'tau' = 1 s, as the period: fix the one .*\['h'\]"
        ):
            call(lag(1.0, 1.0), [lagging()])
    found = hc.identify(lag(1.0, 1.0), [lagging()], fixed=["h"])
    assert_lag(found)
    assert [(c.name, c.kept) for c in found.kept] == [("h", "the sampling period")]
    assert_lag(hc.identify(lag(1.0, 1.0), [lagging()], ["tau", "k"]))
    assert hc.diagnose(lag(1.0, 1.0), [lagging()], fixed=["h"]).effects == ()


@pytest.mark.slow
def test_a_time_kept_as_the_period_is_said_and_is_fitted_if_named():
    says = "lag: 'tau' = 1 s, as the period: it is kept; fixed=['tau'] confirms it"
    with pytest.warns(UserWarning, match=re.escape(says)):
        hc.identify(lag(0.5, 1.0), [lagging()])
    assert any(says in w for w in hc.diagnose(lag(0.5, 1.0), [lagging()]).warnings)
    assert any(says in w for w in hc.check(lag(0.5, 1.0), [lagging()]).warnings)
    found = hc.identify(lag(0.5, 1.0), [lagging()], ["tau", "k"])
    assert found["tau"].value == pytest.approx(2.0, abs=4 * found["tau"].std)


@pytest.mark.parametrize("hidden", ["nothing", "delay", "dead zone"])
def test_diagnose_names_what_a_sampled_model_lacks(hidden):
    u = commands(900, 7)
    arriving = {
        "nothing": u,
        "delay": np.r_[0.0, 0.0, u[:-2]],
        "dead zone": np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0),
    }[hidden]
    found = hc.diagnose(cart(), [log_of(u, arriving=arriving)])
    names = [e.effect for e in found.effects]
    assert names == {"nothing": [], "delay": ["input_delay"], "dead zone": ["u_deadzone"]}[hidden]
    if found.effects:
        (effect,) = found.effects
        assert effect.value == pytest.approx({"delay": 2 * T, "dead zone": 0.2}[hidden], abs=4 * effect.std)
