"""Navigation over recorded logs, and in the loop with a continuous platform (K06's rotating bench)."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    K06_NOISE,
    aided_ins,
    coupled_filter,
    heading_filter,
    ins_mechanisation,
    noise_from_sensors,
    range_filter,
    run_ins,
    simulate_runs,
)
from hovercontrol.craft.hardware.sensors import Beacons
from hovercontrol.craft.models.vehicles import c17_simulation
from tests.blocks.simulation.loops import run_loop

ARM, RATE = 0.3048, -2.9  # 12 inches, -166 deg/s
DT = IMU_PERIOD


def bench(seconds, noise, rng, dt=DT):
    """K06 section 6.2.1.4: X tangential, Y inward; magnetometer at each tick, position once a second."""
    t = np.arange(0, seconds, dt)
    n = len(t)
    Q1, R1, Q2, R2 = noise.Q1[0], noise.R1, noise.Q2[:2], noise.R2[0]
    psi = RATE * t
    truth = {
        "psi_hat": psi,
        "x_hat": ARM * np.sin(psi),
        "y_hat": -ARM * np.cos(psi),
        "u_hat": ARM * RATE + 0 * t,
        "v_hat": 0 * t,
        "r_hat": RATE + 0 * t,
    }
    imu = {
        "time": t,
        "acceleration_x": rng.normal(size=n) * np.sqrt(Q2[0]),
        "acceleration_y": ARM * RATE**2 + rng.normal(size=n) * np.sqrt(Q2[1]),
        "yaw_rate": RATE + rng.normal(size=n) * np.sqrt(Q1),
    }
    compass = {"time": t, "heading_aid": np.angle(np.exp(1j * (psi + rng.normal(size=n) * np.sqrt(R1))))}
    at = slice(None, None, round(1 / dt))
    fix = {"time": t[at]}
    for name in ("x", "y"):
        fix[f"fix_{name}"] = truth[f"{name}_hat"][at] + rng.normal(size=len(t[at])) * np.sqrt(R2)
    return imu, compass, fix, truth


def named(response):
    return dict(zip(response.output_labels, response.outputs, strict=True))


def rms(found, truth, names, after):
    return np.sqrt(sum(np.mean((found[n] - truth[n])[after:] ** 2) for n in names))


def test_a_log_gives_what_the_block_gives_tick_by_tick(rng):
    imu, compass, fix, _ = bench(3.0, K06_NOISE, rng)
    block = aided_ins(pose=(0, -ARM, 0), velocity=(ARM * RATE, 0))
    found = named(run_ins(block, imu, [compass, fix]))
    flags = np.isin(imu["time"], fix["time"])
    data = {k: v for k, v in imu.items() if k != "time"}
    data |= {"heading_aid": compass["heading_aid"], "heading_aid_valid": np.ones(len(flags))}
    data |= {"fix_valid": flags.astype(float)}
    for name in ("fix_x", "fix_y"):
        data[name] = np.zeros(len(flags))
        data[name][flags] = fix[name]
    for name, values in simulate_runs(block, data).items():
        np.testing.assert_allclose(found[name], values[:, 0], rtol=1e-9, atol=1e-9, err_msg=name)


def test_rotating_bench_errs_no_more_than_k06_measured(rng):
    """Table 6.7, magnetometer and encoder at -166 deg/s: 0.5 deg, 3.7 deg/s, 7.5 cm/s, 3.4 cm.

    The heading all but follows the magnetometer, as its printed matrices make it; the rest has no vibration
    here and an exact encoder.
    """
    imu, compass, fix, truth = bench(20.0, replace(K06_NOISE, R2=(1e-8, 1e-8)), rng)
    block = aided_ins(pose=(0, -ARM, 0), velocity=(ARM * RATE, 0))
    found, after = named(run_ins(block, imu, [compass, fix])), 160
    assert np.degrees(rms(found, truth, ["psi_hat"], after)) == pytest.approx(0.5, rel=0.3)
    assert np.degrees(rms(found, truth, ["r_hat"], after)) < 3.7
    assert 0.2 * 0.075 < rms(found, truth, ["u_hat", "v_hat"], after) < 0.075
    assert 0.2 * 0.034 < rms(found, truth, ["x_hat", "y_hat"], after) < 0.034


def test_tables_may_be_data_frames_with_gaps_of_nan(rng):
    imu, compass, fix, _ = bench(1.0, K06_NOISE, rng)
    compass["heading_aid"][::2] = np.nan
    block = aided_ins()
    found = run_ins(block, pd.DataFrame(imu), [pd.DataFrame(compass), pd.DataFrame(fix)])
    table = found.to_pandas()
    assert len(table) == len(imu["time"])
    innovations = named(found)["heading_aid_innovation"]
    assert not innovations[::2].any() and innovations[1::2].all()


def test_unequal_steps_are_taken_as_they_are(rng):
    """A jittering clock: the integral of an even spin and push is still right."""
    t = np.cumsum(rng.uniform(0.6, 1.4, 400)) * DT
    t -= t[0]
    imu = {"time": t, "acceleration_x": 0.5 + 0 * t, "acceleration_y": 0 * t, "yaw_rate": 0 * t}
    found = named(run_ins(ins_mechanisation(), imu))
    np.testing.assert_allclose(found["x_ins"], 0.25 * t**2, atol=1e-12)
    one = named(run_ins(coupled_filter(), imu))["P[0,0]"]
    noise = noise_from_sensors()
    bias = noise.P1[1] * t[-1] ** 2
    assert one[-1] == pytest.approx(noise.P1[0] + noise.Q1[0] * t[-1] / DT + bias, rel=1e-3)


@pytest.mark.slow
def test_ranges_of_a_log_count_one_by_one():
    beacons, t = [(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)], np.arange(0, 2, 0.01)
    zero = np.zeros(len(t))
    imu = {"time": t, "acceleration_x": zero, "acceleration_y": zero, "yaw_rate": zero}
    at = np.array([1.02, 0.98])
    ranges: dict[str, object] = {"time": [0.5, 1.0, 1.5]}
    for k, beacon in enumerate(beacons, 1):
        ranges[f"range_{k}"] = np.full(3, np.hypot(np.hypot(*(at - beacon)), 2.0))
        ranges[f"range_{k}"][k - 1] = np.nan
    block = range_filter(Beacons(beacons, 2.0), pose=(1, 1, 0), period=0.01, range_noise=1e-3)
    found = named(run_ins(block, imu, [ranges]))
    assert [found["x_hat"][-1], found["y_hat"][-1]] == pytest.approx(at, abs=2e-3)
    seen = [np.count_nonzero(found[f"range_{k}_innovation"]) for k in (1, 2, 3)]
    assert seen == [2, 2, 2]


def test_progress_is_told(rng):
    imu, *_ = bench(15.0, K06_NOISE, rng)
    told = []
    run_ins(ins_mechanisation(), imu, progress=told.append)
    assert told and told == sorted(told) and 0 < told[-1] <= 1


# ---- in the loop -----------------------------------------------------------------------------------------


def test_navigation_in_a_hybrid_loop():
    """A platform that spins, an IMU on its arm, an encoder once a second: the filter is right within its own
    3 sigma, and the same in C."""
    psi, r = Signal("psi", "rad"), Signal("r", "rad/s")
    rate, arm = Signal("rate", "rad/s", start=RATE), Signal("arm", "m", start=ARM)
    platform = Block(
        "platform", [psi], [], [psi, r], [rate], {"psi": rate.symbol}, output_expressions={"r": rate.symbol}
    )
    tick = Signal("tick", "1")
    fresh = sp.Piecewise((1, sp.Eq(sp.Mod(tick.symbol, 50), 0)), (0, True))
    names = ["acceleration_x", "acceleration_y", "yaw_rate", "heading_aid", "heading_aid_valid"]
    names += ["fix_x", "fix_y", "fix_valid"]
    units = ["m/s^2", "m/s^2", "rad/s", "rad", "1", "m", "m", "1"]
    told = [
        0, arm.symbol * r.symbol**2, r.symbol, psi.symbol, fresh,
        arm.symbol * sp.sin(psi.symbol), -arm.symbol * sp.cos(psi.symbol), fresh,
    ]  # fmt: skip
    sensors = Block(
        "sensors",
        [tick],
        [psi, r],
        [Signal(n, u) for n, u in zip(names, units, strict=True)],
        [arm],
        {"tick": tick.symbol + 1},
        dict(zip(names, told, strict=True)),
        period=0.02,
    )
    filters = aided_ins(noise=noise_from_sensors(period=0.02), period=0.02, pose=(0.02, -ARM, 0.01))
    # a hybrid Block has no room for brackets in the names of held outputs
    filters = rename(filters, {s.name: re.sub(r"\W", "_", s.name).strip("_") for s in filters.outputs})
    response = run_loop(platform, [sensors, filters], 10.0)
    found = dict(zip(response.output_labels, response.outputs, strict=True))
    assert abs(found["psi_hat"][-1] - found["psi"][-1]) < 3 * np.sqrt(found["P1_0_0"][-1])
    true = [ARM * np.sin(found["psi"][-1]), -ARM * np.cos(found["psi"][-1])]
    for name, value, P in zip(("x_hat", "y_hat"), true, ("P2_2_2", "P2_3_3"), strict=True):
        assert abs(found[name][-1] - value) < 3 * np.sqrt(found[P][-1])
    assert abs(found["u_hat"][-1] - ARM * RATE) < 0.05
    loop = interconnect([platform, sensors, filters], "loop").compile()
    in_c = named(loop.simulate(response.time))
    for name in ("psi_hat", "x_hat", "u_hat", "fix_x_innovation", "P2_2_2"):
        np.testing.assert_allclose(in_c[name], found[name], rtol=1e-6, atol=1e-9, err_msg=name)


# ---- wrong input -----------------------------------------------------------------------------------------


def still(ticks=10):
    zero = [0.0] * ticks
    time = [k * DT for k in range(ticks)]
    return {"time": time, "acceleration_x": zero, "acceleration_y": zero, "yaw_rate": zero}


def changed(**columns):
    return {**still(), **columns}


def without(name):
    return {k: v for k, v in still().items() if k != name}


late = [0.0, DT, 2 * DT, 1.5 * DT, *(k * DT for k in range(4, 10))]
missing = [k * DT for k in (0, 1, 2, 6, 7, 8, 9, 10, 11, 12)]
spoilt = [0.0, 0.0, float("nan"), *[0.0] * 7]
FIX = {"time": [2 * DT], "fix_x": [0.0], "fix_y": [0.0]}


@pytest.mark.parametrize(
    ("imu", "aids", "text"),
    [
        (changed(time=late), [], "imu row 3: time 0.0098304 s is not after that of the row before"),
        (changed(time=missing), [], "imu row 3 at 0.0393216 s is 0.0262144 s after the row before"),
        (changed(yaw_rate=spoilt), [], "imu row 2: yaw_rate = nan is not finite"),
        (changed(yaw_rate=[0.0] * 9), [], "'yaw_rate' must have 10 rows, found shape (9,)"),
        (changed(yaw_rate=["a"] * 10), [], "column 'yaw_rate' must hold numbers"),
        (changed(time=[]), [], "imu has no rows"),
        (without("time"), [], "imu has no column 'time'"),
        (without("yaw_rate") | {"yawrate": [0.0] * 10}, [], "did you mean 'yawrate'"),
        (
            still(),
            [FIX, {"time": [0.0], "heading": [0.0]}],
            "aids[1]: block 'ins' does not measure 'heading'",
        ),
        (still(), [{"time": [0.0], "fix_x": [0.0]}], "aids[0] has no column 'fix_y'; did you mean 'fix_x'"),
        (still(), [FIX | {"time": [7.0]}], "aids[0] row 0 at 7 s is out of the IMU's time, 0 to 0.0589824 s"),
        (still(), [FIX | {"time": [-1.0]}], "is out of the IMU's time"),
        (still(), [FIX | {"fix_x": [float("inf")]}], "aids[0] row 0: fix_x = inf is not finite"),
        (still(), [{"time": [0.0], "range_5": [1.0]}], "does not measure 'range_5'"),
    ],
)
def test_wrong_logs_are_said_in_one_line(imu, aids, text):
    with pytest.raises(InputError) as error:
        run_ins(aided_ins(), imu, aids)
    assert text in str(error.value)
    assert "\n" not in str(error.value)


def test_beacon_numbers_must_match():
    block = range_filter(Beacons([(0, 0), (1, 0), (0, 1)], 2.0))
    with pytest.raises(InputError, match="does not measure 'range_4'; did you mean"):
        run_ins(block, still(), [{"time": [0.0], "range_4": [1.0]}])


@pytest.mark.slow
def test_ranges_of_several_units_say_whose_they_are():
    block = range_filter(Beacons([(0, 0), (1, 0), (0, 1)], 2.0), [(0.1, 0.0), (-0.1, 0.0)])
    ranges = {"time": [0.0], **{f"range_{k}": [2.0] for k in (1, 2, 3)}}
    with pytest.raises(InputError, match=r"aids\[0\] has no column 'range_unit'"):
        run_ins(block, still(), [ranges])
    one, two = (run_ins(block, still(), [ranges | {"range_unit": [unit]}]) for unit in (1, 2))
    assert named(one)["x_hat"][-1] < named(two)["x_hat"][-1]


def test_longer_gaps_when_allowed():
    assert len(run_ins(aided_ins(), changed(time=missing), max_gap=0.05).time) == 10


@pytest.mark.parametrize(
    ("block", "text"),
    [
        (c17_simulation().plant(), "is not sampled"),
        (heading_filter(), "input 'psi_ins' of block 'heading_filter' is neither of the IMU nor of an aid"),
    ],
)
def test_other_blocks_are_refused(block, text):
    with pytest.raises(InputError, match=text):
        run_ins(block, still())


def test_parameters_are_checked():
    with pytest.raises(InputError, match="unknown parameter"):
        run_ins(aided_ins(), still(), params={"heading.R2": 1.0})
    with pytest.raises(InputError, match="max_gap must be positive"):
        run_ins(aided_ins(), still(), max_gap=-1.0)
