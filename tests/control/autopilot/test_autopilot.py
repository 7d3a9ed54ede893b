"""K06's real loop: with everything switched off the ideal one; each imperfection does what its name says."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.autopilot import (
    SWITCHES,
    Imperfections,
    autopilot,
    beside_ideal,
    nearest_heading,
    seeds,
)
from hovercontrol.control.autopilot.limits import actuator_limits, lossy_tables
from hovercontrol.control.controllers.k06 import bang_bang_heading, force_to_command, setpoints, stop, turn
from hovercontrol.craft.hardware.actuators import (
    VariablePitch,
    fan_force,
    fan_tables,
    read_servo_table,
    table_pair,
)
from hovercontrol.craft.hardware.sensors import Beacons, k06_beacons
from hovercontrol.craft.models.vehicles import hoverdemon

LAW, TOLD, START = turn(k1=0.5, k2=3.5), {"yaw_rate_ref": 3.0}, {"r": 0.1}
IDEAL = interconnect(
    [hoverdemon().plant().with_values(START), LAW, setpoints([LAW], TOLD), force_to_command()], "loop"
)


@cache
def loop(period=0.001, navigation="error_model"):
    real = autopilot(LAW, references=TOLD, start=START, period=period, navigation=navigation)
    return beside_ideal(real, IDEAL)


def fly(chosen, until=3.0, step=0.001, params=None, **which):
    block = loop(**which)
    times = np.arange(round(until / step) + 1) * step
    run = block.compile().simulate(times, params=chosen.parameters(block) | (params or {}))
    return times, dict(zip(run.output_labels, np.asarray(run.outputs), strict=True))


# ---- the limit in which it is the ideal loop ----------------------------------------------------------


@pytest.mark.slow
def test_with_everything_off_it_is_the_ideal_loop_to_the_order_of_its_tick():
    """Commands are held for a tick and come one late: halve the tick, and half of the gap remains."""
    gaps = [np.abs(fly(Imperfections.only(), period=h)[1]["gap"]).max() for h in (0.002, 0.001)]
    assert gaps[1] < 0.01 * 3.0 * 0.32  # of the speed of the rudder
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.1)


def test_with_perfect_sensors_the_filters_tell_the_truth():
    _, c = fly(Imperfections.only("ins_update"), step=0.02, until=10.0, navigation="magnetometer")
    for name, most in {"u": 0.01, "v": 0.01, "psi": 0.025, "r": 0.02}.items():
        assert np.abs(c[f"{name}_hat"] - c[name])[50:].max() < most, name
    assert c["gap"].max() < 0.05


WITH = {n: Imperfections.only(n) for n in SWITCHES if n not in ("gyro_range", "brake")}


@pytest.mark.slow("gyro_dynamics", "ins_", "delay", "update")
@pytest.mark.parametrize("name", WITH)
def test_each_imperfection_alone_moves_the_craft_away_from_the_ideal_one(name):
    rms = [np.sqrt(np.mean(fly(chosen)[1]["gap"] ** 2)) for chosen in (WITH[name], Imperfections.only())]
    assert rms[0] > 1.05 * rms[1]


@pytest.mark.slow
def test_every_switch_belongs_to_a_loop():
    known = {k for nav in ("error_model", "magnetometer") for k in loop(navigation=nav).default_parameters}
    known |= set(autopilot(LAW, references=TOLD, propeller=VariablePitch()).default_parameters)
    assert {key for keys in SWITCHES.values() for key in keys} <= known


# ---- what each does ----------------------------------------------------------------------------


def test_the_downlink_tells_the_law_what_was_36_ms_ago():
    t, c = fly(Imperfections.only("downlink_delay"), until=1.0)
    at = np.arange(36, len(t), 6)
    assert c["r_seen"][at] == pytest.approx(c["r"][at - 36], abs=1e-12)
    assert c["r_seen"][at[:-1] + 5] == pytest.approx(c["r_seen"][at[:-1]], abs=1e-12)  # held for 6 ms


def test_the_uplink_takes_40_ms_on_a_grid_of_20():
    t, c = fly(Imperfections.only("uplink_delay"), until=1.0)
    ways = np.hypot(c["force_x"], c["force_y"])
    at = np.arange(40, len(t), 20)
    assert np.abs(c["thrust"][at]) == pytest.approx(ways[at - 40], rel=1e-9)


def test_a_small_force_is_none():
    _, c = fly(Imperfections.only("dead_zone"), until=3.0)
    small = (np.abs(c["force_x"]) <= 0.05) & (np.abs(c["force_y"]) <= 0.05)
    still = small[:-1]  # a command acts one tick later
    assert still.any() and (c["thrust"][1:][still] == 0.0).all()


def test_commands_every_20_ms_hold_in_between():
    _, c = fly(Imperfections.only("update_20ms"), until=1.0)
    changed = np.flatnonzero(np.diff(c["thrust"])) + 1
    assert len(changed) > 20 and (changed % 20 == 0).all()


def test_tables_and_saturation_leave_no_more_force_than_the_calibration_has():
    for name in ("tables", "saturation"):
        _, c = fly(Imperfections.only(name))
        assert np.abs(c["force_y"]).max() > 2.5  # the law asks for more
        assert c["thrust"].max() < 2.1 and c["thrust"].min() > -1.0
        assert np.abs(c["rudder"]).max() < math.radians(28.0)


@pytest.mark.slow
def test_the_gyro_is_too_slow_to_see_how_the_stop_trial_starts():
    """6.4 rad/s are 367 deg/s, K06's gyro ends at 300."""
    block = autopilot(stop(k1=1.0, k2=2.5), start={"r": 6.4}, navigation="magnetometer").compile()
    seen = block.simulate([0.0, 0.01], params=Imperfections.only("gyro_range").parameters(block.block))
    by_gyro = dict(zip(seen.output_labels, np.asarray(seen.outputs)[:, 0], strict=True))
    assert by_gyro["r"] == 6.4
    assert by_gyro["r_hat"] == pytest.approx(math.radians(300.0), abs=1e-9)


@pytest.mark.slow
def test_errors_of_the_navigation_are_as_large_as_stated():
    """Between two pulses they grow from nothing: velocities by t b; r by the gyro's.

    K06 section 6.1.1: variances of 2.5 cm/s^2, 1 deg/s and 0.5 deg/s, in SI units.
    """
    block = autopilot(stop(k1=1.0, k2=2.5)).compile()
    chosen = Imperfections.only("ins_bias", "ins_noise", "ins_update").parameters(block.block)
    keys = seeds(block.block, 1)
    late = []
    for seed in range(1, 101):
        run = block.simulate([0.0, 0.996], params=chosen | dict.fromkeys(keys, float(seed)))
        late.append(np.asarray(run.outputs)[:, 1])
    c = dict(zip(run.output_labels, np.transpose(late), strict=True))
    variances = {"u": 0.025, "v": 0.025, "psi": math.radians(1.0)}
    for name, wanted in ((name, math.sqrt(value)) for name, value in variances.items()):
        # 100 draws: the sample's deviation is within 25 % at 3.5 sigma
        assert np.std(c[f"{name}_hat"] - c[name]) == pytest.approx(0.996 * wanted, rel=0.25), name
    both = math.sqrt(math.radians(1.0 + 0.5))
    assert np.std(c["r_hat"] - c["r"]) == pytest.approx(both, rel=0.25)


def test_a_seed_is_a_run_and_two_are_two():
    key = next(iter(seeds(loop(), 1)))
    runs = [fly(Imperfections(), until=1.0, step=0.02, params={key: s})[1]["r"] for s in (1.0, 1.0, 2.0)]
    assert (runs[0] == runs[1]).all() and (runs[0] != runs[2]).any()


def test_numpy_is_machine_code():
    block = loop()
    times = np.arange(13) * 0.01
    slow, fast = simulate(block, times), block.compile().simulate(times, rtol=1e-9, atol=1e-12)
    assert np.asarray(slow.outputs) == pytest.approx(np.asarray(fast.outputs), rel=1e-7, abs=1e-9)


# ---- parts ----------------------------------------------------------------------------


@given(thrust=st.floats(-50, 50), angle=st.floats(-1.6, 1.6))
def test_limits_keep_what_is_within_and_clip_what_is_not(thrust, angle):
    block = actuator_limits()
    p = {k.rpartition(".")[2]: v for k, v in block.default_parameters.items()}
    force, a = block.to_numpy().outputs(0.0, (), [thrust, angle])
    assert force == pytest.approx(np.clip(thrust, -p["astern"], p["ahead"]))
    assert a == pytest.approx(np.clip(angle, p["angle_lowest"], p["angle_highest"]))
    off = block.to_numpy().outputs(0.0, (), [thrust, angle], {"saturation.on": 0.0})
    assert off.tolist() == [thrust, angle]


@given(psi=st.floats(-40, 40), goal=st.floats(-10, 10))
def test_whole_turns_do_not_count_for_a_heading(psi, goal):
    seen = {"psi": psi, "u": 0.0, "v": 0.0, "r": 0.0, "heading_ref": goal}
    error = Ticking(nearest_heading(bang_bang_heading())).tick(0.0, seen)["heading_error"]
    assert abs(error) <= math.pi + 1e-9
    assert math.remainder(error - (psi - goal), 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_loss_at_the_rudders_end_weakens_the_table_there_only():
    (_, whole), (_, half) = lossy_tables(0.0), lossy_tables(0.5)
    straight = list(whole.rudder).index(0.0)
    assert half.values[straight] == pytest.approx(whole.values[straight])
    assert half.values[0] == pytest.approx(0.5 * whole.values[0])


def test_the_loop_counts_the_ticks_at_which_the_law_wants_too_much():
    """One row for each tick: the count grows where the rudder's limit or the table's end is passed."""
    t, c = fly(Imperfections.only("saturation", "dead_zone"), until=3.0)
    left, ahead = (np.where(np.abs(c[f"force_{a}"]) > 0.05, c[f"force_{a}"], 0.0) for a in "yx")
    wanted = np.arctan2(left, ahead)
    angle = np.where(np.abs(wanted) > math.pi / 2, wanted - np.sign(wanted) * math.pi, wanted)
    p = actuator_limits().default_parameters
    beyond = (angle < p["saturation.angle_lowest"]) | (angle > p["saturation.angle_highest"])
    assert 0 < beyond.sum() < len(t)
    assert c["rudder_clipped"] == pytest.approx(np.cumsum(beyond))
    assert fly(Imperfections.only(), until=1.0)[1]["rudder_clipped"][-1] == 0
    assert fly(Imperfections.only("tables"), until=1.0)[1]["rudder_clipped"][-1] > 0


@pytest.mark.slow
def test_a_users_tables_are_those_of_the_loop():
    """A fan with half the force at every speed, given as both tables, or as either alone."""
    weak = fan_tables(lambda speed, rudder: 0.5 * fan_force(speed, rudder), name="weak")
    most = []
    for tables in (None, weak, weak[1]):
        block = autopilot(LAW, references=TOLD, start=START, tables=tables)
        told = block.compile().simulate(np.arange(1001) * 0.001)
        c = dict(zip(told.output_labels, np.asarray(told.outputs), strict=True))
        limits = block.default_parameters
        most.append((np.abs(c["thrust"]).max(), limits["saturation.ahead"], limits["saturation.astern"]))
    for found in most[1:]:
        assert found[0] == pytest.approx(0.5 * most[0][0], rel=0.05)
        assert found[1] == pytest.approx(0.5 * fan_force(12000.0), rel=0.03)
        assert found[2] == pytest.approx(-0.5 * fan_force(-12000.0), rel=0.03)


def test_one_measured_table_gives_the_other():
    lookup, reverse = fan_tables()
    speeds = np.array([-11000.0, -7000.0, 4000.0, 8000.0, 11500.0])
    for found in (table_pair(lookup)[1], table_pair(reverse)[1]):
        for row, angle in enumerate(found.rudder):
            made = np.interp(speeds, found.columns, found.values[row])
            assert made == pytest.approx(fan_force(speeds, angle), abs=4e-3)
    wanted = np.array([-0.6, 0.4, 1.2])
    backward = table_pair(reverse)[0]
    for row, angle in enumerate(backward.rudder):
        speed = np.interp(wanted, backward.columns, backward.values[row])
        assert fan_force(speed, angle) == pytest.approx(wanted, abs=4e-3)
    assert table_pair([reverse, lookup]) == (lookup, reverse)


@pytest.mark.slow
def test_a_users_servo_and_beacons_are_those_of_the_loop(tmp_path):
    file = tmp_path / "servo.csv"
    file.write_text("pulse_ms,angle_deg\n1.0,-10\n1.5,0\n2.0,10\n")
    block = autopilot(LAW, references=TOLD, start=START, servo=read_servo_table(file))
    told = block.compile().simulate(np.arange(1001) * 0.001)
    c = dict(zip(told.output_labels, np.asarray(told.outputs), strict=True))
    # (4.3) turns a rudder of 10 degrees to a force of (10 + 0.566)/1.4 degrees at most
    assert math.degrees(np.abs(c["rudder"]).max()) == pytest.approx(10.566 / 1.4, abs=1e-6)
    far = Beacons([(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)], 2.0)
    found = autopilot(LAW, references=TOLD, navigation="cricket", beacons=far).default_parameters
    assert found["cricket_ranges.beacon_2_x"] == found["range_solver.beacon_2_x"] == 3.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("pulse,angle\n1,2\n", "row 1: expected pulse_ms,angle_deg, found 'pulse,angle'"),
        ("pulse_ms,angle_deg\n1.0,-10\n1.5\n", "row 3: expected two numbers, found '1.5'"),
        ("pulse_ms,angle_deg\n1.0,-10\n1.5,x\n", "row 3: expected two numbers, found '1.5,x'"),
        ("pulse_ms,angle_deg\n1.0,-10\n1.5,0\n2.0,-3\n", "angles must be monotone: entry 3"),
        ("pulse_ms,angle_deg\n", "expected two or more pulses and as many angles"),
    ],
)
def test_a_wrong_servo_table_is_refused_in_one_line(tmp_path, text, said):
    file = tmp_path / "servo.csv"
    file.write_text(text)
    with pytest.raises(InputError) as refused:
        read_servo_table(file)
    assert said in str(refused.value) and "servo.csv" in str(refused.value)
    assert "\n" not in str(refused.value)


# ---- wrong arguments ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: autopilot(LAW, navigation="magnetmeter"), "did you mean 'magnetometer'?"),
        (lambda: autopilot(LAW, rudder_loss=1.0), "rudder_loss must be at least 0 and less than 1"),
        (lambda: autopilot(LAW, period=-0.01), "autopilot: period must be positive, found -0.01"),
        (lambda: autopilot(LAW, tables="mine.csv"), "autopilot: tables: expected a FanTable or a sequence"),
        (lambda: autopilot(LAW, tables=[fan_tables()[0]] * 2), "tables over forces and over speeds, found"),
        (
            lambda: autopilot(LAW, servo="mine.csv"),
            "autopilot: servo: expected a ServoTable or None, found 'mine.csv'",
        ),
        (lambda: autopilot(LAW, tables=fan_tables(), rudder_loss=0.1), "rudder_loss belongs to the stand-in"),
        (
            lambda: autopilot(LAW, beacons=3, navigation="cricket"),
            "beacons: expected a Beacons or None, found 3",
        ),
        (lambda: autopilot(LAW, beacons=k06_beacons()), "belong to navigation 'cricket', found 'error_mo"),
        (lambda: Imperfections.only("brakes"), "unknown imperfection 'brakes'; did you mean 'brake'?"),
        (lambda: Imperfections().without("table"), "did you mean 'tables'?"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_line(call, said):
    with pytest.raises(InputError) as refused:
        call()
    assert said in str(refused.value) and "\n" not in str(refused.value)
