"""The real loop under the pilot's orders: link, navigation, lift, calibration, against what they must do."""

import math
import time
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hovercontrol.app.cockpit.laws import CHOICES
from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.real_block import ground_station
from hovercontrol.app.cockpit.real_loop import RealLoop
from hovercontrol.app.cockpit.recorder import Recorder
from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.links import TABLE_5_1
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.identify import identify
from hovercontrol.logs import read_log

pytestmark = pytest.mark.slow  # building the loop takes ten seconds

MOTION = ("x", "y", "psi", "u", "v", "r")
MASS, INERTIA, ARM, GRAVITY = 2.6, 0.096, 0.32, 9.80665


@cache
def real_loop():
    """The loop, built when a test first needs it."""
    return RealLoop(vehicle("hoverdemon"))


@pytest.fixture
def loop():
    real_loop().command(
        law="manual",
        stick=(0.0, 0.0),
        disturbances={key: None for key in real_loop().switched_on},
        switches={"transmit": True, "lift": True},
    )
    for key, choice in CHOICES.items():
        real_loop().references[key] = {s.name: s.start for s in choice.references}
    real_loop().reset()
    return real_loop()


def rows(loop, until, step=0.001):
    """Fly and return the signals at every step, by name."""
    seen = []
    for _ in range(round((until - loop.time) / step)):
        loop.advance(round(loop.time + step, 9))
        seen.append(loop.signals())
    return {name: np.array([row[name] for row in seen]) for name in seen[0]}


def test_the_craft_moves_by_k06s_equations_under_the_force_that_acts(loop):
    loop.command(stick=(0.7, 0.5))
    seen = rows(loop, 3.0)
    t, thrust, rudder = seen["time"], seen["thrust"], seen["rudder"]

    def k06(now, s):  # (2.10)
        k = min(round(now / 0.001 - 0.5), len(t) - 1)  # row k holds what acts from its time on
        F, a = (thrust[k - 1], rudder[k - 1]) if k else (0.0, 0.0)
        _, _, psi, u, v, r = s
        return [
            u * math.cos(psi) - v * math.sin(psi),
            u * math.sin(psi) + v * math.cos(psi),
            r,
            v * r + F * math.cos(a) / MASS,
            -u * r + F * math.sin(a) / MASS,
            -ARM * F * math.sin(a) / INERTIA,
        ]

    exact = solve_ivp(k06, (0, 3), [0] * 6, rtol=1e-7, atol=1e-9, max_step=0.002).y[:, -1]
    assert [seen[name][-1] for name in MOTION] == pytest.approx(exact, abs=5e-3)
    assert seen["r"][-1] < -0.2  # stick to the right, bow to the right


def test_a_command_acts_after_the_links_delay_and_the_servos_tick(loop):
    waits = []
    for k in range(40):
        loop.advance(round(loop.time + 1.0 + 0.0137 * (k % 7), 3))
        loop.command(stick=(0.0 if k % 2 else 1.0, 0.0))
        begun = loop.time
        while abs(loop.signals()["thrust"] - (0.0 if k % 2 else 2.0)) > 0.1:
            loop.advance(round(loop.time + 0.001, 9))
            assert loop.time - begun < 0.2
        waits.append(loop.time - begun)
    _, _, least, most = (v / 1000 for v in TABLE_5_1["linksys_22.0_uplink"])
    # A base tick, up to 20 ms until the next message, its delay, up to 20 ms until the servo's next tick.
    assert min(waits) >= least and max(waits) <= 0.002 + 0.02 + most + 0.02
    assert 0.045 < np.mean(waits) < 0.08  # 41 ms of link and two waits of 10 ms on average


def test_the_ground_station_knows_what_the_navigation_told_as_long_ago_as_it_says(loop):
    loop.command(law="turn", references={"yaw_rate_ref": 2.0})
    seen = rows(loop, 4.0)
    age = np.round(1000 * seen["downlink_age"]).astype(int)
    now = np.round(1000 * seen["time"]).astype(int)
    sent = now - age
    there = sent > 100
    assert seen["power_on_time_received"][there] == pytest.approx(sent[there] / 1000, abs=1e-9)
    for name in ("x", "psi", "u", "r"):
        told = seen[f"{name}_measured"][sent[there] - 1]  # rows begin at 1 ms
        assert seen[f"{name}_told_received"][there] == pytest.approx(told, abs=1e-12), name
    _, _, least, most = TABLE_5_1["linksys_22.0_downlink"]
    assert least <= age[there].min() and age[there].max() <= most + 6


def test_k06s_laws_reach_what_k06s_simulation_reaches(loop):
    loop.command(law="forward", references={"surge_ref": 1.1})
    assert rows(loop, 20.0, 0.01)["u"][1000:].mean() == pytest.approx(1.1, abs=0.1)  # figure 6.8: +-0.1 m/s
    loop.command(law="stop")
    loop.advance(60.0)
    loop.command(law="turn", references={"yaw_rate_ref": 3.0})
    assert rows(loop, 90.0, 0.01)["r"][1500:].mean() == pytest.approx(3.0, abs=0.1)  # figure 6.10


def test_a_heading_is_reached_by_the_nearest_turn_and_guidance_begins_anew(loop):
    loop.command(law="turn", references={"yaw_rate_ref": 2.0})
    loop.advance(8.0)
    begun = loop.signals()["psi"]
    loop.command(law="heading", references={"heading_ref": -2.5})
    seen = rows(loop, 60.0, 0.01)
    off = np.array([math.remainder(psi + 2.5, math.tau) for psi in seen["psi"][2000:]])
    assert abs(off.mean()) < 0.1 and off.std() < 0.45  # as in k06-real-heading-bangbang-rest
    assert np.abs(seen["psi"] - begun).max() < 2 * math.tau
    assert loop.modes() == {"heading_mode": ("stop", "turn")}


def test_without_transmission_nothing_is_sent_and_the_craft_stops_its_fans(loop):
    loop.command(stick=(1.0, 0.0))
    loop.advance(2.0)
    loop.command(switches={"transmit": False})
    sent = loop.signals()["uplink_messages"]
    seen = rows(loop, 4.0, 0.01)
    assert seen["uplink_messages"][-1] == sent  # that of this very instant at most
    pushed = seen["time"][seen["thrust"] > 0].max()
    assert 0.2 < pushed - 2.0 < 0.4  # age 0.4 s; the last message was on its way
    assert seen["failsafe_on"][-1] == 1 and seen["u"][-1] == pytest.approx(0.0, abs=1e-3)
    assert "Transmission is off" in loop.notes()
    loop.command(switches={"transmit": True})
    loop.advance(4.5)
    assert (
        loop.signals()["thrust"] == pytest.approx(2.0, abs=0.1) and loop.signals()["uplink_messages"] > sent
    )


def test_without_lift_the_floor_stops_the_craft_and_holds_it(loop):
    loop.command(stick=(1.0, 0.0))
    loop.advance(3.0)
    loop.command(switches={"lift": False})
    seen = rows(loop, 6.0, 0.001)
    u, t = seen["u"], seen["time"]
    falling = (u > 0.2) & (u < 0.8 * u.max())
    slope = np.polyfit(t[falling], u[falling], 1)[0]
    assert slope == pytest.approx(-0.5 * GRAVITY + 2.0 / MASS, rel=0.03)  # friction less thrust
    assert abs(u[-1]) < 2e-3 and seen["thrust"][-1] == pytest.approx(2.0, abs=0.1)
    assert "stands on its skirt" in loop.notes()


def test_calibration_finds_the_platforms_tilt_and_the_navigation_begins_anew_where_it_is(loop):
    tilt = {"roll": math.radians(-3.0), "pitch": math.radians(2.0)}
    loop.command(stick=(1.0, 0.2))
    loop.advance(1.5)
    loop.command(stick=(0.0, 0.0), switches={"lift": False}, disturbances={"platform_tilt": tilt})
    loop.advance(3.0)
    loop.command(switches={"calibrate": True})
    loop.advance(3.5)
    assert loop.switches["calibrate"] and "keep still" in loop.notes()
    before = loop.signals()
    loop.advance(5.2)
    seen = loop.signals()
    assert not loop.switches["calibrate"]
    bias = 3 * 0.025 / GRAVITY  # what the accelerometers' own biases of 2.5 cm/s^2 add
    for name in tilt:
        assert seen[f"platform_{name}_received"] == pytest.approx(tilt[name], abs=bias), name
    assert abs(before["acceleration_y_bias_hat_received"]) > 0.02  # the filter was still looking for it
    for name in ("u", "v", "r"):
        assert abs(seen[f"{name}_measured"]) < 0.05, name
    place = [abs(seen[f"{name}_measured"] - before[f"{name}_measured"]) for name in ("x", "y", "psi")]
    assert max(place) < 0.15


def test_packets_are_lost_by_k06s_premise_of_one_retransmission(loop):
    q = 0.5
    loop.command(disturbances={"packet_loss": {"part": q}})
    loop.advance(60.0)
    seen = loop.signals()
    for way in ("uplink", "downlink"):
        n = seen[f"{way}_messages"]
        spread = math.sqrt(q**2 * (1 - q**2) / n)
        assert seen[f"{way}_lost"] / n == pytest.approx(q**2, abs=4 * spread), way
    loop.command(disturbances={"packet_loss": {"part": 1.0}})
    loop.advance(61.0)
    assert loop.signals()["failsafe_on"] == 1 and "hears no commands" in loop.notes()


def test_disturbances_act_on_the_craft_as_in_the_ideal_loop(loop):
    ideal = Loop(vehicle("hoverdemon"))
    loop.advance(1.0)  # the lift fan is on
    for own in (loop, ideal):
        own.command(
            disturbances={"wind": {"x": 1.0, "y": -0.5}, "air_drag": {}, "slope": {"x": 0.1, "y": 0.0}}
        )
        own.advance(own.time + 3.0)
    for name in MOTION:
        assert loop.signals()[name] == pytest.approx(ideal.signals()[name], abs=1e-6), name
    loop.command(disturbances={"gusts": {}})
    loop.advance(6.0)
    assert loop.signals()["wind_x"] != 1.0


def test_reset_repeats_the_flight_to_the_bit(loop):
    def flight():
        loop.command(law="forward")
        loop.advance(1.0)
        loop.command(law="stop", disturbances={"gusts": {}, "air_drag": {}})
        loop.advance(2.0)
        found = loop.signals()
        loop.command(disturbances={"gusts": None, "air_drag": None})
        return found

    first = flight()
    loop.reset()
    assert loop.time == 0 and all(loop.signals()[name] == 0 for name in MOTION)
    assert flight() == first


def test_a_recording_is_a_log_in_which_identify_finds_the_craft(loop, tmp_path):
    recorder = Recorder([s.name for s in loop.inputs], loop.logged)
    for k in range(4000):
        if k % 100 == 0:
            turn = (-0.9, 0.6, -0.3, 0.8)[k // 100 % 4]
            loop.command(stick=(1.0 if k // 400 % 2 else -0.6, turn))
        recorder.add(loop.signals())
        loop.advance(round(loop.time + 0.01, 9))
    log = read_log(recorder.save(tmp_path), inputs=["thrust", "rudder"])
    assert {f"true_{name}" for name in MOTION} <= set(log.columns)
    assert np.abs(log["u"] - log["true_u"]).max() > 0.01  # it is the navigation's
    wrong = vehicle("hoverdemon").with_coefficients({"thrust": 0.2, "rudder_torque": 1.0})
    found = identify(wrong, [log])
    assert found["thrust"].value == pytest.approx(1 / MASS, rel=0.1)
    assert found["rudder_torque"].value == pytest.approx(ARM / INERTIA, rel=0.1)


def test_it_flies_many_times_faster_than_real_time(loop):
    loop.command(law="turn")
    begun = time.thread_time()
    rows(loop, 10.0, 0.01)
    assert time.thread_time() - begun < 10.0 / 5


def test_it_is_one_block_whose_inputs_are_the_pilots_orders():
    block = ground_station(vehicle("hoverdemon"))
    assert [s.name for s in block.inputs] == [
        "law", "stick_ahead", "stick_right", "transmit", "lift_command", "calibrate",
    ]  # fmt: skip
    assert block.inputs[0].modes == tuple(CHOICES)


WRONG = [
    ({"law": "foward"}, "did you mean 'forward'"),
    ({"switches": {"transmitt": True}}, "did you mean 'transmit'"),
    ({"switches": {"lift": 1}}, "expected true or false, found 1"),
    ({"disturbances": {"packet_loss": {"part": 2.0}}}, "out of its bounds"),
    ({"stick": (2.0, 0.0)}, "out of its bounds"),
]


@pytest.mark.parametrize(("order", "text"), WRONG)
def test_a_wrong_order_is_refused_whole_and_in_one_line(loop, order, text):
    loop.command(law="turn", stick=(0.1, 0.2), switches={"lift": False})
    held = (loop.law, loop.stick, dict(loop.references), dict(loop.switched_on), dict(loop.switches))
    given_order = {"stick": (0.5, 0.5), "disturbances": {"gusts": {}}, "switches": {"lift": True}, **order}
    with pytest.raises(InputError, match=text) as refused:
        loop.command(**given_order)
    assert "\n" not in str(refused.value)
    assert (
        loop.law, loop.stick, dict(loop.references), dict(loop.switched_on), dict(loop.switches)
    ) == held  # fmt: skip


def test_the_ideal_loop_has_no_switches():
    with pytest.raises(InputError, match="the ideal loop has none"):
        Loop(vehicle("hoverdemon")).command(switches={"transmit": False})


@st.composite
def orders(draw):
    key = draw(st.sampled_from(sorted(CHOICES)))
    what = draw(st.sampled_from(sorted(real_loop().disturbances)))
    knobs = [k.signal for k in real_loop().disturbances[what].knobs]
    return {
        "law": key,
        "references": {s.name: draw(st.floats(s.lower, s.upper)) for s in CHOICES[key].references},
        "disturbances": {
            what: draw(st.sampled_from([None, {s.name: draw(st.floats(s.lower, s.upper)) for s in knobs}]))
        },
        "stick": (draw(st.floats(-1, 1)), draw(st.floats(-1, 1))),
        "switches": {draw(st.sampled_from(sorted(real_loop().switches))): draw(st.booleans())},
    }


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(told=st.lists(orders(), min_size=1, max_size=4))
def test_no_order_within_the_bounds_ever_breaks_the_flight(loop, told):
    for order in told:
        loop.command(**order)
        loop.advance(round(loop.time + 0.3, 9))
        assert all(map(math.isfinite, loop.signals().values()))
