"""Commands as they arrive: exact means, exact lags, zero before the beginning; and when they changed."""

import numpy as np
import pytest

from hovercontrol.effects import effect
from hovercontrol.estimation.commands import Arrival, command_times, input_states
from hovercontrol.estimation.measure import measure
from hovercontrol.logs import Log
from hovercontrol.models.vehicles import c17_simulation

TIME = np.array([0.0, 0.1, 0.25, 0.3])
COMMANDS = np.array([[1.0, 3.0, -2.0, 0.5], [0.0, 0.1, 0.2, 0.3]])


def arrival(*effects):
    model = c17_simulation().with_effects(effects)
    block = model.plant()
    return block, Arrival(block, TIME, COMMANDS, model.motion)


def test_means_are_integrals_of_held_values():
    _, commands = arrival()
    begin, end = np.array([0.05, 0.0, 0.24]), np.array([0.15, 0.3, 0.5])
    expected = [2.0, (0.1 * 1 + 0.15 * 3 - 0.05 * 2) / 0.3, (0.01 * 3 - 0.05 * 2 + 0.2 * 0.5) / 0.26]
    np.testing.assert_allclose(commands.mean(begin, end)[0], expected)


def test_late_commands_are_zero_before_the_beginning():
    _, commands = arrival()
    begin = np.array([0.0, 0.1, 0.9])
    np.testing.assert_allclose(commands.mean(begin, begin + 0.02, delay=0.1)[0], [0.0, 1.0, 0.5])
    np.testing.assert_allclose(commands.mean(begin, begin + 0.02, delay=-0.1)[0], [3.0, 3.0, 0.5])
    np.testing.assert_allclose(commands.at(begin, delay=0.1)[0], [0.0, 1.0, 0.5])


@pytest.mark.parametrize("delay", [0.0, 0.04])
def test_a_lag_is_that_of_its_equation(delay):
    block, commands = arrival(effect("thrust_lag", seconds=0.07))
    parameters = block.parameter_values()
    fine = np.linspace(0.0, 0.6, 60_001)
    held = np.searchsorted(TIME, fine - delay + 1e-9, side="right") - 1
    u = np.where(held >= 0, COMMANDS[0][np.maximum(held, 0)], 0.0)
    value, path = 0.0, []
    for command in u:
        path.append(value)
        value += (fine[1] - fine[0]) * (command - value) / 0.07
    when = np.array([0.0, 0.05, 0.13, 0.27, 0.55])
    found = commands.lagged(when, parameters, delay)[6]
    np.testing.assert_allclose(found, np.interp(when, fine, path), atol=2e-4)


def test_states_that_follow_from_more_than_inputs_are_none():
    model = c17_simulation()
    lagging = model.with_effects([effect("thrust_lag", seconds=0.1), effect("rudder_lag", seconds=0.1)])
    assert input_states(model.plant(), model.motion) == ()
    assert input_states(lagging.plant(), model.motion) == (6, 7)


def test_motion_is_no_part_of_the_commands_way(cart):
    assert input_states(cart, ()) == (1, 0)  # a cart goes where its force pushes it
    assert input_states(cart, ("p", "v")) == ()


def test_a_command_that_changed_in_a_gap_did_so_at_any_time_within(cart):
    t = 0.05 * np.arange(100)
    kept = np.setdiff1d(np.arange(100), [30, 31, 32, 60, 61])
    force = np.where(np.arange(100) < 32, 0.5, -0.5)  # new behind the first gap, the same behind the second
    p = np.cumsum(np.random.default_rng(0).normal(size=100))
    log = measure(cart, Log("gaps", t[kept], {"p": p[kept], "F": force[kept]}))
    time, std = command_times(log)
    row = int(np.flatnonzero(kept == 33)[0])
    assert np.flatnonzero(std).tolist() == [row]
    assert std[row] == pytest.approx(0.2 / np.sqrt(12.0))
    assert time[row] == pytest.approx(t[33] - 0.1)
    np.testing.assert_array_equal(np.delete(time, row), np.delete(log.time, row))
