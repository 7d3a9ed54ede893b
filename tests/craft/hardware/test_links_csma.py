"""Medium access with random backoff: every draw counted out, exact means, and what a link makes of it."""

import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.links import Csma, bluetooth_delays, empirical_delay, lossy_link

Y = Signal("y", "m")


def counted(window, attempts, busy):
    """Return the shares of all messages by their backoff in bytes, and that given up, draw by draw."""
    sent, given_up, mean = {}, Fraction(0), Fraction(0)
    draw, used = Fraction(1, window), Fraction(busy)
    for waits in itertools.product(range(1, window + 1), repeat=attempts):
        for heard in itertools.product((True, False), repeat=attempts):
            share = draw**attempts
            for one in heard:
                share *= used if one else 1 - used
            first = heard.index(False) if False in heard else None
            spent = sum(waits[: attempts if first is None else first + 1])
            mean += share * spent
            if first is None:
                given_up += share
            else:
                sent[spent] = sent.get(spent, Fraction(0)) + share
    return sent, given_up, mean


@pytest.mark.parametrize(("window", "attempts"), [(3, 3), (5, 2), (2, 5), (4, 1)])
@pytest.mark.parametrize("busy", ["0", "1/4", "2/3", "1"])
def test_mean_and_distribution_are_those_of_all_draws_counted_out(window, attempts, busy):
    sent, given_up, mean = counted(window, attempts, busy)
    access = Csma(busy=float(Fraction(busy)), window=window, byte=0.5, attempts=attempts)
    seconds, probability = access.distribution()
    assert seconds == pytest.approx(0.5 * np.arange(window * attempts + 1))
    assert probability == pytest.approx([float(sent.get(k, 0)) for k in range(len(seconds))], abs=1e-14)
    assert access.given_up == pytest.approx(float(given_up)) and access.mean == pytest.approx(
        0.5 * float(mean)
    )
    assert probability.sum() == pytest.approx(1 - access.given_up)


@given(st.floats(0, 1), st.integers(1, 64), st.integers(1, 10))
def test_the_closed_mean_is_that_of_the_distribution(busy, window, attempts):
    access = Csma(busy=busy, window=window, attempts=attempts)
    seconds, probability = access.distribution()
    all_waits = attempts * access.byte * (window + 1) / 2  # the mean of those given up
    assert access.mean == pytest.approx(seconds @ probability + access.given_up * all_waits, rel=1e-9)
    assert access.most == pytest.approx(seconds[-1])


def test_k06s_beacons_wait_one_to_sixty_four_bytes_each_as_often():
    seconds, probability = Csma(busy=0.0, attempts=1).distribution()
    assert probability[1:] == pytest.approx(1 / 64) and probability[0] == 0
    assert 1000 * seconds[1] == pytest.approx(0.4167, abs=1e-3)  # a byte at 19.2 kbit/s


def waits(link, count, params=None):
    """Return how many ticks each of some messages is under way, and how many are lost."""
    told = replace(link, outputs=(*link.outputs, Signal("link_wait")))
    run = Ticking(told, params)
    seen = [run.tick(0.001 * k, {"y": 0.0}) for k in range(count)]
    return np.array([row["link_wait"] for row in seen]), seen[-1]["link_lost"]


def test_a_link_draws_its_waits_from_that_distribution():
    access = Csma(busy=0.5, window=6, byte=0.001, attempts=3)  # a byte is a tick: nothing is rounded
    n = 6000
    link = lossy_link([Y], 0.0, 0.001, access=access)
    drawn, lost = waits(link, n)
    _, probability = access.distribution()
    # All that are under way, with those given up, who wait for the sum of three backoffs.
    given_up = np.convolve(np.convolve(*[np.r_[0, np.full(6, 1 / 6)]] * 2), np.r_[0, np.full(6, 1 / 6)])
    expected = n * (probability + access.given_up * given_up)
    found = np.bincount(drawn.astype(int), minlength=len(expected))
    there = expected > 0
    assert found[~there].sum() == 0 and expected[there].min() > 5
    assert chisquare(found[there], expected[there]).pvalue > 1e-3
    assert lost == pytest.approx(n * access.given_up, abs=4 * np.sqrt(n * 0.125 * 0.875))
    assert 0.001 * drawn.mean() == pytest.approx(access.mean, rel=0.03)


def test_busy_is_a_parameter_and_the_delay_comes_on_top():
    access = Csma(busy=0.0, window=4, byte=0.001, attempts=2)
    link = empirical_delay([Y], 0.005, 0.001, access=access)
    drawn, lost = waits(link, 500)
    assert (drawn.min(), drawn.max(), lost) == (6, 9, 0)
    drawn, lost = waits(link, 500, {"link.busy": 1.0})
    assert (drawn.min(), drawn.max(), lost) == (7, 13, 500)
    without, _ = waits(link, 500, {"link.delay_scale": 0.0})
    assert without.max() == 0


@pytest.mark.slow
def test_no_message_falls_out_of_the_register_however_long_it_waits():
    access = Csma(busy=0.7, window=8, byte=0.002, attempts=4)
    link = lossy_link([Y], 0.3, 0.004, delays=bluetooth_delays("linksys_22.0_uplink"), access=access,
                      retransmissions=1, timeout=0.01)  # fmt: skip
    run = Ticking(link)
    seen = [run.tick(0.001 * k, {"y": 0.0}) for k in range(3000)]
    last = seen[-1]
    under_way = last["link_messages"] - last["link_delivered"] - last["link_stale"] - last["link_lost"]
    assert 0 <= under_way <= 60 and last["link_lost"] > 200
    assert all(row["link_age"] >= 0 for row in seen)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"busy": 1.5}, "busy must be a probability, found 1.5"),
        ({"busy": 0.1, "window": 0}, "window must be a whole number"),
        ({"busy": 0.1, "attempts": 2.5}, "attempts: expected a whole number"),
        ({"busy": 0.1, "byte": 0.0}, "byte"),
        ({"busy": "often"}, "busy"),
    ],
)
def test_wrong_numbers_are_refused_in_one_line(wrong, text):
    with pytest.raises(InputError, match=text) as refused:
        Csma(**wrong)
    assert "\n" not in str(refused.value)
