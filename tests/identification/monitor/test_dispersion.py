"""Noise that is not white or not normal: the rate of false alarms and the dispersion of the scores."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.identification.monitor.dispersion import dispersion_of, divided
from hovercontrol.identification.monitor.threshold import signatures_of

PERIOD, DRAG, MASS, NOISE, PUSH = 0.1, 0.5, 2.0, 0.02, 0.02
KEEP = np.exp(-DRAG * PERIOD)


def monitored(**others):
    """A cart with a speed sensor, v' = F/m - c v, and its monitor."""
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "N")
    m, c = hc.Signal("m", "kg", start=MASS), hc.Signal("c", "1/s", start=DRAG)
    cart = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
    return hc.monitor(
        cart, ["c", "m", "v_bias"], period=PERIOD, measured=["v"],
        process_noise={"v": PUSH}, measurement_noise={"v": NOISE}, **others,
    )  # fmt: skip


def log(ticks, noise, seed):
    """The cart in exact steps under process noise, with noise of the sensor in units of NOISE."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(ticks)
    F = 2.0 * np.sign(np.sin(0.9 * t + 0.1))
    w = PUSH * np.sqrt((1 - KEEP**2) / (2 * DRAG)) * rng.normal(size=ticks)
    drive = np.concatenate([[0.0], ((1 - KEEP) / DRAG * F / MASS + w)[:-1]])
    return hc.Log("run", t, {"v": lfilter([1.0], [1.0, -KEEP], drive) + NOISE * noise(rng, ticks), "F": F})


def heavy(rng, n):
    """Student's t with 5 degrees of freedom; their variance is 5/3."""
    return rng.standard_t(5.0, size=n) / np.sqrt(5.0 / 3.0)


def slow(rng, n):
    """White noise of unit variance and a first-order process of 2 s with nine times the variance."""
    keep = np.exp(-PERIOD / 2.0)
    e = rng.normal(size=(2, n))
    return e[0] + 3.0 * lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], e[1])


def false_alarms(watch, run):
    """The number of alarms along a log, each followed by a reset."""
    alarm, count, reset = hc.Signal("alarm"), hc.Signal("alarms"), hc.Signal("reset")
    following = {"alarms": count.symbol + alarm.symbol}
    counter = hc.Block(
        "counter", [count], [alarm], [count, reset], [], following, {"reset": alarm.symbol}, period=PERIOD
    )
    loop = hc.interconnect([watch, counter], outputs=["alarms"])
    return float(np.ravel(loop.compile().simulate(run.time, run.columns).outputs)[-1])


@pytest.mark.slow("-0.4")
@pytest.mark.parametrize("correlation", [-0.4, 0.6])
def test_the_dispersion_is_the_variance_of_the_scores_of_correlated_noise(correlation):
    """e is a first-order process of variance 1/4, so that no value is limited: var b = 1' C 1/4, J = n."""
    K, first, W = 12_000, 4, 2
    found = signatures_of(np.ones((K, W, 1, 1)), first)
    rng = np.random.default_rng(7)
    e = lfilter([np.sqrt(1 - correlation**2)], [1.0, -correlation], 0.5 * rng.normal(size=K))
    ages = (found.information[K // 2 : K // 2 + first * 2 ** (W - 1), :, 0]).astype(int)  # one whole cycle
    lags = np.arange(ages.max())
    share = {
        n: ((n - lags[:n]) * correlation ** lags[:n] * np.where(lags[:n] == 0, 1, 2)).sum() / n
        for n in set(ages.ravel())
    }
    expected = np.mean([[share[n] for n in row] for row in ages]) / 4
    scale = 6.0  # phi is at least 1
    assert dispersion_of(found, scale * e[:, None]) == pytest.approx(scale**2 * expected, rel=0.1)
    assert dispersion_of(found, 0.1 * e[:, None]) == 1.0


def test_divided_scores_have_the_variance_of_their_information():
    found = signatures_of(np.ones((4000, 3, 2, 1)), 4)
    e = 2.0 * np.random.default_rng(3).normal(size=(4000, 1))
    phi = dispersion_of(found, e)
    assert dispersion_of(divided(found, phi), e / np.sqrt(phi[0])) == pytest.approx(1.0)


@pytest.mark.slow
def test_dispersion_divides_the_evidence():
    run = log(600, slow, 1)
    watch = monitored(false_alarms_per_hour=1.0, motion=run, dispersion=True)
    phi = {c: float(watch.parameter(f"dispersion_{c}").start) for c in ("c", "m", "v_bias")}
    assert min(phi.values()) > 1.0
    plain = {f"monitor.dispersion_{c}": 1.0 for c in phi}
    plain |= {f"monitor.floor_{c}": float(watch.parameter(f"floor_{c}").start) * v for c, v in phi.items()}
    told = []
    for params in ({}, plain):
        ticking = Ticking(watch, {"monitor.threshold": 1e9, **params})
        for k in range(300):
            row = ticking.tick(PERIOD * k, {"v": run["v"][k], "F": run["F"][k], "reset": 0.0})
        told.append(row)
    for c, value in phi.items():
        assert told[1][f"evidence_{c}"] / told[0][f"evidence_{c}"] == pytest.approx(value)


def test_dispersion_needs_a_log():
    with pytest.raises(InputError, match="dispersion=True needs a measured log as motion"):
        monitored(false_alarms_per_hour=1.0, dispersion=True)


@pytest.mark.slow
def test_heavy_tailed_noise_raises_no_more_false_alarms_than_wanted():
    """Innovations that are not limited raise three times as many."""
    hours, rate = 10.0, 20.0
    run, sound = log(round(hours * 3600 / PERIOD), heavy, 2), log(6000, heavy, 3)
    alarms = false_alarms(monitored(false_alarms_per_hour=rate, motion=sound, dispersion=True), run)
    assert 0.6 * hours * rate <= alarms <= stats.poisson.ppf(0.995, hours * rate)


@pytest.mark.slow
def test_slow_noise_raises_no_more_false_alarms_than_wanted():
    hours, rate = 4.0, 20.0
    run, sound = log(round(hours * 3600 / PERIOD), slow, 2), log(6000, slow, 3)
    told = {
        dispersion: false_alarms(
            monitored(false_alarms_per_hour=rate, motion=sound, dispersion=dispersion), run
        )
        for dispersion in (False, True)
    }
    assert told[False] > 3 * hours * rate
    assert told[True] <= stats.poisson.ppf(0.995, hours * rate)
