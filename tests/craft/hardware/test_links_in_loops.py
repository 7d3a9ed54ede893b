"""Links in loops: K06's loop that no law holds once a^2 p exceeds 1 (section 5.3.3), and a round trip."""

import numpy as np
import pytest

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.analysis.packet_loss import PacketLoop
from hovercontrol.craft.hardware.links import (
    BoundedDelays,
    bluetooth_delays,
    constant_delay,
    empirical_delay,
    lossy_link,
)
from tests.blocks.simulation.loops import run_loop

Y = Signal("y")
RUNS = 20_000


def loop(a, link, steps, noise=0.0, x0=1.0):
    """Return x of K06 (5.2)-(5.3), shape (steps + 1, RUNS): u = -a x if the link told x in time, else 0."""
    following, outputs = numpy_functions(link).array_derivatives, numpy_functions(link).array_outputs
    state = [np.full(RUNS, s.start) for s in link.states]
    values = link.default_parameters | {"link.seed": np.arange(RUNS, dtype=float)}
    p, names = tuple(values.values()), [s.name for s in link.outputs]
    random, x, ticks = np.random.default_rng(1), [np.full(RUNS, x0)], round(0.02 / link.period)
    for _ in range(steps):
        for _ in range(ticks):
            told = dict(zip(names, outputs(0.0, state, [x[-1]], p), strict=True))
            state = [np.broadcast_to(v, RUNS) for v in following(0.0, state, [x[-1]], p)]
        known = told["link_age"] < 0.02 - 1e-9  # of this sample, when the next one is due
        u = np.where(known, -a * told["y_received"], 0.0)
        x.append(a * x[-1] + u + noise * random.normal(size=RUNS))
    return np.array(x)


def k06_loop(a):
    return PacketLoop(np.zeros((1, 1, 1)), np.full((1, 1, 1), a))


@pytest.mark.parametrize(("a", "p"), [(1.5, 0.6), (1.2, 0.6)])
def test_the_mean_square_grows_by_a_squared_p(a, p):
    x = loop(a, lossy_link([Y], p, 0.02, tick=0.02), 5)
    for k in range(1, 6):  # x(k) = a^k if every packet so far is lost, else 0
        spread = np.sqrt((1 - p**k) / (p**k * RUNS))
        assert np.mean(x[k] ** 2) == pytest.approx(k06_loop(a).growth(p) ** k, rel=5 * spread)
    assert (np.mean(x[5] ** 2) > 1) == (p > k06_loop(a).critical) == (a**2 * p > 1)


def test_below_the_limit_the_mean_square_settles():
    a, p = 1.2, 0.4
    x = loop(a, lossy_link([Y], p, 0.02, tick=0.02), 40, noise=1.0)
    # x(k+1) = a x + d if lost, d if not: E x^2 = a^2 p E x^2 + 1
    assert np.mean(x[20:] ** 2) == pytest.approx(1 / (1 - a**2 * p), rel=0.03)


def test_a_retransmission_within_the_sample_time_squares_the_probability():
    a, p = 1.6, 0.5
    assert a**2 * p > 1 > a**2 * p**2
    once = loop(a, lossy_link([Y], p, 0.02, tick=0.005), 4)
    again = loop(a, lossy_link([Y], p, 0.02, tick=0.005, retransmissions=1, timeout=0.01), 4)
    late = loop(a, lossy_link([Y], p, 0.02, tick=0.005, retransmissions=1, timeout=0.02), 4)
    for x, q in ((once, p), (again, p**2), (late, p)):  # what comes after the next sample is of no use
        spread = np.sqrt((1 - q**4) / (q**4 * RUNS))
        assert np.mean(x[4] ** 2) == pytest.approx(k06_loop(a).growth(q) ** 4, rel=5 * spread)


@pytest.mark.slow
def test_a_round_trip_takes_what_both_links_take():
    clock = Signal("clock", "s")
    plant = Block("plant", [clock], [], [clock], derivatives={"clock": 1})
    down = empirical_delay([clock], bluetooth_delays("linksys_22.0_downlink"), 0.0065536, name="downlink")
    up = empirical_delay(
        [clock.replace(name="clock_received")], bluetooth_delays("linksys_22.0_uplink"), 0.02, name="uplink"
    )
    run = run_loop(plant, [down, up], 1.5)
    late = (run.time - run.outputs[run.output_labels.index("clock_received_received")])[200:]
    age = run.outputs[run.output_labels.index("uplink_age")][200:]
    assert late.min() >= 0.019 + 0.022 - 1e-9  # the least of both
    assert (late - age).max() <= 0.067 + 0.0065536 + 0.001  # the downlink's most, and until its next message
    assert age.max() <= 0.09 + 0.02


def test_a_varying_delay_of_no_spread_is_a_constant_one():
    line, link = (
        Ticking(constant_delay([Y], 0.03, 0.01)),
        Ticking(empirical_delay([Y], 0.03, 0.01, tick=0.01)),
    )
    drawn = BoundedDelays(0.03, 0.005, 0.02, 0.05)
    calm = Ticking(empirical_delay([Y], drawn, 0.01, tick=0.01), {"link.jitter": 0.0})
    for k in range(20):
        told = [run.tick(0.01 * k, {"y": float(k**2)}) for run in (line, link, calm)]
        for key in ("y_received", "link_age"):
            assert told[0][key] == pytest.approx(told[1][key]) == pytest.approx(told[2][key])
