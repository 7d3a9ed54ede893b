"""A sender that is switched off, and a craft that notices."""

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.links import lossy_link
from hovercontrol.craft.hardware.links.failsafe import failsafe

THRUST, SERVO = Signal("thrust", "N"), Signal("servo", "s", start=0.0015)
ON = Signal("on", "1", modes=("off", "on"))


def sent(gates, **more):
    link = Ticking(lossy_link([THRUST], 0.0, 0.004, delays=0.002, gate=ON, **more))
    return [link.tick(0.001 * k, {"thrust": float(k), "on": on}) for k, on in enumerate(gates)]


def test_an_open_gate_changes_nothing():
    plain = Ticking(lossy_link([THRUST], 0.0, 0.004, delays=0.002))
    for k, row in enumerate(sent([1.0] * 40)):
        assert row == plain.tick(0.001 * k, {"thrust": float(k)})


def test_what_is_due_while_the_gate_is_closed_is_not_sent_and_the_schedule_stays():
    gates = [1.0] * 9 + [0.0] * 10 + [1.0] * 11  # closed from 9 to 18 ms: 12 and 16 ms are due
    seen = sent(gates)
    assert seen[-1]["link_messages"] == 6 and seen[-1]["link_lost"] == 0  # 0, 4, 8, 20, 24, 28 ms
    assert [row["thrust_received"] for row in seen[10:23]] == [8.0] * 12 + [20.0]
    assert seen[21]["link_age"] == pytest.approx(0.013) and seen[22]["link_age"] == pytest.approx(0.002)


def test_a_craft_goes_to_rest_when_its_commands_are_too_old_and_flies_on_when_they_come_again():
    link = lossy_link([THRUST, SERVO], 0.0, 0.004, delays=0.002, gate=ON, suffix="_heard")
    ends = failsafe([THRUST, SERVO], "link_age", timeout=0.01)
    whole = Ticking(interconnect([link, ends], "whole"))
    gates = [1.0] * 9 + [0.0] * 20 + [1.0] * 11
    seen = [whole.tick(0.001 * k, {"thrust": 1.0, "servo": 0.002, "on": on}) for k, on in enumerate(gates)]
    stopped = [k for k, row in enumerate(seen) if row["failsafe_on"]]
    assert stopped == list(range(18, 34))  # the last was sent at 8 ms, the next at 32 ms
    for k, row in enumerate(seen[2:], 2):
        wanted = (0.0, 0.0015) if k in stopped else (1.0, 0.002)
        assert (row["thrust_received"], row["servo_received"]) == wanted, k


def test_a_failsafe_wants_a_time_and_signals():
    with pytest.raises(InputError, match="timeout"):
        failsafe([THRUST], "age", timeout=0.0)
    with pytest.raises(InputError, match="different names"):
        failsafe([], "age")
