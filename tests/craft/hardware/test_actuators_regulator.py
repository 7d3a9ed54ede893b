"""The PI regulator of a fan's speed: it holds while the battery empties and does not wind up."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.craft.hardware.actuators import battery_fan, speed_regulator
from hovercontrol.craft.hardware.actuators.regulator import DUTY
from hovercontrol.craft.hardware.actuators.signals import FAN_SPEED_SET, RPM

LOOP = interconnect(
    [battery_fan(sag=0.002), speed_regulator()], "lift", outputs=["fan_speed", "duty"]
).compile()
TIME = np.arange(0.0, 100.0, 0.02)


def speeds(told):
    run = LOOP.simulate(TIME, [np.asarray(told, dtype=float) * RPM * np.ones_like(TIME)])
    speed, duty = np.asarray(run.outputs)
    return speed / RPM, duty


def test_it_holds_the_speed_while_the_battery_loses_a_fifth():
    speed, duty = speeds(8000.0)
    assert np.abs(speed[TIME > 2.0] - 8000.0).max() < 10.0
    assert duty[-1] / duty[TIME.searchsorted(5.0)] == pytest.approx((1 - 0.01) / (1 - 0.2), rel=0.01)
    alone = interconnect([battery_fan(sag=0.002), constant_duty(8000 / 12000)], "alone").compile()
    assert np.asarray(alone.simulate([0.0, 100.0]).states)[0, -1] / RPM == pytest.approx(6400.0, rel=0.01)


def constant_duty(value):
    return Block("duty", outputs=(DUTY,), output_expressions={"duty": value})


def test_it_follows_with_the_time_constant_that_is_asked_for():
    speed, _ = speeds(6000.0)
    assert speed[TIME.searchsorted(0.2)] == pytest.approx(6000.0 * (1 - np.exp(-1)), rel=0.1)
    assert speed.max() < 6000.0 * 1.02


def test_at_its_limit_it_does_not_wind_up():
    told = np.where(TIME < 50.0, 20_000.0, 5000.0)  # more than the fan can do, then less
    speed, duty = speeds(told)
    assert duty[TIME.searchsorted(49.0)] == 1.0
    assert np.abs(speed[(TIME > 52.0)] - 5000.0).max() < 10.0


def test_wrong_numbers_are_refused():
    with pytest.raises(InputError, match="speed_regulator: settling must be positive, found 0"):
        speed_regulator(settling=0.0)
    with pytest.raises(InputError, match="battery_fan: sag must not be negative, found"):
        battery_fan(sag=-0.1)
    assert [s.name for s in LOOP.block.inputs] == [FAN_SPEED_SET.name]
