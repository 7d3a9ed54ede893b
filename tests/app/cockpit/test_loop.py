"""The craft under the laws that a pilot may choose, against exact solutions and K06's figures."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hovercontrol.app.cockpit.disturbances import DISTURBANCES
from hovercontrol.app.cockpit.gusts import gusts
from hovercontrol.app.cockpit.laws import CHOICES
from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.models.modelfile import model_from_table
from hovercontrol.craft.models.vehicles import VEHICLES, vehicle

MOTION = ("x", "y", "psi", "u", "v", "r")
MASS, INERTIA, ARM = 2.6, 0.096, 0.32  # K06 section 4.3


@pytest.fixture
def loop():
    return Loop(vehicle("hoverdemon"))


def motion(loop):
    signals = loop.signals()
    return [signals[name] for name in MOTION]


def test_the_stick_gives_thrust_and_rudder_and_the_craft_moves_by_k06s_equations(loop):
    loop.command(stick=(0.5, 0.4))
    loop.advance(3.0)
    seen = loop.signals()
    thrust, rudder = seen["thrust"], seen["rudder"]
    assert thrust > 0 and rudder > 0

    def k06(t, s):  # (2.10)
        _, _, psi, u, v, r = s
        return [
            u * math.cos(psi) - v * math.sin(psi),
            u * math.sin(psi) + v * math.cos(psi),
            r,
            v * r + thrust * math.cos(rudder) / MASS,
            -u * r + thrust * math.sin(rudder) / MASS,
            -ARM * thrust * math.sin(rudder) / INERTIA,
        ]

    exact = solve_ivp(k06, (0, 3), [0] * 6, rtol=1e-10, atol=1e-12).y[:, -1]
    assert motion(loop) == pytest.approx(exact, abs=1e-8)
    assert seen["r"] < 0  # stick to the right, bow to the right


def test_forward_approaches_its_speed_as_the_law_says(loop):
    loop.command(law="forward", references={"surge_ref": 1.1})
    for t in (1.0, 2.6, 8.0):
        loop.advance(t)
        assert loop.signals()["u"] == pytest.approx(1.1 * (1 - math.exp(-t / MASS)), abs=2e-3)  # k1 = 1 kg/s


def test_reverse_reaches_its_speed(loop):
    loop.command(law="reverse", references={"surge_ref": -0.76})
    loop.advance(15.0)
    assert loop.signals()["u"] == pytest.approx(-0.76, abs=0.01)


@pytest.mark.slow
def test_k06s_craft_turns_at_three_rad_s_and_with_yaw_friction_at_one_and_three_quarters(loop):
    loop.command(law="turn", references={"yaw_rate_ref": 3.0})
    loop.advance(20.0)
    assert loop.signals()["r"] == pytest.approx(3.0, abs=0.01)  # figure 6.10, ideal
    loop.reset()
    loop.command(disturbances={"yaw_linear_drag": {}})
    loop.advance(24.0)
    assert loop.signals()["r"] == pytest.approx(1.75, abs=0.02)  # figure 6.24, field


@pytest.mark.slow
def test_the_stick_sets_velocity_and_turn_rate_and_a_law_does_the_rest(loop):
    def after(stick, seconds):
        loop.command(law="motion", stick=stick)
        loop.advance(loop.time + seconds)
        return loop.signals()

    assert after((1.0, 0.0), 12.0)["u"] == pytest.approx(1.1, abs=0.03)
    assert after((-0.5, 0.0), 0.5)["surge_ref"] == 0.0  # it is stopped before it is told to go astern
    assert after((-0.5, 0.0), 16.0)["u"] == pytest.approx(-0.38, abs=0.02)
    after((0.0, 0.0), 12.0)
    assert after((0.0, 0.5), 12.0)["r"] == pytest.approx(-0.75, abs=0.04)  # to the right
    after((0.0, 0.0), 12.0)
    slip = after((0.5, 0.5), 15.0)  # ahead and aside at once: the ideal craft has no such steady motion
    assert abs(slip["r"]) < 0.05 and slip["v"] == pytest.approx(ARM * 0.75, abs=0.02)


@pytest.mark.slow
def test_the_stick_steers_under_way_in_the_mean_over_a_weave(loop):
    weave = math.tau / (0.55 * math.hypot(0.25, 0.02))
    loop.command(law="steer", stick=(0.5, -0.5))
    loop.advance(2 * weave)
    begun = loop.signals()
    surges = []
    for k in range(1, 101):
        loop.advance((2 + k / 100) * weave)
        surges.append(loop.signals()["u"])
    assert sum(surges) / 100 == pytest.approx(0.55, rel=0.05)
    assert (loop.signals()["psi"] - begun["psi"]) / weave == pytest.approx(0.25, rel=0.1)


@pytest.mark.parametrize("wanted", [2.0, -2.5])
def test_the_heading_is_reached_by_the_nearest_turn_and_held(loop, wanted):
    loop.command(law="turn", references={"yaw_rate_ref": 2.0})
    loop.advance(8.0)
    begun = loop.signals()["psi"]
    assert begun > math.tau
    loop.command(law="heading", references={"heading_ref": wanted})
    loop.advance(35.0)
    seen = loop.signals()
    assert math.remainder(seen["psi"] - wanted, math.tau) == pytest.approx(0.0, abs=math.radians(1.5))
    assert abs(seen["heading_ref"] - begun) <= math.pi


def test_the_goal_is_reached(loop):
    loop.command(law="goal", references={"goal_x_ref": 1.5, "goal_y_ref": -1.0, "goal_heading_ref": 1.0})
    loop.advance(50.0)
    seen = loop.signals()
    assert math.hypot(seen["x"] - 1.5, seen["y"] + 1.0) < 0.3
    assert math.remainder(seen["psi"] - 1.0, math.tau) == pytest.approx(0.0, abs=math.radians(6))


def test_stop_never_lets_the_kinetic_energy_grow(loop):
    loop.command(stick=(1.0, 0.6))
    loop.advance(2.0)
    before = loop.signals()["energy"]
    u, v, r = motion(loop)[3:]
    assert before == pytest.approx(MASS * (u * u + v * v) / 2 + INERTIA * r * r / 2, rel=1e-9)
    loop.command(law="stop")
    for k in range(1, 40):
        loop.advance(2.0 + 0.1 * k)
        now = loop.signals()["energy"]
        assert now <= before + 1e-9
        before = now


def test_a_wind_carries_a_craft_with_drag_along(loop):
    loop.command(disturbances={"wind": {"x": 1.0, "y": 0.0}})
    assert "drag" in loop.notes()
    loop.advance(1.0)
    assert motion(loop) == [0.0] * 6  # nothing for it to push on
    loop.command(disturbances={"air_drag": {"coefficient": 0.5}})
    assert loop.notes() == ""
    loop.advance(3.0)
    assert loop.signals()["u"] == pytest.approx(1 - math.exp(-0.5 * 2.0), rel=1e-6)
    loop.command(disturbances={"wind": None, "air_drag": None})
    held = loop.signals()["u"]
    loop.advance(4.0)
    assert loop.signals()["u"] == pytest.approx(held, rel=1e-9)


def test_gusts_have_the_strength_they_are_told_and_fade_within_a_second():
    block = Ticking(gusts(), {"gusts.speed": 2.0})
    wind = np.array([tuple(block.tick(0.02 * k, {}).values()) for k in range(40_000)])[200:]
    assert wind.mean(axis=0) == pytest.approx([0, 0], abs=0.4)  # 5 standard errors of 800 gusts
    assert wind.std(axis=0) == pytest.approx([2, 2], rel=0.15)
    after = [np.corrcoef(w[:-50], w[50:])[0, 1] for w in wind.T]
    assert after == pytest.approx([math.exp(-1)] * 2, abs=0.12)
    assert abs(np.corrcoef(wind.T)[0, 1]) < 0.15


def test_disturbances_are_added_to_what_the_craft_has():
    loop = Loop(vehicle("c17_experiment"))
    with_own, more = 0.83, 0.5
    loop.command(stick=(1.0, 0.5))
    loop.advance(1.0)
    spin = [loop.signals()["r"]]
    loop.command(disturbances={"yaw_coulomb": {"coefficient": more}}, stick=(0.0, 0.0))
    loop.advance(1.1)
    spin.append(loop.signals()["r"])
    # r' = -(0.83 + 0.5) sgn r - 0.48 r
    slope = with_own + more
    exact = (abs(spin[0]) + slope / 0.48) * math.exp(-0.048) - slope / 0.48
    assert abs(spin[1]) == pytest.approx(exact, rel=1e-5)


def test_commands_stay_within_the_bounds_of_the_plants_inputs():
    loop = Loop(vehicle("c17_experiment"))
    loop.command(stick=(-1.0, 1.0))
    seen = loop.signals()
    assert (seen["thrust"], seen["rudder"]) == (0.0, pytest.approx(math.radians(26)))


def test_a_craft_of_fans_goes_ahead_astern_and_turns_with_the_stick():
    for stick, name, sign in [((1, 0), "u", 1), ((-1, 0), "u", -1), ((0, 1), "r", -1), ((0, -1), "r", 1)]:
        loop = Loop(vehicle("four_fan"))
        loop.command(stick=stick)
        loop.advance(0.5)
        seen = loop.signals()
        assert sign * seen[name] > 0.05
        other = "r" if name == "u" else "u"
        assert seen[other] == pytest.approx(0, abs=1e-9)


def test_laws_of_k06_are_only_for_craft_pushed_in_newton():
    assert list(Loop(vehicle("hoverdemon")).choices) == list(CHOICES)
    for name in set(VEHICLES) - {"hoverdemon"}:
        assert list(Loop(vehicle(name)).choices) == ["manual"]


@given(keys=st.lists(st.sampled_from(sorted(CHOICES)), min_size=1, max_size=4), push=st.floats(-1, 1))
def test_choosing_another_law_never_moves_the_craft(keys, push):
    loop = shared()
    loop.command(law="manual", stick=(1.0, push))
    for key in keys:
        loop.advance(loop.time + 0.05)
        before = motion(loop)
        loop.command(law=key)
        assert motion(loop) == before


@cache
def shared():
    """The loop of all orders, built when a test first needs it."""
    return Loop(vehicle("hoverdemon"))


@st.composite
def orders(draw):
    key = draw(st.sampled_from(sorted(CHOICES)))
    told = {s.name: draw(st.floats(s.lower, s.upper)) for s in CHOICES[key].references}
    what = draw(st.sampled_from(sorted(DISTURBANCES)))
    knobs = {k.signal.name: draw(st.floats(k.signal.lower, k.signal.upper)) for k in DISTURBANCES[what].knobs}
    stick = (draw(st.floats(-1, 1)), draw(st.floats(-1, 1)))
    return {
        "law": key,
        "references": told,
        "disturbances": {what: draw(st.sampled_from([knobs, None]))},
        "stick": stick,
    }


@given(given_orders=st.lists(orders(), min_size=1, max_size=4))
def test_no_order_within_the_bounds_ever_breaks_the_flight(given_orders):
    shared().reset()
    for k, order in enumerate(given_orders, start=1):
        shared().command(**order)
        shared().advance(0.1 * k)
        seen = shared().signals()
        assert seen["time"] == pytest.approx(0.1 * k, abs=1e-12) and all(map(math.isfinite, seen.values()))
        assert {"thrust", "rudder", "energy", "wind_x", *MOTION} <= set(seen) and seen["energy"] >= 0


WRONG = [
    ({"law": "foward"}, "did you mean 'forward'"),
    ({"law": "forward", "references": {"surge_ref": 50.0}}, r"out of its bounds \[0, 1.5\]"),
    ({"law": "forward", "references": {"surge_ref": math.nan}}, "must be a number, found nan"),
    ({"law": "forward", "references": {"surge_ref": "fast"}}, "must be a number, found 'fast'"),
    ({"law": "forward", "references": {"surge_reff": 1.0}}, "did you mean 'surge_ref'"),
    ({"stick": (2.0, 0.0)}, "out of its bounds"),
    ({"stick": (None, 0.0)}, "must be a number, found None"),
    ({"disturbances": {"winds": {}}}, "did you mean 'wind'"),
    ({"disturbances": {"wind": {"x": 1e9}}}, "out of its bounds"),
    ({"disturbances": {"wind": {"z": 1.0}}}, "unknown value 'z'"),
]


@pytest.mark.parametrize(("order", "text"), WRONG)
def test_a_wrong_order_is_refused_whole_and_in_one_line(loop, order, text):
    loop.command(law="turn", stick=(0.1, 0.2), disturbances={"slope": {}})
    held = (loop.law, loop.stick, dict(loop.references), dict(loop.switched_on))
    with pytest.raises(InputError, match=text) as refused:
        loop.command(**{"stick": (0.5, 0.5), "disturbances": {"gusts": {}}, **order})
    assert "\n" not in str(refused.value)
    assert (loop.law, loop.stick, dict(loop.references), dict(loop.switched_on)) == held


def test_reset_puts_the_craft_back_and_gusts_begin_anew(loop):
    def flight():
        loop.advance(1.0)
        return motion(loop)

    loop.command(stick=(1.0, 0.3), disturbances={"gusts": {}, "air_drag": {}})
    first = flight()
    loop.reset()
    assert motion(loop) == [0.0] * 6 and loop.time == 0
    assert flight() == first


def test_laws_and_logs_see_what_sensors_see():
    craft = {
        "plant": {"name": "biased"},
        "inputs": {"thrust": {"unit": "N"}},
        "effects": {"thrust": 1 / MASS, "rudder_torque": ARM / INERTIA, "gyro_bias": 0.1},
    }
    loop = Loop(model_from_table(craft))
    loop.command(law="stop")
    loop.advance(20.0)
    seen = loop.signals()
    assert seen["r_measured"] == pytest.approx(seen["r"] + 0.1)
    assert abs(seen["r_measured"]) < abs(seen["r"])  # the law believes the gyro


def test_every_disturbance_can_be_switched_on_by_itself(loop):
    for key, disturbance in DISTURBANCES.items():
        loop.reset()
        for drag in (None, {}):
            loop.command(law="manual", stick=(-0.5, 0.3), disturbances={"air_drag": drag})
        loop.advance(0.5)
        calm = motion(loop)
        loop.reset()
        loop.command(disturbances={key: {k.signal.name: k.signal.upper for k in disturbance.knobs}})
        loop.advance(0.5)
        assert motion(loop) != calm, key
        loop.command(disturbances={key: None})


def test_a_model_that_no_equation_says_is_refused():
    content = {"effects": {"thrust": 1.0, "rudder_torque": 1.0, "input_delay": 0.1}}
    with pytest.raises(InputError, match="delay"):
        Loop(model_from_table(content))
