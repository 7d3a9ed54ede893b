"""The fan's drive: the speed controller's brake (K06 4.2.1, figure 6.6) to the millisecond, and the motor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.hardware.actuators import fan_motor, speed_controller

RUN, BRAKE = 0, 1


def drive(commands, **options):
    """Return set speed and mode at each tick of 1 ms."""
    block = Ticking(speed_controller(**options))
    told = [block.tick(0.001 * k, {"fan_speed_command": float(c)}) for k, c in enumerate(commands)]
    return np.array([t["fan_speed_set"] for t in told]), np.array([t["drive_mode"] for t in told])


def piecewise(*parts):
    return np.concatenate([np.full(n, value) for n, value in parts])


def test_from_reverse_to_forward_it_brakes_for_exactly_150_ms():
    speed, mode = drive(piecewise((100, -500), (400, 800)))
    assert (speed[:100] == -500).all() and (mode[:100] == RUN).all()
    assert (speed[100:250] == 0).all() and (mode[100:250] == BRAKE).all()
    assert (speed[250:] == 800).all() and (mode[250:] == RUN).all()


def test_a_command_waits_for_the_next_update_but_the_brake_does_not():
    """The command changes at 101 ms and is taken at 120 ms; 150 ms later is between two updates."""
    speed, mode = drive(piecewise((101, -500), (400, 800)))
    assert np.flatnonzero(np.diff(speed)).tolist() == [119, 269]
    assert mode.sum() == 150


def test_from_forward_to_reverse_and_from_rest_it_does_not_brake():
    for before in (500, 0):
        speed, mode = drive(piecewise((100, before), (100, -700), (100, -100)))
        assert mode.sum() == 0
        assert (speed[100:200] == -700).all()
    assert drive(piecewise((100, 0), (200, 700)))[1].sum() == 0


def test_a_negative_command_during_the_brake_ends_it_at_once():
    speed, mode = drive(piecewise((100, -500), (60, 800), (300, -300)))
    assert (mode[100:160] == BRAKE).all() and mode[160:].sum() == 0
    assert (speed[160:] == -300).all()


def test_after_a_cancelled_brake_the_next_crossing_brakes_for_the_whole_time():
    _, mode = drive(piecewise((100, -500), (60, 800), (40, -300), (400, 800)))
    assert (mode[200:350] == BRAKE).all() and mode[350:].sum() == 0


def test_a_crossing_over_zero_is_one():
    """The dead zone puts zeros between; the fan has not turned forward meanwhile."""
    speed, mode = drive(piecewise((100, -500), (200, 0), (400, 800)))
    assert (mode[300:450] == BRAKE).all() and mode.sum() == 150
    assert (speed[100:450] == 0).all() and (speed[450:] == 800).all()


def test_zero_during_the_brake_neither_ends_nor_prolongs_it():
    speed, mode = drive(piecewise((100, -500), (60, 800), (40, 0), (400, 700)))
    assert (mode[100:250] == BRAKE).all() and mode.sum() == 150
    assert (speed[250:] == 700).all()


def test_once_braked_it_stays_so():
    assert drive(piecewise((100, -500), (300, 800), (100, 0), (300, 800)))[1].sum() == 150


def test_switched_off_commands_pass():
    commands = np.random.default_rng(2).normal(size=400)
    assert (drive(commands, brake=0.0, update=0.0)[0] == commands).all()
    block = Ticking(speed_controller(), {"speed_controller.brake": 0.0})
    told = [
        block.tick(0.001 * k, {"fan_speed_command": c})
        for k, c in enumerate(piecewise((40, -1.0), (40, 1.0)))
    ]
    assert sum(t["drive_mode"] for t in told) == 0


def by_hand(commands, brake):
    """The thesis' words as a program: one command a tick."""
    speeds, left, reversed_ = [], 0, False
    for c in commands:
        if c < 0:
            left, reversed_ = 0, True
        elif left == 0 and c > 0 and reversed_:
            left, reversed_ = brake, False
        if left:
            left -= 1
            speeds.append(0.0)
        else:
            speeds.append(c)
    return speeds


@settings(max_examples=10, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(1, 12), st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0])), min_size=1, max_size=30
    )
)
def test_any_commands_are_treated_as_the_thesis_says(parts):
    commands = piecewise(*parts)
    assert drive(commands, brake=0.007, update=0.0)[0].tolist() == by_hand(commands, 7)


def test_the_motor_follows_its_regulator_with_a_lag():
    time = np.linspace(0.0, 0.5, 26)
    motor = fan_motor(lag=0.1)
    found = simulate(motor, time, {"fan_speed_set": np.full(26, 500.0)}, x0=[0.0], rtol=1e-9, atol=1e-9)
    assert found.states[0] == pytest.approx(500.0 * (1 - np.exp(-time / 0.1)), abs=1e-4)
    assert fan_motor().to_numpy().outputs(0.0, (), [500.0]) == pytest.approx([500.0])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"brake": -0.15}, "speed_controller: brake must not be negative, found -0.15"),
        ({"brake": 0.1505}, "brake must be a multiple of the period 0.001 s, found 0.1505 s"),
        ({"period": -0.001}, "speed_controller: period must be positive, found -0.001"),
        ({"update": 0.02, "period": 0.003, "brake": 0.15}, "update must be a multiple of the period 0.003 s"),
    ],
)
def test_wrong_times_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        speed_controller(**options)
