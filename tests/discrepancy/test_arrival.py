"""Commands as they arrive: exact means, exact lags, zero before the beginning."""

import numpy as np
import pytest

from hovercontrol.discrepancy.arrival import Arrival, input_states
from hovercontrol.effects import effect
from hovercontrol.vehicles import c17_simulation

TIME = np.array([0.0, 0.1, 0.25, 0.3])
COMMANDS = np.array([[1.0, 3.0, -2.0, 0.5], [0.0, 0.1, 0.2, 0.3]])


def arrival(*effects):
    block = c17_simulation().with_effects(effects).plant()
    return block, Arrival(block, TIME, COMMANDS)


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


@pytest.mark.parametrize("delay", [0.0, 0.04])
def test_a_lag_is_that_of_its_equation(delay):
    block, commands = arrival(effect("thrust_lag", seconds=0.07))
    assert input_states(block) == (6,)
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
    assert input_states(c17_simulation().plant()) == ()
