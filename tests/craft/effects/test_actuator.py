"""Actuators with a memory, against their definitions stepped by hand."""

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.craft.effects.actuator import TAU
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan

DT = 1e-4
TIME = np.arange(0.0, 2.0, DT)
COMMAND = 1.5 * np.sin(2 * TIME) + 0.4 * np.sin(9 * TIME)


def followed(name, **numbers):
    """The actuator's state under a command that swings to and fro; thrust or rudder."""
    block = c17_simulation().with_effects([effect(name, **numbers)]).plant()
    inputs = {"thrust": COMMAND, "rudder": COMMAND}
    commands = np.stack([inputs[s.name] for s in block.inputs])
    response = block.compile(friction="smooth").simulate(TIME, commands, rtol=1e-8)
    assert response.states[6, 0] == 0.0
    return np.asarray(response.states[6])


def play(command, width):
    """Hysteresis: pushed by either edge of the play, at rest between them."""
    at, found = 0.0, []
    for c in command:
        at = min(max(at, c - width / 2), c + width / 2)
        found.append(at)
    return np.array(found)


def limited(command, limit):
    at, found = 0.0, []
    for c in command:
        found.append(at)
        at += np.clip(c - at, -limit * DT, limit * DT)
    return np.array(found)


@pytest.mark.parametrize("name", ["thrust_backlash", "rudder_backlash"])
def test_what_follows_with_play_is_pushed_by_the_edges_of_the_play(name):
    error = followed(name, width=0.6) - play(COMMAND, 0.6)
    fastest = np.abs(np.gradient(COMMAND, DT)).max()
    assert np.abs(error).max() < 1.05 * fastest * (TAU + DT), "late by the regularisation and no more"
    finer = followed(name, width=0.6, tau=TAU / 10) - play(COMMAND, 0.6)
    assert np.abs(finer).max() < 0.3 * np.abs(error).max()


@pytest.mark.parametrize("name", ["thrust_rate_limit", "rudder_rate_limit"])
def test_an_actuator_with_a_limited_rate_is_never_faster(name):
    found = followed(name, limit=1.5)
    assert np.abs(np.diff(found)).max() < 1.5 * DT * (1 + 1e-6)
    error = found - limited(COMMAND, 1.5)
    assert np.abs(error).max() < 1.05 * 1.5 * (TAU + DT)


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("thrust_backlash", {"width": 0.0}),
        ("rudder_backlash", {"width": 0.0}),
        ("thrust_rate_limit", {"limit": 1e3}),
        ("rudder_rate_limit", {"limit": 1e3}),
    ],
)
def test_without_play_and_at_any_rate_the_command_is_followed(name, numbers):
    error = followed(name, **numbers, tau=1e-4) - COMMAND
    assert np.abs(error).max() < 0.01  # inputs are held for 0.1 ms


@pytest.mark.parametrize(("command", "acting"), [(1.0, 0.9), (0.55, 0.5), (0.2, 0.3)])
def test_forces_see_the_actuator_not_the_command(command, acting):
    """Within half the width of its command at once, and at rest inside it."""
    block = c17_simulation().with_effects([effect("thrust_backlash", width=0.2)]).plant()
    moved = block.to_numpy().derivatives(0.0, [0, 0, 0, 0, 0, 0, 0.5], [command, 0.0])
    still = block.to_numpy().derivatives(0.0, [0, 0, 0, 0, 0, 0, 0.0], [0.0, 0.0])
    assert moved[3] - still[3] == pytest.approx(c17_simulation().coefficients()["thrust"] * acting)
    assert moved[6] == pytest.approx((acting - 0.5) / TAU)


@pytest.mark.parametrize(
    ("name", "end"), [("thrust_backlash", "played"), ("thrust_rate_limit", "rate_limited")]
)
def test_every_fan_has_its_own_actuator(name, end):
    number = {"thrust_backlash": {"width": 0.01}, "thrust_rate_limit": {"limit": 0.5}}[name]
    block = four_fan().with_effects([effect(name, **number)]).plant()
    assert [s.name for s in block.states[6:]] == [f"{f.name}_{end}" for f in four_fan().fans]
    assert {s.unit for s in block.states[6:]} == {"N"}
