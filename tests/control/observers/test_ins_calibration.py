"""Calibration at rest: what it stores is what a craft at rest measures, and the filters begin anew."""

import math

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers.ins import aided_ins
from hovercontrol.control.observers.ins.calibration import CALIBRATED, rest_calibration, restartable
from hovercontrol.craft.hardware.sensors.platform import tilted_platform

GRAVITY = 9.80665
PERIOD = 0.01


def calibrated(readings, orders, seconds=0.5):
    run = Ticking(rest_calibration(seconds=seconds, period=PERIOD))
    names = ("acceleration_x_raw", "acceleration_y_raw", "yaw_rate_raw")
    return [
        run.tick(PERIOD * k, {**dict(zip(names, row, strict=True)), "calibrate": float(order)})
        for k, (row, order) in enumerate(zip(readings, orders, strict=True))
    ]


def test_the_mean_over_the_time_is_stored_and_taken_off_from_then_on():
    readings = np.random.default_rng(1).normal([0.2, -0.3, 0.05], 0.1, size=(120, 3))
    seen = calibrated(readings, [k >= 20 for k in range(120)])
    mean = readings[20:70].mean(axis=0)
    assert [row["calibrating"] for row in seen] == [0] * 20 + [1] * 50 + [0] * 50
    assert [k for k, row in enumerate(seen) if row["calibrated"]] == [69]
    for k, row in enumerate(seen):
        off = mean if k >= 69 else np.zeros(3)
        told = [row["acceleration_x"], row["acceleration_y"], row["yaw_rate"]]
        assert told == pytest.approx(readings[k] - off, abs=1e-12), k
    assert seen[-1]["platform_pitch"] == pytest.approx(math.asin(mean[0] / GRAVITY))
    assert seen[-1]["gyro_offset"] == pytest.approx(mean[2])


@pytest.mark.parametrize(("roll", "pitch"), [(0.05, 0.0), (0.0, -0.03), (-0.2, 0.25)])
def test_it_finds_the_tilt_of_the_platform(roll, pitch):
    felt = tilted_platform(roll=roll, pitch=pitch).to_numpy().outputs(0.0, (), [0.0, 0.0])
    # Gravity in the axes of a body turned by the usual yaw-pitch-roll angles (Fossen 2.18), y to the left.
    level = GRAVITY * np.array([math.sin(pitch), math.cos(pitch) * math.sin(roll)])
    assert felt == pytest.approx(level)
    seen = calibrated(np.tile([*felt, 0.0], (60, 1)), [k > 0 for k in range(60)])[-1]
    assert (seen["platform_roll"], seen["platform_pitch"]) == pytest.approx((roll, pitch), abs=1e-12)
    assert (seen["acceleration_x"], seen["acceleration_y"]) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_it_can_be_repeated_and_an_order_meanwhile_does_not_disturb_it():
    readings = [[0.1, 0.0, 0.0]] * 100 + [[0.4, 0.0, 0.0]] * 100
    orders = [0.0] * 10 + [1.0] * 5 + [2.0] * 105 + [3.0] * 80
    seen = calibrated(readings, orders)
    assert [k for k, row in enumerate(seen) if row["calibrated"]] == [59, 169]
    assert seen[-1]["acceleration_x"] == pytest.approx(0.0, abs=1e-12)


def test_a_block_that_restarts_repeats_what_it_did_at_first():
    filters = restartable(aided_ins(), CALIBRATED)
    inputs = [s.name for s in filters.inputs if s.name != CALIBRATED.name]
    given = np.random.default_rng(2).normal(size=(30, len(inputs)))
    run, seen = Ticking(filters), []
    for k in range(60):
        signals = dict(zip(inputs, given[k % 30], strict=True))
        seen.append(run.tick(0.0065536 * k, {**signals, CALIBRATED.name: float(k == 30)}))
    assert seen[:30] == seen[30:]
    plain = Ticking(aided_ins())
    for k in range(30):
        told = plain.tick(0.0065536 * k, dict(zip(inputs, given[k], strict=True)))
        assert told == pytest.approx(seen[k], rel=1e-12)


def test_what_cannot_restart_is_refused():
    n = Signal("n")
    counter = Block("counter", [n], [], [n], derivatives={"n": n.symbol + 1}, period=0.1)
    with pytest.raises(InputError, match="no state 'm'"):
        restartable(counter, CALIBRATED, {"m": n.symbol})
    flowing = Block(
        "flowing",
        [n],
        [],
        [n],
        derivatives={"n": Signal("k", "1/s").symbol * n.symbol},
        parameters=[Signal("k", "1/s")],
    )
    with pytest.raises(InputError, match="not sampled"):
        restartable(flowing, CALIBRATED)
    with pytest.raises(InputError, match="seconds"):
        rest_calibration(seconds=0.0)
