"""Delay lines: what comes in comes out later, unchanged, and K06's two chains."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.links import constant_delay, k06_downlink, k06_uplink

THRUST, RUDDER = Signal("thrust", "N", start=0.5), Signal("rudder", "rad")
values = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=12)


@settings(max_examples=10, deadline=None)
@given(values, st.integers(0, 5))
def test_a_chain_of_n_unit_delays_shifts_by_n_ticks(sent, n):
    link = Ticking(constant_delay([THRUST, RUDDER], n * 0.02, 0.02))
    for k, value in enumerate(sent):
        told = link.tick(0.02 * k, {"thrust": value, "rudder": -value})
        assert told["thrust_received"] == (sent[k - n] if k >= n else THRUST.start)
        assert told["rudder_received"] == (-sent[k - n] if k >= n else 0.0)
        assert told["link_age"] == pytest.approx(0.02 * min(k, n))


def test_k06_delays_its_telemetry_by_36_ms_and_its_commands_by_40_ms():
    for make, period, stages in ((k06_downlink, 0.006, 6), (k06_uplink, 0.02, 2)):
        link = make([THRUST])
        assert link.period == period
        run = Ticking(link)
        seen = [run.tick(k * period, {"thrust": 7.0})["thrust_received"] for k in range(10)]
        assert seen.index(7.0) == stages
    # FACTS section 5: close to the means of table 5.1, 34.32 and 40.81 ms
    assert math.isclose(0.036, 0.03432, rel_tol=0.05) and math.isclose(0.04, 0.04081, rel_tol=0.05)


@pytest.mark.parametrize(
    ("delay", "period", "line"),
    [
        (0.035, 0.006, "nearest are 0.03 s and 0.036 s"),
        (0.001, 0.02, "nearest are 0 s and 0.02 s"),
        (-0.02, 0.02, "must not be negative, found -0.02"),
        (math.inf, 0.02, "must not be negative"),
        (math.nan, 0.02, "must be a number"),
        (0.02, 0.0, "period must be positive"),
        (0.02, -1.0, "period must be positive"),
    ],
)
def test_a_wrong_delay_is_refused_in_one_line(delay, period, line):
    with pytest.raises(InputError, match=line) as caught:
        constant_delay([THRUST], delay, period)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("signals", [[], [THRUST, THRUST], THRUST, "thrust", ["thrust"]])
def test_signals_must_be_a_list_of_different_signals(signals):
    with pytest.raises(InputError, match=r"link: |signals.*: expected a"):
        constant_delay(signals, 0.02, 0.02)


def test_an_output_needs_a_name_of_its_own():
    with pytest.raises(InputError, match="suffix"):
        constant_delay([THRUST], 0.02, 0.02, suffix="")
