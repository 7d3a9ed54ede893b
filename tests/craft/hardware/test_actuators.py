"""K06's actuators, part by part and in the loop, against the thesis' numbers (chapter 4, section 6.1.1)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.controllers.k06 import force_to_command, stop, turn
from hovercontrol.control.controllers.k06.setpoints import setpoints
from hovercontrol.craft.hardware.actuators import (
    FanTable,
    actuators,
    fan_force,
    fan_motor,
    fan_tables,
    force_angle_of_rudder,
    force_command,
    forward_thrust,
    ideal_fan,
    reverse_ratio,
    rudder_lookup,
    rudder_of_force_angle,
    rudder_servo,
    servo_table,
    thrust_force,
    thrust_lookup,
)
from hovercontrol.craft.hardware.actuators.signals import RPM
from hovercontrol.craft.models.vehicles import hoverdemon
from tests.blocks.simulation.loops import run_loop

DEG = math.pi / 180


def one(block, **signals):
    """Return the outputs of a Block's first tick, or of a static one."""
    return Ticking(block).tick(0.0, signals)


# ---- the thesis' numbers ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rudder", "angle", "force", "side", "yaw_acceleration", "inertia"),
    [(-20, 14.6, 1.1, -0.28, 0.9412, 0.0952), (25, -17.4, 1.05, 0.31, -1.026, 0.0967)],
)
def test_the_regression_4_3_agrees_with_table_4_2(rudder, angle, force, side, yaw_acceleration, inertia):
    assert -1.40 * angle + 0.566 == pytest.approx(rudder, abs=0.15)  # the equation by hand, degrees
    theta = force_angle_of_rudder(rudder * DEG)  # from the bow, so that F_Y = |F| sin(theta)
    assert theta / DEG == pytest.approx(-angle, abs=0.15)
    assert force * math.sin(theta) == pytest.approx(side, abs=0.006)
    # a side force of the table turns a craft of the table's inertia as fast as the table says
    assert -0.32 * side / yaw_acceleration == pytest.approx(inertia, abs=6e-5)


@given(st.floats(-1.5, 1.5))
def test_4_3_goes_both_ways(theta):
    assert force_angle_of_rudder(rudder_of_force_angle(theta)) == pytest.approx(theta, abs=1e-14)


def test_the_ratio_4_4_is_that_of_figure_4_4():
    for x in range(6, 13):
        by_hand = 9.734e-4 * x**3 - 3.277e-2 * x**2 + 3.833e-1 * x - 1.099
        assert reverse_ratio(1000.0 * x) == pytest.approx(by_hand, abs=1e-12)
        assert 0.2 < by_hand < 0.5  # the figure's axis
    assert reverse_ratio([-6000.0, 100.0, 20000.0]) == pytest.approx(reverse_ratio([6000.0, 6000.0, 12000.0]))


def test_the_stand_in_has_what_is_known_of_k06s_tables():
    lookup, reverse = fan_tables()
    assert lookup.shape == (14, 161)
    assert lookup.step == pytest.approx((5.0, 0.025))
    assert (lookup.columns[0], lookup.columns[-1]) == (-2.0, 2.0)
    size = np.abs(lookup.values[lookup.values != 0])
    assert (size.min(), size.max()) == (3000, 12000)
    assert 1.5 < forward_thrust(12000.0) < 2.0  # figure 4.5's last tick is 1.5 N
    # quadratic in the speed, falling with the rudder angle to both sides
    n = np.arange(3000.0, 12001.0, 500.0)
    for angle in (-35.0, 0.0, 20.0):
        assert np.diff(forward_thrust(n, angle), 3) == pytest.approx(0.0, abs=1e-12)
    at_10000 = reverse.values[:, reverse.columns == 10000.0].ravel()
    assert (np.diff(at_10000)[:7] > 0).all() and (np.diff(at_10000)[7:] < 0).all()
    # in reverse (4.4) of forward
    backward = -reverse.values[7, reverse.columns == -8000.0] / reverse.values[7, reverse.columns == 8000.0]
    assert backward == pytest.approx(9.734e-4 * 512 - 3.277e-2 * 64 + 3.833e-1 * 8 - 1.099)


def test_speed_and_force_tables_undo_each_other_within_their_steps():
    """Beyond the slowest speed and before saturation; half a column of the force table is 0.0125 N."""
    there = thrust_lookup(period=0.0).to_numpy()
    back = thrust_force().to_numpy()
    rng = np.random.default_rng(5)
    rudder = rng.uniform(-35, 30, 500) * DEG
    force = rng.uniform(-0.7, 1.5, 500)
    lowest = np.where(force < 0, -fan_force(-3000.0), fan_force(3000.0)) + 0.025
    told = np.abs(force) > lowest
    speed = there.outputs(0.0, (), np.array([force, rudder]))[0]
    made, angle = back.outputs(0.0, (), np.array([speed, rudder]))
    assert told.sum() > 300
    assert np.abs(made - force)[told].max() < 0.004
    assert angle == pytest.approx(force_angle_of_rudder(rudder))


# ---- one part ---------------------------------------------------------------------------------------


def test_the_dead_zone_is_that_of_force_to_command_and_the_limit_keeps_the_angle():
    command = force_command(dead_zone=0.05, limit=1.0)
    assert one(command, force_x=0.05, force_y=-0.049)["thrust_command"] == 0.0
    told = one(command, force_x=-3.0, force_y=4.0)
    assert told["thrust_command"] == pytest.approx(-1.0)
    assert told["force_angle_command"] == pytest.approx(math.atan2(-4.0, 3.0))
    plain = one(force_command(dead_zone=0.0), force_x=-3.0, force_y=4.0)
    assert plain["thrust_command"] == pytest.approx(-5.0)


@pytest.mark.slow
@given(st.floats(-0.42, 0.36))
def test_the_servo_goes_where_the_lookup_wants_it(theta):
    pulse = one(rudder_lookup(), force_angle_command=theta)["servo_command"]
    assert 1e-3 <= pulse <= 2e-3
    assert one(rudder_servo(), servo_command=pulse)["rudder_angle"] == pytest.approx(
        rudder_of_force_angle(theta), abs=1e-12
    )


def test_pulses_follow_numpys_interpolation_of_the_table():
    table = servo_table()
    assert len(table.pulse) == 21  # steps of 50 us over 1 to 2 ms
    servo = rudder_servo(table=table).to_numpy()
    for ms in np.linspace(0.8, 2.2, 57):
        found = servo.outputs(0.0, [0.0], [ms * 1e-3])[0]
        assert found / DEG == pytest.approx(np.interp(ms, table.pulse, table.angle), abs=1e-9)


def test_a_slew_limit_slows_the_servo_both_ways_and_zero_switches_it_off():
    servo = Ticking(rudder_servo(slew=2.0))
    way = [
        servo.tick(0.02 * k, {"servo_command": p})["rudder_angle"]
        for k, p in enumerate([2e-3] * 5 + [1e-3] * 5)
    ]
    assert np.diff(way) == pytest.approx([0.04] * 4 + [-0.04] * 5)
    free = Ticking(rudder_servo(slew=2.0), {"rudder_servo.slew": 0.0})
    assert free.tick(0.0, {"servo_command": 2e-3})["rudder_angle"] == pytest.approx(38.0 * DEG)


def test_what_leaves_a_table_is_clipped_and_counted():
    lookup = Ticking(thrust_lookup())
    for force, rudder, speed, count in (
        (1.0, 0.0, None, 0),
        (2.0, -35 * DEG, 12000, 0),  # the corner itself
        (2.5, 0.0, 12000, 1),
        (-9.0, 0.0, -12000, 2),
        (0.5, 60 * DEG, None, 3),
        (0.5, 30 * DEG, None, 3),
    ):
        told = lookup.tick(0.0, {"thrust_command": force, "rudder_angle_command": rudder})
        assert told["thrust_clipped"] == count
        if speed is not None:
            assert told["fan_speed_command"] / RPM == pytest.approx(speed, abs=0.6)
    servo = Ticking(rudder_lookup())
    counts = [servo.tick(0.0, {"force_angle_command": a})["rudder_clipped"] for a in (0.0, 1.0, -1.0, 0.3)]
    assert counts == [0, 1, 2, 2]


def test_a_fan_stronger_than_its_table_is_one_parameter():
    speed, rudder = 9000 * RPM, 10 * DEG
    as_calibrated, stronger = (
        thrust_force().to_numpy().outputs(0.0, (), [speed, rudder], {"thrust_force.force_unit": unit})[0]
        for unit in (1.0, 1.2)
    )
    assert stronger == pytest.approx(1.2 * as_calibrated)


# ---- the loop ---------------------------------------------------------------------------------------


def ticking(*blocks):
    return [b.unchecked(period=0.001) for b in blocks]


def run(law, parts, until=8.0, **start):
    plant = hoverdemon().plant()
    if parts is None:
        blocks, moving = [*ticking(law, force_to_command())], plant
    else:
        blocks, moving = [*ticking(law), *parts.sampled], parts.moving(plant)
    names = {s.name.rpartition(".")[2]: s.name for s in moving.states}
    response = run_loop(moving, blocks, until, x0={names[k]: v for k, v in start.items()})
    return response.time, dict(zip(response.output_labels, response.outputs, strict=True))


STOP = stop(k1=1.0, k2=2.5)
TABLE_6_1 = {"u": 0.2, "v": -0.7, "r": 6.4}


@pytest.mark.slow("turn")
@pytest.mark.parametrize("law", ["stop", "turn"])
def test_with_everything_off_the_loop_is_the_ideal_one(law):
    if law == "turn":
        inner = turn(k1=0.5, k2=3.5)
        control, start = interconnect([setpoints([inner], {"yaw_rate_ref": 3.0}), inner], "law"), {"r": 0.1}
    else:
        control, start = STOP, TABLE_6_1
    _, wanted = run(control, None, until=4.0, **start)
    _, found = run(control, actuators(ideal=True), until=4.0, **start)
    assert found["thrust_clipped"][-1] == found["rudder_clipped"][-1] == 0
    for name in ("x", "y", "psi", "u", "v", "r"):
        assert found[name] == pytest.approx(wanted[name], abs=1e-10)


@pytest.mark.slow
def test_finer_tables_bring_the_loop_nearer_to_the_ideal_one():
    """Only the tables are on, of a fan whose force is quadratic in its speed both ways."""

    def square(speed, rudder):
        return 2.0 * np.sign(speed) * (speed / 3000.0) ** 2

    _, wanted = run(STOP, None, until=3.0, **TABLE_6_1)
    errors = []
    for parts in (20, 40, 80):
        tables = fan_tables(
            square,
            rudder=(-180.0, 180.0),
            columns=np.linspace(-20, 20, 4 * parts + 1),
            lowest=0.0,
            step=12000 / parts,
        )
        ideal = actuators(ideal=True)
        lookup = thrust_lookup(table=tables[0])
        body = interconnect([fan_motor(), thrust_force(table=tables[1], slope=-1.0, offset=0.0)], "actuators")
        mixed = type(ideal)((*ideal.pilot[:2], lookup), ideal.board, body)
        _, found = run(STOP, mixed, until=3.0, **TABLE_6_1)
        errors.append(np.abs(found["r"] - wanted["r"]).max())
    assert errors[0] > 1.5 * errors[1] > 2 * errors[2]


@pytest.fixture(scope="module")
def real():
    return run(STOP, actuators(), until=15.0, **TABLE_6_1)


@pytest.mark.slow
def test_k06s_actuators_bring_the_craft_to_rest_as_table_6_1_says(real):
    """At rest in about 10 s; what remains, the dead zone does not see: 0.05 N are 0.05 m/s at k1 = 1."""
    time, c = real
    late = time > 10
    assert np.abs(c["u"][late]).max() < 0.08
    assert np.abs(c["v"][late]).max() < 0.08
    assert np.abs(c["r"][late]).max() < 0.3
    assert np.abs(c["r"][time < 2]).max() > 3


@pytest.mark.slow
def test_forces_stay_within_what_the_actuators_can(real):
    _, c = real
    assert c["thrust"].max() <= 1.95 and c["thrust"].min() >= -0.91  # 1.35 * 1.44 N and (4.4) at 12 000 RPM
    theta = c["rudder"] / DEG
    assert theta.min() >= -(38 + 0.566) / 1.4 - 1e-9 and theta.max() <= (38 - 0.566) / 1.4 + 1e-9
    assert c["thrust_clipped"][-1] > 0


def test_commands_hold_for_20_ms(real):
    time, c = real
    for name in ("rudder_angle", "fan_speed_set"):
        changes = time[1:][np.diff(c[name]) != 0]
        if name == "fan_speed_set":  # a brake may end in between, at 150 ms
            changes = changes[(np.diff(c["drive_mode"])[np.diff(c[name]) != 0]) == 0]
        assert len(changes) > 20
        assert (np.round(changes * 1000) % 20 == 0).all()


# ---- wrong input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: force_command(dead_zone=-0.1), "dead_zone must not be negative, found -0.1"),
        (lambda: force_command(limit=-1.0), "command: limit must not be negative, found -1.0"),
        (lambda: rudder_lookup(period=-1.0), "rudder_lookup: period must not be negative, found -1.0"),
        (lambda: rudder_lookup(slope=0.0), "rudder_lookup: size of the slope must be positive, found 0.0"),
        (lambda: rudder_servo(slew=-1.0), "rudder_servo: slew must not be negative, found -1.0"),
        (lambda: rudder_servo(period=0.0), "rudder_servo: period must be positive, found 0.0"),
        (lambda: thrust_lookup(period=-0.02), "thrust_lookup: period must not be negative, found -0.02"),
        (lambda: thrust_lookup(table=ideal_fan()[1]), "expected a table over forces, found 'ideal, reverse'"),
        (
            lambda: thrust_force(table=ideal_fan()[0]),
            "expected a table over speeds, found 'ideal' over forces",
        ),
        (lambda: fan_motor(lag=-0.1), "fan_motor: lag must not be negative, found -0.1"),
        (lambda: actuators(ideal=True, lag=0.1), "with ideal=True, expected no other argument"),
    ],
)
def test_wrong_input_is_refused_in_one_line(make, said):
    with pytest.raises(InputError, match=said) as error:
        make()
    assert "\n" not in str(error.value)


@settings(max_examples=10, deadline=None)
@given(st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_more_force_never_asks_for_less_speed(force, rudder):
    lookup = thrust_lookup(period=0.0).to_numpy()
    speeds = [lookup.outputs(0.0, (), [f, rudder])[0] for f in (force, force + 0.3)]
    assert speeds[0] <= speeds[1] + 1e-9
    assert isinstance(fan_tables()[0], FanTable)


@pytest.mark.slow
def test_the_loop_as_one_block_in_machine_code_flies_the_same():
    parts = actuators()
    plant, law = hoverdemon().plant(), ticking(STOP)
    time, stepped = run(STOP, parts, until=1.0, **TABLE_6_1)
    whole = interconnect([plant, parts.body, *law, *parts.sampled], "loop")
    start = {f"plant.{k}": v for k, v in TABLE_6_1.items()}
    flown = whole.compile().simulate(time, x0=start, rtol=1e-9, atol=1e-12)
    found = dict(zip(flown.output_labels, flown.outputs, strict=True))
    for name in ("x", "psi", "u", "v", "r", "fan_speed_set", "rudder_angle", "drive_mode", "thrust_clipped"):
        assert found[name] == pytest.approx(stepped[name], abs=1e-6)
