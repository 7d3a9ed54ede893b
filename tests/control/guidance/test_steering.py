"""Steering under way: the stick gives surge velocity and yaw rate, and the craft does both."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis import steering_map, turning_modes
from hovercontrol.control.autopilot import autopilot
from hovercontrol.control.guidance import command_filter, steering_law, steering_reference, weaving

C17 = hc.vehicle("c17_simulation")
K06 = hc.vehicle("hoverdemon")
GRID = [(0.3, -0.5), (0.3, 0.5), (0.7, 0.25), (1.1, -0.5), (1.1, 0.5)]


def run(loop, surge, yaw_rate, end, x0=None):
    t = np.linspace(0.0, end, round(end / 0.02) + 1)
    told = {"surge_ref": np.full(t.size, surge), "yaw_rate_ref": np.full(t.size, yaw_rate)}
    response = loop.compile().simulate(t, told, x0=x0)
    return t, dict(zip(response.output_labels, np.asarray(response.outputs), strict=True))


def c17_loop():
    return hc.interconnect([C17.plant(), command_filter(), steering_law(C17)], "loop")


def k06_loop():
    return hc.interconnect([K06.plant(), weaving(), steering_law(K06)], "loop")


@pytest.mark.parametrize(("surge", "yaw_rate"), GRID)
def test_c17s_craft_has_the_sticks_motion_and_the_sway_velocity_of_its_equations(surge, yaw_rate):
    _, seen = run(c17_loop(), surge, yaw_rate, 20.0)
    c4, c5, c6, c7, c8 = 1.20, 0.83, 0.48, 0.75, 0.14 * 0.75 * 0.585 / 0.01
    side = (c5 * np.sign(yaw_rate) + c6 * yaw_rate) / c8  # -T sin(theta), from r' = 0
    assert seen["u"][-1] == pytest.approx(surge, rel=1e-4)
    assert seen["r"][-1] == pytest.approx(yaw_rate, rel=1e-4)
    assert seen["v"][-1] == pytest.approx((-surge * yaw_rate - c7 * side) / c4, rel=1e-3)


def test_errors_decay_with_the_two_gains():
    loop = hc.interconnect([C17.plant(), command_filter(), steering_law(C17, surge_gain=0.8, yaw_gain=1.7)])
    start = {"plant.u": 0.9, "plant.r": 0.6, "filter.surge_desired": 0.5, "filter.yaw_rate_desired": 0.2}
    t, seen = run(loop, 0.5, 0.2, 4.0, start)
    assert seen["u"] - 0.5 == pytest.approx(0.4 * np.exp(-0.8 * t), abs=1e-4)
    assert seen["r"] - 0.2 == pytest.approx(0.4 * np.exp(-1.7 * t), abs=1e-4)


def test_the_filter_is_a_first_order_lag_and_its_sampled_form_is_exact():
    t = np.linspace(0.0, 2.0, 201)
    step = {"surge_ref": np.ones(t.size), "yaw_rate_ref": np.zeros(t.size)}
    smooth = hc.simulate(command_filter(lag=0.4), t, step)
    exact = control.step_response(control.tf([1], [0.4, 1]), t).outputs
    assert smooth.outputs[0] == pytest.approx(exact, abs=1e-5)
    ticking = hc.simulate(command_filter(lag=0.4, period=0.01), t, step)
    assert ticking.outputs[0] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("control_point", [0.15, 0.2, 0.4])
def test_c17s_controller_follows_the_virtual_craft_ahead_of_the_centre_of_percussion(control_point):
    parts = [
        C17.plant(),
        command_filter(),
        steering_reference(C17, control_point=control_point),
        hc.tracking_controller(C17, control_point=control_point),
    ]
    _, seen = run(hc.interconnect(parts), 0.7, 0.4, 30.0, {"plant.u": 0.2, "plant.y": 0.3})
    assert seen["u"][-1] == pytest.approx(0.7, rel=0.01)
    assert seen["r"][-1] == pytest.approx(0.4, rel=0.01)
    assert np.hypot(seen["error_x"], seen["error_y"])[-1] < 1e-3
    assert turning_modes(C17, 0.7, 0.4, control_point=control_point).real.max() < 0


def test_c17s_controller_turns_the_craft_round_where_the_modes_are_unstable():
    assert turning_modes(C17, 0.7, 0.4, control_point=0.03).real.max() > 0
    parts = [
        C17.plant(),
        command_filter(),
        steering_reference(C17, control_point=0.03),
        hc.tracking_controller(C17, control_point=0.03),
    ]
    _, seen = run(hc.interconnect(parts), 0.7, 0.4, 40.0, {"plant.r": 0.05})
    assert seen["u"][-1] < -0.5  # it tracks stern first


def test_the_modes_of_a_turn_are_those_of_the_simulated_loop():
    """Linearise heading and yaw rate on the circle by finite differences of C17's own equations (23)."""
    c4, c5, c6, c7, c8, dx = 1.20, 0.83, 0.48, 0.75, 0.14 * 0.75 * 0.585 / 0.01, 0.2
    U, R = 0.8, 0.3
    sway = C17.plant().trim({"u": U, "r": R}).states["v"]
    V = np.hypot(U, sway + dx * R)

    def yaw(psi, r):  # z1 = z2 = 0, p_d' = V e1, p_d'' = V R e2
        v = -np.sin(psi) * V - dx * r
        torque = (V * R * np.cos(psi) + c4 * v + dx * (c5 * np.sign(r) + c6 * r)) / (c7 - c8 * dx)
        return -c5 * np.sign(r) - c6 * r - c8 * torque

    here = -np.arctan2(sway + dx * R, U)
    h = 1e-6
    assert yaw(here, R) == pytest.approx(0.0, abs=1e-9)
    by_psi = (yaw(here + h, R) - yaw(here - h, R)) / (2 * h)
    by_r = (yaw(here, R + h) - yaw(here, R - h)) / (2 * h)
    expected = np.sort_complex(np.roots([1.0, -by_r, -by_psi]))
    assert np.sort_complex(turning_modes(C17, U, R)) == pytest.approx(expected, rel=1e-5)


def test_a_craft_without_drag_has_no_steady_turn():
    with pytest.raises(InputError, match="v' = "):
        K06.plant().trim({"u": 0.5, "r": 0.3})


def test_without_drag_the_drift_of_the_centre_of_oscillation_is_minus_the_integral_of_u_r():
    m, J, d = 2.6, 0.096, 0.32

    def motion(t, x):  # K06 (2.10), forces that are anything
        u, v, r, _ = x
        fx, fy = 0.7 * np.sin(1.3 * t) + 0.2, 0.4 * np.cos(2.1 * t)
        return [v * r + fx / m, -u * r + fy / m, -d * fy / J, -u * r]

    run = solve_ivp(motion, (0.0, 10.0), [0.4, 0.1, 0.2, 0.1 + J / (m * d) * 0.2], rtol=1e-10, atol=1e-12)
    _, v, r, w = run.y[:, -1]
    assert v + J / (m * d) * r == pytest.approx(w, abs=1e-7)


@pytest.mark.parametrize(("surge", "yaw_rate"), [(0.3, 0.5), (0.7, -0.25), (1.1, 0.5), (-0.5, 0.3)])
def test_a_weaving_craft_without_drag_has_the_sticks_motion_in_the_mean(surge, yaw_rate):
    weave = 2 * np.pi / (0.55 * np.hypot(yaw_rate, 0.02))
    t, seen = run(k06_loop(), surge, yaw_rate, 10 * weave)
    late = t >= 6 * weave
    assert seen["u"][late].mean() == pytest.approx(surge, rel=0.01)
    assert seen["r"][late].mean() == pytest.approx(yaw_rate, rel=0.02)
    assert abs((seen["u"] * seen["r"])[late].mean()) < 0.01 * abs(surge * yaw_rate)
    assert np.abs(seen["v"]).max() < 1.5 * abs(surge)


def test_weaving_fades_straight_ahead_and_turns_the_bow_into_a_drift():
    t, seen = run(k06_loop(), 0.6, 0.0, 60.0, {"plant.v": 0.2})
    late = t > 50.0
    assert np.ptp(seen["u"][late]) < 1e-3
    assert abs(seen["v"][-1]) < 0.01
    assert abs(seen["r"][-1]) < 0.01


def test_weaving_asks_for_accelerations_that_are_the_derivatives_of_its_velocities():
    t, seen = run(k06_loop(), 0.6, 0.3, 20.0)
    inside = slice(100, -100)
    for name in ("surge", "yaw_rate"):
        slope = np.gradient(seen[f"{name}_desired"], t)
        told = seen["surge_acceleration_desired" if name == "surge" else "yaw_acceleration_desired"]
        assert slope[inside] == pytest.approx(told[inside], abs=2e-3)


def test_the_loop_is_the_same_in_python_in_c_and_in_python_control():
    loop = k06_loop()
    t = np.linspace(0.0, 5.0, 51)
    told = np.vstack([np.full(t.size, 0.5), np.full(t.size, 0.3)])
    python = hc.simulate(loop, t, told, rtol=1e-9, atol=1e-11).outputs
    assert loop.compile().simulate(t, told, rtol=1e-9, atol=1e-11).outputs == pytest.approx(python, abs=1e-6)
    options = {"rtol": 1e-9, "atol": 1e-11}
    response = control.input_output_response(
        loop.to_control(), t, told, [s.start for s in loop.states], solve_ivp_kwargs=options
    )
    assert response.outputs == pytest.approx(python, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("navigation", ["error_model", "magnetometer"])
def test_k06s_real_loop_keeps_the_sticks_motion_over_the_grid(navigation):
    loop = autopilot(
        steering_law(K06, forces=True, yaw_gain=1.5),
        guidance=weaving(period=0.001),
        references={"surge_ref": 0.5, "yaw_rate_ref": 0.3},
        navigation=navigation,
    )
    found = steering_map(loop, points=3)
    kept = found["within"].mean()  # each in the mean over some weaves: noise of the error model remains in it
    assert kept == 1.0 if navigation == "magnetometer" else kept >= 7 / 9
    assert np.abs(found["surge_error"]).max() < 0.10 and np.abs(found["yaw_rate_error"]).max() < 0.25


def has_trim(plant, surge, yaw_rate):
    """Whether a steady turn is within the bounds of thrust and rudder."""
    try:
        plant.trim({"u": surge, "r": yaw_rate})
    except InputError:
        return False
    return True


def test_thrust_and_rudder_bounds_say_which_turns_there_are():
    """C17's experiment, 6.1 A: 1.5 rad/s is within its bounds at all surge velocities, 3 rad/s at none."""
    craft = hc.vehicle("c17_experiment")
    loop = hc.interconnect([craft.plant(), command_filter(), steering_law(craft, limits=True)])
    for yaw_rate in (1.5, 3.0):
        held = [has_trim(craft.plant(), surge, yaw_rate) for surge in (0.3, 0.7, 1.1)]
        found = steering_map(loop, points=3, yaw_rate=(-yaw_rate, yaw_rate), least_time=20.0)
        assert found["within"][:, -1].tolist() == held == [yaw_rate < 2.0] * 3


@pytest.mark.slow
def test_the_real_loop_steers_a_craft_with_drag_where_the_rudder_reaches():
    craft = K06.with_effects(
        [
            hc.effect("surge_linear_drag", 0.3),
            hc.effect("sway_linear_drag", 0.8),
            hc.effect("yaw_linear_drag", 2.459),
        ]
    )
    loop = autopilot(
        steering_law(craft, forces=True, yaw_gain=1.5),
        guidance=command_filter(period=0.001),
        references={"surge_ref": 0.5, "yaw_rate_ref": 0.3},
        plant=craft.plant(),
        navigation="magnetometer",
    )
    found = steering_map(loop, points=3)
    plant = craft.plant()
    angles = [abs(plant.trim({"u": surge, "r": 0.5}).inputs["rudder"]) for surge in (0.3, 0.7, 1.1)]
    assert found["within"][:, -1].tolist() == [angle < 0.47 for angle in angles] == [False, True, True]


def test_a_map_over_the_stick_finds_what_a_craft_that_does_not_turn_misses():
    from hovercontrol.control.controllers.k06 import drive, force_to_command

    slips = hc.interconnect([K06.plant(), drive(k1=1.0, k2=4.0), force_to_command()], "drive")
    found = steering_map(slips, points=3, least_time=20.0)
    assert found["yaw_rate_error"][:, 0] == pytest.approx(1.0, abs=0.1)  # told both it slips
    kept = steering_map(c17_loop(), points=3, least_time=20.0)
    assert kept["within"].all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: steering_law(C17, surge_gain=0.0), "surge_gain"),
        (lambda: steering_law(C17.without_effects("thrust")), "needs the effects"),
        (lambda: steering_law(hc.vehicle("c17_experiment"), forces=True), "in N"),
        (lambda: steering_reference(C17, start={"psj": 1.0}), "psj"),
        (lambda: command_filter(lag=-1.0), "lag"),
        (lambda: command_filter(period=-1.0), "period"),
        (lambda: weaving(ratio=0.0), "ratio"),
        (lambda: weaving(period=-0.1), "period"),
    ],
)
def test_wrong_numbers_are_refused_in_one_line(make, said):
    with pytest.raises(InputError, match=said) as error:
        make()
    assert "\n" not in str(error.value)
