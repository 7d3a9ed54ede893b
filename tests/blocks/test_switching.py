"""What happens by the clock is not stepped over, however long nothing moved before."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol import (
    Block,
    Signal,
    circle,
    interconnect,
    simulate,
    time,
    tracking_controller,
    vehicle,
    waypoints,
)
from hovercontrol.blocks.switching import longest_step, switching_times

DELAY = Signal("delay", "s", start=50.0)


def pulse(width=1.0):
    """A push of 1 m/s^2 that begins after `delay`."""
    v, push = Signal("v", "m/s"), Signal("push", "m/s^2", start=1.0)
    since = time - DELAY.symbol
    second = Signal("second", "s", start=1.0)
    e = sp.Piecewise((push.symbol, (since >= 0) & (since < width * second.symbol)), (0, True))
    return Block("sledge", (v,), (), (v,), (push, DELAY, second), {"v": e})


def test_switching_times_follow_the_parameters():
    assert switching_times(pulse()) == (50.0, 51.0)
    assert switching_times(pulse(), {"sledge.delay": 7.0}) == (7.0, 8.0)
    assert switching_times(circle(1.0)) == ()


def test_the_longest_step_is_half_the_shortest_stretch_inside():
    assert longest_step(pulse(0.2), None, 0.0, 100.0) == pytest.approx(0.1)
    assert longest_step(pulse(0.2), None, 0.0, 40.0) == np.inf


@pytest.mark.parametrize("width", [1.0, 0.01])
def test_a_short_pulse_after_long_rest_is_seen(width):
    response = simulate(pulse(width), np.linspace(0.0, 100.0, 11))
    assert response.states[0, -1] == pytest.approx(width, rel=1e-4)


def test_a_craft_leaves_when_its_waypoints_say_so():
    craft = vehicle("c17_simulation")
    path = waypoints([[0, 0], [1, 0], [0, 0]], [50.0, 51.0, 52.0])
    loop = interconnect([craft.plant(), tracking_controller(craft), path], "loop")
    response = simulate(loop, np.linspace(0.0, 60.0, 601), {}, {"plant.x": -0.2})
    names = response.output_labels
    assert response.outputs[names.index("x")].max() == pytest.approx(0.8, abs=0.01)
    assert np.abs(response.outputs[names.index("error_x")]).max() < 1e-3
