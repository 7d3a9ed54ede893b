"""An angle that a sensor gives within one turn runs on; a jump that is no wrap stays."""

import warnings

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.logs.angles import TURN, unwrapped
from hovercontrol.logs.repeated_samples import repeats

STEP, N = 0.005, 3000


def run(seed=0):
    """Angle and speed under held voltages: w' = 20 u - 2 w, solved exactly."""
    rng = np.random.default_rng(seed)
    u, q, w = np.repeat(rng.uniform(-1, 2, N // 100), 100), np.zeros(N), np.zeros(N)
    fade = np.exp(-2.0 * STEP)
    for k in range(N - 1):
        end = 10.0 * u[k]
        q[k + 1] = q[k] + end * STEP + (w[k] - end) * (1.0 - fade) / 2.0
        w[k + 1] = end + (w[k] - end) * fade
    counts = np.round((q + 2e-3 * rng.normal(size=N)) / (TURN / 4000))
    return u, counts * (TURN / 4000)


@pytest.mark.parametrize("low", [0.0, -np.pi, -1.0])
def test_a_wrapped_encoder_gives_the_counts_of_the_unwrapped_one(low):
    _, q = run()
    wrapped = (q - low) % TURN + low
    found, said = unwrapped(hc.Log("a", STEP * np.arange(N), {"q": wrapped}), ["q"])
    times = int((np.abs(np.diff(wrapped)) > np.pi).sum())
    assert f"({times} times): its turns are added" in said[0]
    np.testing.assert_allclose(np.diff(found["q"]), np.diff(q), atol=1e-9)


def test_a_jump_is_no_wrap():
    t = STEP * np.arange(N)
    noise = 1e-3 * np.random.default_rng(1).normal(size=N)
    step = np.where(t < 7.0, 0.1, 5.8) + noise  # a jump of 5.7 rad
    beyond = 4.0 * np.sin(t) + noise  # more than a turn
    spike = np.where(np.arange(N) == 900, 5.0, 1.0) + noise
    assert unwrapped(hc.Log("a", t, {"a": step, "b": beyond, "c": spike}), ["a", "b", "c"])[1] == []


@pytest.mark.slow
def test_a_machine_with_a_wrapped_encoder_and_its_quantised_speed_is_fitted_as_with_a_counting_one():
    q, w, u = hc.Signal("q", "rad"), hc.Signal("w", "rad/s"), hc.Signal("u", "V")
    c, g = hc.Signal("c", "1/s", start=2.2), hc.Signal("g", "rad/s^2/V", start=18.0)
    laws = {"q": w.symbol, "w": g.symbol * u.symbol - c.symbol * w.symbol}
    wheel = hc.Block("wheel", [q, w], [u], [q, w], [c, g], laws)
    volts, angle = run()
    columns = {"w": np.diff(angle, prepend=0.0) / STEP, "u": volts}

    def log(q):
        return hc.Log("wheel", STEP * np.arange(N), {"q": q, **columns})

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        counted = hc.identify(wheel, [log(angle)])
    with pytest.warns(UserWarning, match="column 'q' wraps at 6.28 rad"):
        found = hc.identify(wheel, [log(angle % TURN)])
    for name, value in (("c", 2.0), ("g", 20.0)):
        assert found[name].value == pytest.approx(counted[name].value, rel=1e-9)
        assert abs(found[name].value - value) < 4.0 * found[name].std


def test_equal_speeds_of_an_encoder_are_measurements():
    _, angle = run()
    speed = np.diff(angle, prepend=0.0) / STEP  # a difference of counts: equal but for rounding
    assert not repeats(hc.Log("a", STEP * np.arange(N), {"w": speed}), ["w"]).any()
    slow = np.repeat(speed[::2] + 0.01 * np.random.default_rng(2).normal(size=N // 2), 2)
    assert repeats(hc.Log("a", STEP * np.arange(N), {"w": slow}), ["w"]).sum() > 0.9 * N / 2
