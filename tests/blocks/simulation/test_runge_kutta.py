"""The classical Runge-Kutta method: the same on floats and on arrays, of order four."""

import math

import numpy as np
import pytest

from hovercontrol.blocks.simulation.runge_kutta import rk4, rk4_step
from hovercontrol.craft.models.vehicles import vehicle

PLANT = vehicle("c17_simulation").plant()
INPUTS, VALUES = [1.0, 0.2], list(PLANT.parameter_values())
START = [0.0, 0.0, 0.1, 1.0, 0.1, 0.2]


def test_floats_and_arrays_take_the_same_steps_to_the_last_digit():
    functions = PLANT.to_numpy()

    def slope(t, x):
        return np.array(
            [functions.scalar_pair("derivatives")[0](float(t), x.tolist(), INPUTS, VALUES)]
        ).ravel()

    h, state = np.array(0.01), np.array(START)
    for k in range(50):
        state = rk4_step(slope, k * h, state, h)
    wanted = rk4(functions.scalar_pair("derivatives"), 0.0, START, INPUTS, VALUES, 50 * 0.01, 50)
    assert state.tolist() == pytest.approx(wanted, rel=1e-14)
    one = rk4(functions.scalar_pair("derivatives"), 0.0, START, INPUTS, VALUES, 0.01, 1)
    assert rk4_step(slope, np.array(0.0), np.array(START), h).tolist() == one


def test_half_the_step_has_a_sixteenth_of_the_error():
    def error(n):
        x, h = np.array([1.0]), np.array([1.0 / n])
        for k in range(n):
            x = rk4_step(lambda t, x: -x * np.cos(t), k * h, x, h)
        return abs(float(x[0]) - math.exp(-math.sin(1.0)))

    assert error(10) / error(20) == pytest.approx(16, rel=0.15)
