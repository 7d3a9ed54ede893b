"""Minimum-time manoeuvres: known optimal times, a simulation by SciPy, tracking, refusals."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import hovercontrol as hc

pytest.importorskip("casadi")

CRAFT = hc.vehicle("c17_simulation")
LIMITS = {"thrust": (0.0, 4.0), "rudder": (-0.6, 0.6)}
OBSTACLE = (1.5, 0.3, 0.5)
END = {"x": 3.0, "y": 1.0, "u": 0.0, "v": 0.0, "r": 0.0}


def cart(stiffness=0.0):
    x, v, a = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    k = hc.Signal("k", "1/s^2", start=stiffness)
    rates = {"x": v.symbol, "v": a.symbol - k.symbol * x.symbol}
    return hc.Block("cart", [x, v], [a], [x, v], [k], derivatives=rates)


def unicycle():
    x, y, psi = hc.Signal("x", "m"), hc.Signal("y", "m"), hc.Signal("psi", "rad")
    speed, turn = hc.Signal("speed", "m/s"), hc.Signal("turn", "rad/s")
    rates = {
        "x": speed.symbol * sp.cos(psi.symbol), "y": speed.symbol * sp.sin(psi.symbol), "psi": turn.symbol
    }  # fmt: skip
    return hc.Block("unicycle", [x, y, psi], [speed, turn], [x, y, psi], derivatives=rates)


# Switching times fall on the ends of intervals, so that inputs held over intervals reach the optimum.
EXACT = {
    "rest to rest: 2 sqrt(d/a)": (cart(), {"x": 4.0, "v": 0.0}, {"a": (-1, 1)}, {}, 4.0),
    "braking at twice the acceleration: sqrt(2 d (1/a + 1/b))": (
        cart(), {"x": 3.0, "v": 0.0}, {"a": (-2, 1)}, {"intervals": 30}, 3.0
    ),
    "with a speed limit: d/v + v/a": (cart(), {"x": 4.0, "v": 0.0}, {"a": (-1, 1), "v": (-1, 1)}, {}, 5.0),
    "an oscillator from 2 to rest in half a turn about 1": (
        cart(1.0), {"x": 0.0, "v": 0.0}, {"a": (-1, 1)}, {"start": {"x": 2.0}}, math.pi
    ),
    "Dubins' car: two turns and a tangent": (
        unicycle(), {"x": 3.0, "y": 2.0, "psi": math.pi / 2}, {"speed": (0, 1), "turn": (-1, 1)}, {},
        math.sqrt(5.0) + math.pi / 2,
    ),
    "around a circle: two tangents and an arc": (
        unicycle(), {"x": 2.0, "y": 0.0}, {"speed": (0, 1), "turn": (-2, 2)},
        {"start": {"x": -2.0, "psi": math.pi / 6}, "obstacles": [(0, 0, 0.9)], "clearance": 0.1},
        2 * math.sqrt(3.0) + math.pi / 3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EXACT)
def test_known_optimal_times(case):
    plant, end, limits, options, expected = EXACT[case]
    found = hc.minimum_time(plant, end, limits=limits, **options)
    # inputs held over 40 intervals reach the time of free ones to 1e-4 where a switch falls between two
    assert found.duration == pytest.approx(expected, rel=1e-4)
    for name, (low, high) in limits.items():
        values = {**found.states, **found.inputs}[name]
        assert values.min() >= low - 1e-6 and values.max() <= high + 1e-6
    for name, value in end.items():
        assert found.states[name][-1] == pytest.approx(value, abs=1e-3)


def test_rate_limits_count_from_the_inputs_before_the_start():
    # Jerk 1 m/s^3, up for t1, down for k t1 until v = 0:  t1^2/2 + k t1^2 - k^2 t1^2/2 = 0, k = 1 + sqrt 2
    # d = t1^3 (1/6 + k/2 + k^2/2 - k^3/6)
    found = hc.minimum_time(
        cart(), {"x": 2.0, "v": 0.0}, start={"a": 0.0}, limits={"a": (-9, 9)}, rate_limits={"a": 1.0}
    )
    k = 1 + math.sqrt(2.0)
    expected = (1 + k) * (2.0 / (1 / 6 + k / 2 + k**2 / 2 - k**3 / 6)) ** (1 / 3)
    h = found.time[1]
    assert found.duration == pytest.approx(expected, abs=h)  # an input that is held leads its ramp by up to h
    assert np.abs(np.diff(found.inputs["a"][:-1], prepend=0.0)).max() <= h + 1e-6


def test_waypoints_are_passed():
    way = hc.minimum_time(
        unicycle(), {"x": 0.0, "y": 2.0}, waypoints=[[2.0, 0.0], [2.0, 2.0]], intervals=20,
        limits={"speed": (0, 1), "turn": (-5, 5)},
    )  # fmt: skip
    for t, point in zip(way.passed, [[2.0, 0.0], [2.0, 2.0]], strict=True):
        k = np.argmin(np.abs(way.time - t))
        assert [way.states["x"][k], way.states["y"][k]] == pytest.approx(point, abs=1e-3)
    assert way.duration >= 6.0


@pytest.fixture(scope="module")
def manoeuvre():
    return hc.minimum_time(CRAFT, END, limits=LIMITS, obstacles=[OBSTACLE], guess=3.0)


@pytest.mark.slow
def test_the_craft_s_inputs_lead_to_the_end_by_scipy(manoeuvre):
    f = CRAFT.plant().to_numpy()
    x = np.zeros(6)
    u = np.array([manoeuvre.inputs["thrust"], manoeuvre.inputs["rudder"]])
    room = np.inf
    for k, h in enumerate(np.diff(manoeuvre.time)):
        run = solve_ivp(lambda t, x, u=u[:, k]: f.derivatives(t, x, u), (0, h), x, rtol=1e-9, atol=1e-11)
        x = run.y[:, -1]
        room = min(room, np.hypot(run.y[0] - 1.5, run.y[1] - 0.3).min() - 0.5)
    wanted = [END.get(s.name, x[k]) for k, s in enumerate(CRAFT.plant().states)]
    assert x == pytest.approx(wanted, abs=manoeuvre.error + 1e-5)
    assert room > -1e-3  # it is constrained after each Runge-Kutta step
    assert manoeuvre.duration < 2.7  # the first solution that a single guess finds takes 3.2 s
    for name, (low, high) in LIMITS.items():
        assert low <= manoeuvre.inputs[name].min() and manoeuvre.inputs[name].max() <= high


@pytest.mark.slow
def test_its_reference_is_followed_by_the_tracking_controller(manoeuvre):
    controller = hc.tracking_controller(CRAFT, control_point=0.2, k1=8.0, k2=6.0)
    loop = hc.interconnect(
        [CRAFT.plant(), controller, manoeuvre.reference(control_point=0.2)], outputs=["error_x", "error_y"]
    )
    t = np.linspace(0.0, manoeuvre.duration, 401)
    error = hc.simulate(loop, t, rtol=1e-8).outputs
    assert np.hypot(*error).max() < 0.02


@pytest.mark.slow
def test_the_reference_has_the_planned_motion_at_the_ends_of_intervals():
    found = hc.minimum_time(
        unicycle(), {"x": 2.0, "y": 1.0}, limits={"speed": (0, 1), "turn": (-1, 1)}, intervals=10
    )
    reference = found.reference(control_point=0.3).to_numpy()
    for k in range(1, 10):
        x, y, psi = (found.states[name][k] for name in ("x", "y", "psi"))
        speed, turn = found.inputs["speed"][k], found.inputs["turn"][k]
        c, s = math.cos(psi), math.sin(psi)
        expected = [
            x + 0.3 * c, y + 0.3 * s, speed * c - 0.3 * turn * s, speed * s + 0.3 * turn * c,
            -speed * turn * s - 0.3 * turn**2 * c, speed * turn * c - 0.3 * turn**2 * s,
        ]  # fmt: skip
        assert reference.outputs(found.time[k] + 1e-12, [], []) == pytest.approx(expected, abs=1e-6)


def test_simulate_repeats_the_manoeuvre():
    found = hc.minimum_time(cart(), {"x": 1.0, "v": 0.0}, limits={"a": (-1, 1)}, intervals=10)
    run = found.simulate(rows=4)
    assert run.states[:, ::4] == pytest.approx(np.array(list(found.states.values())), abs=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"end": {"z": 1}}, "end: no signal 'z'"),
        ({"end": {}}, "at least one state"),
        ({"start": {"uu": 1}}, "start: no signal 'uu'; did you mean 'u'"),
        ({"end": {"x": math.nan}}, "end: x"),
        ({"limits": {"thrust": (0, 4)}}, "expected finite limits of 'rudder'"),
        ({"obstacles": [(3, 1, 0.5)]}, r"end \(3, 1\) m lies within 0.5 m of the obstacle at \(3, 1\) m"),
        ({"obstacles": [(0, 0, 0.5)]}, "start .* lies within"),
        ({"waypoints": [[1.5, 0.4]], "obstacles": [OBSTACLE]}, "a waypoint .* lies within"),
        ({"waypoints": [1.5, 0.4]}, "shape .n, 2."),
        ({"intervals": 1}, "intervals"),
        ({"guess": -1.0}, "guess"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"position": ("x", "q"), "obstacles": [OBSTACLE]}, "position: no state 'q'"),
    ],
)
def test_wrong_input_is_refused_in_one_line(options, said):
    with pytest.raises(hc.InputError, match=said):
        hc.minimum_time(CRAFT, **({"end": END, "limits": LIMITS} | options))


def test_an_end_out_of_reach_is_refused():
    # v' = a - k v with a <= 1 and k = 1: v stays below 1
    k, v, a = hc.Signal("k", "1/s", start=1.0), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    dragged = hc.Block("dragged", [v], [a], [v], [k], derivatives={"v": a.symbol - k.symbol * v.symbol})
    with pytest.raises(hc.InputError, match=r"minimum_time: no manoeuvre found within the limits: \w+"):
        hc.minimum_time(dragged, {"v": 2.0}, limits={"a": (-1, 1)}, intervals=10)


def test_a_position_is_needed_for_a_reference():
    found = hc.minimum_time(cart(), {"x": 1.0, "v": 0.0}, limits={"a": (-1, 1)}, intervals=10)
    with pytest.raises(hc.InputError, match="block 'cart' has no state 'y' to follow"):
        found.reference()
