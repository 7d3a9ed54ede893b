"""What an animation takes from a run: the pose whatever holds it, and forces where the plant has them."""

import control
import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.app.animation.craft import craft_of, to_earth
from hovercontrol.app.animation.motion import motion_of
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.machine import MachineRun
from hovercontrol.logs import Log

T = np.array([0.0, 1.0, 2.0])
POSE = {"x": [0.0, 1.0, 3.0], "y": [0.0, 0.0, 1.0], "psi": [3.0, -3.0, -2.5]}


def test_poses_lie_in_between_headings_turn_the_short_way_and_commands_hold():
    log = Log("demo", T, {**POSE, "thrust": [1.0, 2.0, 3.0], "u": [0.0, 1.0, 2.0]})
    seen = motion_of(log).at(np.array([0.5, 0.999, 1.5]))
    np.testing.assert_allclose(seen.x, [0.5, 0.999, 2.0])
    assert seen.psi[0] == pytest.approx(np.pi)  # halfway from 3.0 to -3.0 + 2 pi
    np.testing.assert_array_equal(seen.commands["thrust"], [1.0, 1.0, 2.0])
    np.testing.assert_allclose(seen.velocities["u"], [0.5, 0.999, 1.5])


def test_rows_without_a_pose_are_crossed_and_those_outside_left_out():
    nan = np.nan
    rows = {k: [nan, 0.0, nan, 2.0, nan] for k in ("x", "y", "psi")} | {"thrust": [1, nan, 2, nan, 3]}
    log = Log("gaps", np.arange(5.0), rows)
    motion = motion_of(log)
    np.testing.assert_array_equal(motion.time, [1.0, 3.0])
    np.testing.assert_array_equal(motion.commands["thrust"], [1.0, 2.0])
    assert motion.at(np.array([2.0])).x == pytest.approx([1.0])


def test_states_of_a_loop_serve_where_its_outputs_lack_the_pose():
    craft = hc.vehicle("c17_simulation")
    parts = [craft.plant(), hc.tracking_controller(craft), hc.circle(2.0, 0.25)]
    t = np.linspace(0.0, 1.0, 11)
    whole, short = (hc.simulate(hc.interconnect(parts, **how), t) for how in ({}, {"outputs": ["thrust"]}))
    assert short.output_labels == ["thrust"]
    for name in ("x", "y", "psi"):
        np.testing.assert_allclose(
            getattr(motion_of(short), name), getattr(motion_of(whole), name), atol=1e-9
        )
    assert set(motion_of(short).velocities) == {"u", "v", "r"}
    assert set(motion_of(whole).reference) == {"x", "y"}


def test_python_controls_own_response_will_do():
    plant = hc.vehicle("c17_simulation").plant()
    u = np.array([[2.0, 2.0, 2.0], [0.1, 0.1, 0.1]])
    theirs = control.input_output_response(plant.to_control(), T, u, solve_ivp_kwargs={"rtol": 1e-8})
    ours = motion_of(hc.simulate(plant, T, u))
    np.testing.assert_allclose(motion_of(theirs).psi, ours.psi, rtol=1e-4)
    np.testing.assert_array_equal(motion_of(theirs).commands["thrust"], [2.0, 2.0, 2.0])


def test_a_scenario_shows_the_true_pose_and_its_craft():
    run = run_scenario(load_scenario("k06-turn"))
    fields = {**run.columns, "x": run.columns["x"] + 9.0, "true_x": run.columns["x"]}
    motion = motion_of(type(run)(run.scenario, run.time, fields))
    np.testing.assert_array_equal(motion.x, run.columns["x"])
    assert motion.model is run.scenario.plant


def test_a_machine_and_its_log_move_alike():
    log = Log("demo", T, POSE)
    np.testing.assert_array_equal(motion_of(MachineRun(log, {})).x, motion_of(log).x)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"x": T, "y": T}, "of 'psi' it holds only x, y"),
        ({"a.x": T, "b.x": T, "y": T, "psi": T}, "several: a.x, b.x"),
        ({"x": T, "y": T, "psi": [np.nan, 1.0, np.nan]}, "two times or more, found 1"),
    ],
)
def test_a_run_without_a_pose_is_refused(columns, said):
    with pytest.raises(hc.InputError, match=f"demo: .*{said}"):
        motion_of(Log("demo", T, columns))


def test_a_response_of_several_runs_is_refused():
    both = control.step_response(control.ss(-np.eye(2), np.eye(2), np.eye(2), 0))
    with pytest.raises(hc.InputError, match="expected one run, found a response of 2 traces"):
        motion_of(both)


def test_the_earth_frame_is_turned_by_the_heading():
    z = np.array([0.4 + 0.1j, -0.2 + 0.05j])
    found = to_earth(np.array([z.real, z.imag]).T, 1.0, 2.0, 0.7)
    expected = 1.0 + 2.0j + z * np.exp(0.7j)
    np.testing.assert_allclose(found[:, 0] + 1j * found[:, 1], expected)


def wrench(craft):
    """Sum of the forces of all arrows, and their torque about the centre of mass."""
    force = np.sum([a.force[:, 0] for a in craft.arrows], axis=0)
    torque = sum(a.place[0] * a.force[1, 0] - a.place[1] * a.force[0, 0] for a in craft.arrows)
    return force, torque


def test_the_arrow_of_a_rudder_craft_pushes_as_the_plant_says():
    craft = hc.vehicle("hoverdemon")  # without drag
    log = Log("demo", T, POSE | {"thrust": [1.5] * 3, "rudder": [0.3] * 3})
    force, torque = wrench(craft_of(motion_of(log), craft))
    rates = craft.plant().to_numpy().derivatives(0.0, np.zeros(6), [1.5, 0.3])[3:]
    assert force[1] / force[0] == pytest.approx(rates[1] / rates[0])
    assert np.sign(torque) == np.sign(rates[2]) == -1.0


def test_the_arrows_of_a_fan_craft_push_as_the_plant_says():
    craft = hc.vehicle("four_fan")
    given = {"rear_left": 0.02, "rear_right": 0.05, "front_left": 0.01, "front_right": 0.0}
    log = Log("demo", T, POSE | {name: [value] * 3 for name, value in given.items()})
    drawn = craft_of(motion_of(log), craft)
    assert len(drawn.arrows) == 4
    force, torque = wrench(drawn)
    plant = craft.plant()
    u = [given.get(s.name, 0.0) for s in plant.inputs]
    rates = plant.to_numpy().derivatives(0.0, np.zeros(6), u)[3:]
    mass, inertia = 1 / craft.coefficients()["fan_force"], 1 / craft.coefficients()["fan_torque"]
    lever = drawn.enlarged  # places are drawn farther apart as the hull is larger
    assert torque / force[0] / lever == pytest.approx(inertia * rates[2] / (mass * rates[0]))


def test_a_peak_leaves_other_arrows_visible_and_no_arrow_is_longer_than_two_hulls():
    thrust = np.ones(100)
    thrust[0] = 50.0
    rows = {k: np.zeros(100) for k in ("x", "y", "psi", "rudder")} | {"thrust": thrust}
    (arrow,) = craft_of(motion_of(Log("peak", np.arange(100.0), rows)), None).arrows
    assert arrow.force[0, 0] == pytest.approx(2.0) and arrow.force[0, 1] == pytest.approx(1.0)


def test_a_small_craft_on_a_long_way_is_drawn_larger():
    far = Log("far", T, {"x": [0.0, 70.0, 140.0], "y": np.zeros(3), "psi": np.zeros(3)})
    drawn = craft_of(motion_of(far), None)
    assert drawn.length == pytest.approx(10.0) and drawn.enlarged == pytest.approx(10.0 / 0.45)
    assert craft_of(motion_of(Log("near", T, POSE)), None).enlarged == 1.0
    assert craft_of(motion_of(far), None, forces=False).arrows == ()


@pytest.mark.parametrize(("angle", "shown"), [("rad", 0.3), ("1", None)])
def test_a_machine_without_psi_shows_its_only_angle_or_is_round(angle, shown):
    """It slides at 45 deg while its angle, if it has one, stays at 0.3 rad."""
    x, y, theta, v = (hc.Signal(n, u) for n, u in (("x", "m"), ("y", "m"), ("theta", angle), ("v", "m/s")))
    slopes = {"x": v.symbol, "y": v.symbol, "theta": sp.S.Zero}
    run = hc.simulate(
        hc.Block("robot", [x, y, theta], [v], [x, y], [], slopes), [0, 1, 2], {"v": 1.0}, x0={"theta": 0.3}
    )
    motion, outline = motion_of(run), craft_of(motion_of(run), None).outline
    radii = np.hypot(*outline.T)
    assert motion.headed == (shown is not None) == (np.ptp(radii) > 0.01)
    assert motion.psi == pytest.approx(shown or 0.0)
