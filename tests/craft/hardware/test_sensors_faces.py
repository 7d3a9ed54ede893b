"""Every sensor is the same in python-control and, in a hybrid Block, as machine code."""

import control
import numpy as np
import pytest

from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.hardware.sensors import (
    Beacons,
    arrivals,
    cricket,
    gyro_compensation,
    gyro_dynamics,
    k06_cricket,
    k06_imu,
    k06_magnetometer,
    magnetometer,
    mocap,
    poor_view,
    with_specific_force,
)
from hovercontrol.craft.models.vehicles import hoverdemon

SENSORS = {
    "imu": k06_imu,
    "gyro": gyro_dynamics,
    "compensation": gyro_compensation,
    "magnetometer": lambda: magnetometer(noise=1e-7, soft_iron=(0.1, 0.0, 0.05), hard_iron=(1e-6, 0.0)),
    "mocap": lambda: mocap(position_noise=1e-3, heading_step=1e-3),
    "poor view": lambda: poor_view(position_noise=1e-2, outlier_share=0.2, outlier_noise=0.1),
    "cricket": lambda: k06_cricket(assisted=True),
    "two beacons": lambda: k06_cricket(Beacons([(0, 1), (2.4, 1)], 2.7), side=-1),
    "arrivals": arrivals,
}


@pytest.mark.slow("cricket", "two")
@pytest.mark.parametrize("make", SENSORS.values(), ids=SENSORS)
def test_sensors_are_the_same_in_python_control(make, rng):
    block = make()
    names = [s.name for s in block.inputs]
    walk = np.cumsum(rng.normal(0, 0.05, (len(names), 60)), axis=1)
    times = np.arange(60) * block.period
    seen = control.input_output_response(block.to_control(), times, walk).outputs.reshape(-1, 60)
    ticking = Ticking(block)
    told = [list(ticking.tick(0.0, dict(zip(names, row, strict=True))).values()) for row in walk.T]
    assert seen == pytest.approx(np.array(told, dtype=float).T, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_plant_and_sensors_are_the_same_as_machine_code():
    plant = with_specific_force(hoverdemon().plant(), lever_arm=(0.1, 0.0))
    corner = Beacons([(0, 0), (2.4, 0), (0, 2.4)], 2.7)
    units = cricket(corner, [(0.1, 0.0)], slots=2, noise=1e-3, cone=(0.0032, -0.038), latency=True)
    parts = [k06_imu(rate="gyro_rate"), gyro_dynamics(), k06_magnetometer(), units]
    whole = interconnect([plant, *parts])
    times = np.linspace(0.0, 2.5, 51)
    commands = np.array([np.full(51, 0.5), np.full(51, 0.05)])
    start = {"plant.x": 1.0, "plant.y": 1.0, "plant.r": 0.5}
    python = simulate(whole, times, commands, x0=start)
    native = whole.compile().simulate(times, commands, x0=start)
    np.testing.assert_allclose(native.outputs, python.outputs, rtol=1e-8, atol=1e-8)
    told = dict(zip(python.output_labels, python.outputs, strict=True))
    assert told["fix_valid"].any() and np.ptp(told["yaw_rate"]) > 0.01
