"""Wireless links against a plain event queue: order, age and counts of messages, and table 5.1 once more."""

import heapq
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.links import TABLE_5_1, bluetooth_delays, empirical_delay, lossy_link

Y, Z = Signal("y", "m", start=0.25), Signal("z")
UP, DOWN = bluetooth_delays("linksys_22.0_uplink"), bluetooth_delays("linksys_22.0_downlink")

#: Blocks whose definition ``link_wait`` is an output, too, and their periods [ticks].
LINKS = [
    (replace(link, outputs=(*link.outputs, Signal("link_wait"))), every)
    for link, every in (
        (empirical_delay([Y, Z], UP, 0.02), Fraction(20)),
        (empirical_delay([Y, Z], DOWN, 0.0065536), Fraction(65536, 10000)),
        (empirical_delay([Y, Z], 0.012, 0.005), Fraction(5)),
        (lossy_link([Y, Z], 0.3, 0.004, retransmissions=2, timeout=0.006), Fraction(4)),
        (lossy_link([Y, Z], 0.3, 0.03, delays=DOWN, retransmissions=1, timeout=0.05), Fraction(30)),
    )
]


def event_queue(sent, every, waits, lost, in_order):
    """Return what a receiver with sequence numbers has at each tick: value, tick of sending, what was new."""
    queue, newest, due, latest = [], (-1, Y.start), Fraction(0), 0
    counts = dict.fromkeys(("messages", "delivered", "stale", "lost"), 0)
    for now, value in enumerate(sent):
        if now >= due:
            due += every
            counts["messages"] += 1
            if lost[now]:
                counts["lost"] += 1
            else:
                arrival = max(now + waits[now], latest) if in_order else now + waits[now]
                latest = max(latest, arrival)
                heapq.heappush(queue, (arrival, -now, value))
        while queue and queue[0][0] <= now:
            _, number, value = heapq.heappop(queue)
            if -number > newest[0]:
                newest = (-number, value)
                counts["delivered"] += 1
            else:
                counts["stale"] += 1
        yield newest, dict(counts)


@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from(LINKS),
    st.integers(0, 10**6),
    st.sampled_from([0.0, 0.4, 1.0]),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.floats(0, 1),
    st.booleans(),
)
def test_a_link_is_an_event_queue(made, seed, scale, jitter, loss, in_order):
    link, every = made
    known = {"link.seed": seed, "link.delay_scale": scale, "link.jitter": jitter, "link.loss": loss}
    known["link.in_order"] = float(in_order)
    run = Ticking(link, {k: v for k, v in known.items() if k in link.default_parameters})
    sent = [1.0 + k for k in range(150)]
    told = [run.tick(0.001 * k, {"y": value, "z": -value}) for k, value in enumerate(sent)]
    waits = [row["link_wait"] for row in told]
    lost = np.diff([0, *(row["link_lost"] for row in told)]) > 0
    assert min(waits) >= 0  # nothing arrives before it is sent
    for k, (row, (newest, counts)) in enumerate(
        zip(told, event_queue(sent, every, waits, lost, in_order), strict=True)
    ):
        assert row["y_received"] == newest[1]
        assert row["z_received"] == (-newest[1] if newest[0] >= 0 else Z.start)
        assert row["link_age"] == pytest.approx((k - max(newest[0], 0)) * 0.001)
        assert {key: row[f"link_{key}"] for key in counts} == counts


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=20), st.integers(0, 10**6))
def test_without_delay_and_loss_all_passes_through(sent, seed):
    for link in PASSING:
        off = {"link.delay_scale": 0.0, "link.loss": 0.0, "link.seed": float(seed)}
        run = Ticking(link, {k: v for k, v in off.items() if k in link.default_parameters})
        for k, value in enumerate(sent):
            told = run.tick(0.001 * k, {"y": value, "z": -value})
            assert (told["y_received"], told["z_received"], told["link_age"]) == (value, -value, 0.0)


PASSING = [
    empirical_delay([Y, Z], 0.0, 0.001),
    empirical_delay([Y, Z], 0.004, 0.001),
    empirical_delay([Y, Z], DOWN, 0.02, tick=0.02),
    lossy_link([Y, Z], 0.5, 0.001, retransmissions=3, timeout=0.002),
]


# ---- table 5.1 --------------------------------------------------------------------------------------


def many(link, ticks, sent=lambda k: 1.0, runs=2000, **params):
    """Yield the outputs of runs of different seeds, tick by tick, each shape (n_outputs, runs)."""
    following, outputs = numpy_functions(link).array_derivatives, numpy_functions(link).array_outputs
    x = [np.full(runs, s.start) for s in link.states]
    values = link.default_parameters | {f"link.{k}": v for k, v in params.items()}
    values["link.seed"] = np.arange(runs, dtype=float)
    p, names = tuple(values.values()), [s.name for s in link.outputs]
    for k in range(ticks):
        u = sent(k) if isinstance(sent(k), list) else [np.full(runs, sent(k))] * len(link.inputs)
        told = [np.broadcast_to(value, runs) for value in outputs(k * link.period, x, u, p)]
        x = [np.broadcast_to(value, runs) for value in following(k * link.period, x, u, p)]
        yield dict(zip(names, told, strict=True))


def check_row(name, delays):
    mean, sd, least, most = TABLE_5_1[name]
    n = len(delays)
    assert np.mean(delays) == pytest.approx(mean, abs=5 * sd / math.sqrt(n))
    assert np.std(delays) == pytest.approx(sd, rel=5 / math.sqrt(n))  # kurtosis is below 4
    assert least <= np.min(delays) and np.max(delays) <= most
    assert np.min(delays) <= least + sd / 2  # what can happen does


@pytest.mark.parametrize("name", TABLE_5_1)
def test_drawn_delays_have_the_numbers_of_table_5_1(name):
    link = empirical_delay([Y], bluetooth_delays(name), 0.25)
    link = replace(link, outputs=(*link.outputs, Signal("link_wait")))
    check_row(name, np.concatenate([row["link_wait"] for row in many(link, 10)]))


def test_messages_arrive_that_late():
    link = empirical_delay([Y], UP, 0.1)
    before, seen = np.zeros(2000), []
    for row in many(link, 400):
        fresh = row["link_delivered"] > before
        seen.append(row["link_age"][fresh] * 1000)
        before = row["link_delivered"]
    assert before.max() == 4
    check_row("linksys_22.0_uplink", np.concatenate(seen).round(6))


def test_messages_that_follow_closely_overtake_unless_kept_in_order():
    link = empirical_delay([Y], DOWN, 0.0065536)
    free, kept = (list(many(link, 300, runs=200, in_order=order)) for order in (0.0, 1.0))
    assert free[-1]["link_stale"].mean() > 5
    for early, late in zip(free, kept, strict=True):  # the same delays: order only costs time
        assert (early["link_age"] <= late["link_age"] + 1e-12).all()
    for row in (free[-1], kept[-1]):
        under_way = row["link_messages"] - row["link_delivered"] - row["link_stale"] - row["link_lost"]
        assert (under_way >= 0).all() and (under_way <= 67 / 6.5536 + 1).all()


# ---- loss -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("p", "n"), [(0.0, 2), (0.3, 0), (0.5, 2)])
def test_a_message_is_lost_if_all_its_transmissions_are(p, n):
    link = lossy_link([Y], p, 0.02, retransmissions=n, timeout=0.004)
    rows = list(many(link, 200))
    lost, messages = (np.sum(rows[-1][f"link_{key}"]) for key in ("lost", "messages"))
    share = p ** (n + 1)
    assert messages == 2000 * 10
    assert lost / messages == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / messages) + 1e-12)
    first, before = [], np.zeros(2000)
    for row in rows[:20:4]:  # of the first message, as the next is sent after 20 ms
        first.append(np.sum(row["link_delivered"] > before))
        before = row["link_delivered"]
    assert sum(first[n + 1 :]) == 0
    for k, count in enumerate(first[: n + 1]):  # k retransmissions take k timeouts
        got = p**k * (1 - p)
        assert count / 2000 == pytest.approx(got, abs=5 * math.sqrt(got * (1 - got) / 2000) + 1e-12)


# ---- bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"loss": -0.1}, r"\[0, 1\), found -0.1"),
        ({"loss": 1.0}, r"\[0, 1\), found 1.0"),
        ({"loss": math.nan}, "loss must be a number"),
        ({"period": 0.0}, "period must be positive"),
        ({"tick": -0.001}, "tick must be positive"),
        ({"period": 0.0005}, "must not be shorter than the tick"),
        ({"delays": -0.01}, "delays.* must not be negative"),
        ({"delays": "linksys"}, "delays: expected a Delays or a number, found 'linksys'"),
        ({"retransmissions": -1}, "whole number"),
        ({"retransmissions": 1.5}, "whole number"),
        ({"timeout": -0.1}, "timeout must not be negative"),
        ({"retransmissions": 1}, "timeout must be positive"),
        ({"signals": []}, "signals of different names"),
        ({"suffix": ""}, "give a suffix"),
        ({"seed": -1}, "seed"),
    ],
)
def test_wrong_input_is_refused_in_one_line(wrong, line):
    with pytest.raises(InputError, match=line) as caught:
        lossy_link(**({"signals": [Y], "loss": 0.1, "period": 0.02} | wrong))
    assert "\n" not in str(caught.value)


def test_c_tells_the_same():
    link = lossy_link([Y, Z], 0.3, 0.03, delays=DOWN, retransmissions=1, timeout=0.05)
    native = link.unchecked(period=0.0).compile()  # C evaluates the same rows, whatever they are
    run, random = Ticking(link), np.random.default_rng(0)
    for k in range(120):
        u, x = random.normal(size=2), run.state
        told = run.tick(0.001 * k, {"y": u[0], "z": u[1]})
        assert native.outputs(0.001 * k, x, u) == pytest.approx(list(told.values()), rel=1e-12)
        assert native.derivatives(0.001 * k, x, u) == pytest.approx(run.state, rel=1e-12)
