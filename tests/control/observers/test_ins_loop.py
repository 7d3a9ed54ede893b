"""The filters behind the simulated sensors, on a craft that is driven: C17's, with K06's sensors."""

from functools import cache

import numpy as np
import pytest
import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import rename
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    SensorErrors,
    aided_ins,
    noise_from_sensors,
    range_arrivals,
    range_filter,
)
from hovercontrol.craft.hardware.sensors import (
    arrivals,
    cricket,
    cricket_ranges,
    k06_beacons,
    k06_imu,
    with_specific_force,
)
from hovercontrol.craft.hardware.sensors.cone import K06_CONE
from hovercontrol.craft.hardware.sensors.cricket import K06_UNITS
from hovercontrol.craft.models.vehicles import c17_simulation
from tests.blocks.simulation.loops import run_loop

#: Errors of :func:`k06_imu`; a little noise stands for what the trapezoidal rule leaves out.
ERRORS = SensorErrors(acceleration_noise=(0.02, 0.02), gyro_walk=0.0, acceleration_walk=0.0, heading=0.2)
SECONDS, SLOT = 12.0, 0.1


@cache
def flight():
    """C17's craft pushed to and fro: its outputs at the IMU's ticks."""
    second = Signal("second", "s", start=1.0)
    w = time / second.symbol
    told = {"thrust": 2 * sp.sin(1.1 * w), "rudder": 0.4 * sp.sin(0.7 * w)}
    commands = [Signal("thrust"), Signal("rudder", "rad")]
    pilot = Block("pilot", [], [], commands, [second], {}, told, period=0.05)
    plant = with_specific_force(c17_simulation().plant())
    response = run_loop(plant, pilot, SECONDS, step=IMU_PERIOD)
    return response.time, dict(zip(response.output_labels, response.outputs, strict=True))


def flown(slow, fast):
    """Tick one Block every slot and the others with the IMU, in this order, along the flight."""
    t, truth = flight()
    slow, fast = Ticking(slow), [Ticking(block) for block in fast]
    signals, rows, slot = {}, [], 0
    for k, now in enumerate(t):
        while slot * SLOT <= now:
            there = {name: np.interp(slot * SLOT, t, v) for name, v in truth.items()}
            signals |= slow.tick(slot * SLOT, there)
            slot += 1
        here = signals | {name: v[k] for name, v in truth.items()}
        for block in fast:
            here |= block.tick(now, here)
        signals |= {name: here[name] for block in fast for name in (s.name for s in block.block.outputs)}
        rows.append(here)
    found = {name: np.array([row[name] for row in rows[len(rows) // 2 :]]) for name in rows[-1]}
    return found


def assert_right(found, variances, limits):
    for name, limit in limits.items():
        off = found[f"{name}_hat"] - found[name]
        assert np.sqrt((off**2).mean()) < limit, name
        assert np.mean(off**2 / found[variances[name]]) < 6, name  # within about its own deviation


@pytest.mark.slow
def test_raw_ranges_of_cricket_show_pose_and_heading():
    """Two units in turn, K06's cone-angle error, 45 degrees of hearing; 0.2 rad off at the start."""
    beacons = k06_beacons()
    ranges = cricket_ranges(beacons, noise=0.0035, cone=K06_CONE, cone_limit=np.radians(45), seed=3)
    navigation = range_filter(
        beacons,
        K06_UNITS,
        cone=K06_CONE,
        range_noise=0.0035,
        noise=noise_from_sensors(ERRORS),
        pose=(0.05, -0.05, 0.2),
    )
    found = flown(ranges, [k06_imu(seed=2), range_arrivals(len(beacons.positions)), navigation])
    assert np.ptp(found["psi"]) > 0.3  # it did turn
    variances = {"x": "P[3,3]", "y": "P[4,4]", "psi": "P[0,0]"}
    assert_right(found, variances, {"x": 0.03, "y": 0.03, "psi": 0.1})


@pytest.mark.slow
def test_cricket_aids_k06s_navigation():
    """Fixes of the first unit and the heading of two, once a second, as K06 flew; no latency here."""
    beacons = k06_beacons()
    unit = cricket(beacons, noise=0.0035, cone=K06_CONE, seed=3)
    errors = SensorErrors(
        acceleration_noise=(0.02, 0.02),
        gyro_walk=0.0,
        acceleration_walk=0.0,
        heading=0.2,
        heading_aid=0.1,
        fix=0.01,
    )
    navigation = rename(
        aided_ins(noise=noise_from_sensors(errors), pose=(0.05, -0.05, 0.2)),
        {
            "heading_aid": "heading_fix",
            "heading_aid_valid": "heading_fix_arrived",
            "fix_valid": "fix_arrived",
        },
    )
    found = flown(unit, [k06_imu(seed=2), arrivals(), navigation])
    assert_right(
        found, {"x": "P2[2,2]", "y": "P2[3,3]", "psi": "P1[0,0]"}, {"x": 0.05, "y": 0.05, "psi": 0.15}
    )
