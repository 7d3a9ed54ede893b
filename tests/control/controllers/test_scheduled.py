"""Gain scheduling against python-control's own, and on a craft whose dynamics depend on speed."""

import control
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError

SPEEDS = (0.4, 0.8, 1.2)
STATES = ["psi", "u", "v", "r"]


def craft():
    """C17's craft with viscous drag in surge, so that the thrust at rest depends on speed."""
    changes = {"surge_coulomb": 0.0, "surge_linear_drag": 1.35, "yaw_coulomb": 0.0}
    return hc.vehicle("c17_simulation").with_coefficients(changes).plant()


def straight(u):
    return control.OperatingPoint([0, 0, 0, u, 0, 0], [1.8 * u, 0])


def design(plant, trim):
    return hc.lqr(
        plant, trim, {"psi": 4.0, "u": 2.0, "r": 1.0}, {"thrust": 1.0, "rudder": 3.0}, states=STATES
    )


def by_hand(u):
    """The gain at one speed, from C17 (8), (11) by hand."""
    A = np.array([[0, 0, 0, 1], [0, -1.35, 0, 0], [0, 0, -1.2, -u], [0, 0, 0, -0.48]])
    T, turn = 1.8 * u, 0.14 * 0.75 * 0.585 / 0.01
    B = np.array([[0, 0], [0.75, 0], [0, 0.75 * T], [0, -turn * T]])
    return control.lqr(A, B, np.diag([4.0, 2.0, 0.0, 1.0]), np.diag([1.0, 3.0]))[0]


def test_the_command_is_that_of_create_statefbk_iosystem_with_gain_scheduling(rng):
    plant = control.ss(
        np.zeros((4, 4)),
        np.zeros((4, 2)),
        np.eye(4),
        0,
        states=STATES,
        outputs=STATES,
        inputs=["thrust", "rudder"],
    )
    theirs, _ = control.create_statefbk_iosystem(
        plant,
        ([by_hand(u) for u in SPEEDS], np.array(SPEEDS)),
        gainsched_indices=["u"],
        gainsched_method="linear",
    )
    block = hc.gain_scheduled(craft(), [straight(u) for u in SPEEDS], design)
    f, names = block.to_numpy(), [s.name for s in block.inputs]
    for _ in range(30):
        x, setpoint = rng.uniform(-0.5, 0.5, (2, 4))
        x[1], setpoint[1] = rng.uniform(0.4, 1.2, 2)
        trim = [1.8 * setpoint[1], 0.0]  # the equilibrium at the setpoint
        expected = theirs.output(0.0, [], [*setpoint, *trim, *x])
        values = dict(zip(STATES, x, strict=True)) | {
            f"{s}_ref": v for s, v in zip(STATES, setpoint, strict=True)
        }
        assert f.outputs(0.0, (), [values[n] for n in names]) == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
def test_at_each_operating_point_the_loop_is_the_one_designed_there():
    """The trim follows the setpoint, so the linearised loop has no term from the schedule."""
    plant = craft()
    loop = hc.interconnect([plant, hc.gain_scheduled(plant, [straight(u) for u in SPEEDS], design)])
    names = [s.name for s in loop.inputs]
    for u in SPEEDS:
        single = hc.interconnect([plant, design(plant, straight(u))])
        inputs = {"u_ref": u}
        found, wanted = (
            np.sort_complex(block.linearize([0, 0, 0, u, 0, 0], [inputs.get(n, 0.0) for n in labels]).poles())
            for block, labels in ((loop, names), (single, [s.name for s in single.inputs]))
        )
        assert found == pytest.approx(wanted, abs=1e-6)


def test_beyond_the_points_the_gains_hold():
    block = hc.gain_scheduled(craft(), [straight(u) for u in SPEEDS], design)
    f, names = block.to_numpy(), [s.name for s in block.inputs]

    def rudder(u):
        values = {"psi": 0.1, "u": u, "u_ref": u}
        return f.outputs(0.0, (), [values.get(n, 0.0) for n in names])[1]

    assert rudder(2.0) == pytest.approx(-0.1 * by_hand(1.2)[1, 0], rel=1e-8)
    assert rudder(0.1) == pytest.approx(-0.1 * by_hand(0.4)[1, 0], rel=1e-8)
    assert rudder(0.6) == pytest.approx(-0.05 * (by_hand(0.4) + by_hand(0.8))[1, 0], rel=1e-8)


def test_a_craft_keeps_its_heading_from_slow_to_fast_in_every_backend():
    plant, t = craft(), np.linspace(0, 12, 121)
    loop = hc.interconnect([plant, hc.gain_scheduled(plant, [straight(u) for u in SPEEDS], design)])
    speed = np.where(t < 6, 0.4, 1.2)
    x0 = {"plant.u": 0.4, "plant.psi": 0.3}
    run = hc.simulate(loop, t, {"u_ref": speed}, x0=x0)
    compiled = loop.compile().simulate(t, {"u_ref": speed}, x0=x0)
    assert compiled.outputs == pytest.approx(run.outputs, abs=1e-4)
    u, psi = (run.outputs[run.output_labels.index(s)] for s in ("u", "psi"))
    assert u[59] == pytest.approx(0.4, abs=0.01) and u[-1] == pytest.approx(1.2, abs=0.01)
    assert abs(psi[-1]) < 0.02
    assert loop.to_control().nstates == 6


def test_setpoints_that_differ_between_the_points_follow_the_schedule():
    """On turns the sway velocity belongs to the yaw rate: v_ref is no input then."""
    plant = craft()

    def turning(r):
        from scipy.optimize import fsolve

        f = plant.to_numpy()

        def rates(z):
            return f.derivatives(0.0, [0, 0, 0, 1.0, z[0], r], z[1:])[3:]

        v, thrust, rudder = fsolve(rates, [-r, 1.4, -0.05], xtol=1e-13)
        return control.OperatingPoint([0, 0, 0, 1.0, v, r], [thrust, rudder])

    def at(plant, trim):
        return hc.lqr(plant, trim, {"u": 1.0, "v": 1.0, "r": 1.0}, {"thrust": 1.0, "rudder": 1.0})

    points = [turning(r) for r in (-0.4, 0.1, 0.4)]
    block = hc.gain_scheduled(plant, points, at, schedule="r")
    names = [s.name for s in block.inputs]
    assert "v_ref" not in names and "r_ref" in names
    f = block.to_numpy()
    for point in points:
        values = dict(zip([s.name for s in plant.states], point.states, strict=True))
        values |= {"r_ref": values["r"], "u_ref": 1.0}
        assert f.outputs(0.0, (), [values[n] for n in names]) == pytest.approx(point.inputs, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"trims": [straight(1.0)]}, "expected two or more operating points, found 1"),
        ({"trims": [straight(1.0), straight(1.0)]}, "the same u: 1, 1"),
        ({"schedule": "speed"}, "no state or output 'speed'"),
        ({"design": lambda plant, trim: 1.0}, "design must return a Block"),
    ],
)
def test_wrong_input_is_refused_in_one_line(change, words):
    given = {"trims": [straight(0.5), straight(1.0)], "design": design} | change
    with pytest.raises(InputError) as caught:
        hc.gain_scheduled(craft(), **given)
    assert words in str(caught.value)


def test_designs_with_different_states_are_refused():
    def uneven(plant, trim):
        states = STATES if trim.states[3] > 0.6 else ["psi", "r"]
        return hc.lqr(plant, trim, {"psi": 1.0}, {"rudder": 1.0}, states=states)

    with pytest.raises(InputError, match="the designs differ in inputs: u, u_ref, v, v_ref; name the states"):
        hc.gain_scheduled(craft(), [straight(0.5), straight(1.0)], uneven)


def test_turns_faster_than_one_design_holds_are_held_by_several():
    """With dry friction: one gain from a turn of 0.2 rad/s loses a third of the speed at 0.7 rad/s."""
    plant, t = hc.vehicle("c17_simulation").plant(), np.linspace(0, 10, 101)

    def at(plant, trim):
        return hc.lqr(plant, trim, {"u": 1.0, "v": 1.0, "r": 4.0}, {"thrust": 1.0, "rudder": 1.0})

    turns = [plant.trim({"u": 1.0, "r": rate}) for rate in (0.2, 0.4, 0.8)]
    speeds = []
    for block in (hc.gain_scheduled(plant, turns, at, schedule="r"), at(plant, turns[0])):
        run = hc.interconnect([plant, block]).compile(friction="events")
        result = run.simulate(t, {"r_ref": 0.7}, x0={"plant.u": 1.0, "plant.r": 0.7})
        speeds.append(result.outputs[result.output_labels.index("u")][-1])
    assert speeds[0] == pytest.approx(1.0, abs=0.05)
    assert speeds[1] < 0.75


def test_straight_course_and_turns_are_one_schedule_without_friction_compensation():
    plant = hc.vehicle("c17_simulation").plant()
    trims = [plant.trim({"u": 1.0, "r": rate}) for rate in (-0.4, 0.0, 0.4)]
    weights = ({"u": 1.0, "v": 1.0, "r": 4.0}, {"thrust": 1.0, "rudder": 1.0})
    with pytest.raises(InputError, match="F_rudder_r, F_thrust_r, r_width; compensate_friction=False"):
        hc.gain_scheduled(plant, trims, lambda p, at: hc.lqr(p, at, *weights), schedule="r")
    block = hc.gain_scheduled(
        plant, trims, lambda p, at: hc.lqr(p, at, *weights, compensate_friction=False), schedule="r"
    )
    assert [s.start for s in block.parameters if s.name.startswith("r_")] == [-0.4, 0.0, 0.4]
