"""Dead reckoning against K06 (3.42) written out by hand, and motions known exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    ins_mechanisation,
    simulate_runs,
)
from hovercontrol.craft.hardware.sensors import Beacons

from .by_hand import by_hand_342, shaken

DT = IMU_PERIOD
BEACONS = [(0.0, 0.0), (3.0, 0.2), (0.1, 2.5), (2.8, 2.9)]
HUNG = Beacons(BEACONS, 2.0)
UNEVEN = {"acceleration_x": [0.0], "acceleration_y": [0.0, 0.0], "yaw_rate": [0.0, 0.0, 0.0]}


def test_mechanisation_is_342(rng):
    imu = {k: v for k, v in shaken(rng).items() if k in ("acceleration_x", "acceleration_y", "yaw_rate")}
    found = simulate_runs(ins_mechanisation(pose=(1.0, 2.0, 0.4)), imu)
    psi, v, r = by_hand_342(imu, DT, (1.0, 2.0, 0.4))
    np.testing.assert_allclose(found["psi_ins"][:, 0], psi, atol=1e-12)
    np.testing.assert_allclose([found["v_x_ins"][:, 0], found["v_y_ins"][:, 0]], v, atol=1e-12)
    np.testing.assert_allclose([found["x_ins"][:, 0], found["y_ins"][:, 0]], r, atol=1e-12)


@given(*[st.floats(-2, 2) for _ in range(5)])
def test_mechanisation_is_exact_for_force_that_grows_evenly(a0, a1, v0, x0, rate):
    """Without turning, a = a0 + a1 t gives v and x as polynomials; the heading of an even spin is exact."""
    t = np.arange(50) * 0.1
    straight = {"acceleration_x": a0 + a1 * t, "acceleration_y": 0 * t, "yaw_rate": 0 * t}
    block = ins_mechanisation(period=0.1, pose=(x0, 0, 0), velocity=(v0, 0))
    found = simulate_runs(block, straight)
    np.testing.assert_allclose(found["v_x_ins"][:, 0], v0 + a0 * t + a1 * t**2 / 2, atol=1e-10)
    np.testing.assert_allclose(found["x_ins"][:, 0], x0 + v0 * t + a0 * t**2 / 2 + a1 * t**3 / 6, atol=1e-10)
    spin = simulate_runs(block, {**straight, "yaw_rate": rate + 0 * t})
    np.testing.assert_allclose(spin["psi_ins"][:, 0], rate * t, atol=1e-12)


def test_mechanisation_follows_a_circle_with_second_order():
    """A platform of radius 0.3048 m at 2.9 rad/s (K06's rotating bench): error falls with dt^2."""

    def error(dt):
        t = np.arange(0, 2 + dt / 2, dt)
        arm, rate = 0.3048, 2.9
        imu = {"acceleration_x": 0 * t, "acceleration_y": arm * rate**2 + 0 * t, "yaw_rate": rate + 0 * t}
        block = ins_mechanisation(period=dt, pose=(0, -arm, 0), velocity=(arm * rate, 0))
        found = simulate_runs(block, imu, ["x_ins", "y_ins"])
        truth = [arm * np.sin(rate * t), -arm * np.cos(rate * t)]
        return np.abs(np.array([found["x_ins"][:, 0], found["y_ins"][:, 0]]) - truth).max()

    assert error(0.02) / error(0.01) == pytest.approx(4, rel=0.1)
    assert error(DT) < 1e-4
