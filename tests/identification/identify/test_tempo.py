"""The same machine, a million times faster or slower, has the same results: no length is in seconds."""

import numpy as np
import pytest
from scipy.linalg import expm

import hovercontrol as hc

N, STEP = 1200, 0.01
RATES = {"a": 20.0, "b": 10.0, "c": 20.0, "d": 2.8, "e": 1.0}


def motor(slower):
    i, w, u = hc.Signal("i", "A"), hc.Signal("w", "V"), hc.Signal("u", "V")
    units = {"a": "1/s", "b": "A/s/V", "c": "A/s/V", "d": "V/s/A", "e": "1/s"}
    given = {k: hc.Signal(k, unit, start=0.95 * RATES[k] / slower) for k, unit in units.items()}
    a, b, c, d, e = (s.symbol for s in given.values())
    laws = {"i": c * u.symbol - a * i.symbol - b * w.symbol, "w": d * i.symbol - e * w.symbol}
    return hc.Block("motor", [i, w], [u], [i, w], list(given.values()), laws)


def log_of(slower, seed=0, deadzone=0.0, n=N):
    """Exact for held voltages: x+ = exp(F h) x + integral of exp(F s) B u."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-3, 3, n // 20 + 1), 20)[:n]
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[:2, 2] = [[-20.0, -10.0], [2.8, -1.0]], [20.0, 0.0]
    step = expm(whole * STEP)
    x, found = np.zeros(2), np.empty((n, 2))
    for k, command in enumerate(u):
        found[k] = x
        x = step[:2, :2] @ x + step[:2, 2] * np.sign(command) * max(abs(command) - deadzone, 0.0)
    found += 0.01 * rng.normal(size=found.shape)
    return hc.Log("motor", slower * STEP * np.arange(n), {"i": found[:, 0], "w": found[:, 1], "u": u})


@pytest.mark.slow
@pytest.mark.parametrize("slower", [1e-4, 1e5])
def test_coefficients_and_errors_scale_with_time(slower):
    one, other = (hc.identify(motor(s), [log_of(s)]) for s in (1.0, slower))
    for c in one.coefficients:
        assert abs(c.value - RATES[c.name]) < 4.0 * c.std
        assert other[c.name].value * slower == pytest.approx(c.value, rel=1e-6)
        assert other[c.name].std * slower == pytest.approx(c.std, rel=1e-4)


def test_a_check_of_days_or_microseconds_finds_no_fault():
    for slower in (1e-4, 1e7):
        found = hc.check(motor(slower), [log_of(slower)])
        assert not found.errors and not found.warnings and not found.negative


def test_fifteen_hundredths_of_a_second_are_enough_at_ten_kilohertz():
    found = hc.identify(motor(0.01), [log_of(0.01, n=1500)])
    assert all(abs(0.01 * c.value - RATES[c.name]) < 4.0 * 0.01 * c.std for c in found.coefficients)


@pytest.mark.slow
@pytest.mark.parametrize("slower", [1e-4, 1e5])
def test_the_diagnosis_is_the_same(slower):
    one, other = (
        hc.diagnose(motor(s), [log_of(s, deadzone=0.5)], log_of(s, seed=1, deadzone=0.5))
        for s in (1.0, slower)
    )
    assert one.verdict == other.verdict == "effect"
    assert [e.effect for e in one.effects] == [e.effect for e in other.effects] == ["u_deadzone"]
    assert other.effects[0].value == pytest.approx(one.effects[0].value, rel=1e-4)


@pytest.mark.parametrize("times", [1e-4, 1e5])
def test_the_period_of_a_sampled_model_may_be_microseconds_or_hours(times):
    y, u, a = hc.Signal("y", "V"), hc.Signal("u", "V"), hc.Signal("a", "1", start=0.2)
    rng = np.random.default_rng(5)
    sent, out = np.repeat(rng.uniform(-1, 1, 40), 15), np.zeros(600)
    for k in range(599):
        out[k + 1] = 0.92 * out[k] + 0.08 * sent[k]
    out += 1e-3 * rng.normal(size=600)

    def found(period):
        steps = {"y": (1 - a.symbol) * y.symbol + a.symbol * u.symbol}
        block = hc.Block("filter", [y], [u], [y], [a], steps, period=period)
        return hc.identify(block, [hc.Log("filter", period * np.arange(600), {"y": out, "u": sent})])["a"]

    one, other = found(0.05), found(0.05 * times)
    assert one.value == pytest.approx(0.08, abs=4 * one.std)
    assert other.value == pytest.approx(one.value, rel=1e-6)
    assert other.std == pytest.approx(one.std, rel=1e-4)
