"""Loops with a controller in a computer: python-control's sampling, and steps of simulations."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc

PERIOD = 0.1


@pytest.fixture(scope="module")
def blocks():
    """C17's craft with linear yaw drag, and a pilot with an integral who ticks ten times a second."""
    craft = hc.vehicle("c17_simulation").without_effects("yaw_coulomb").plant()
    psi, r, goal = hc.Signal("psi", "rad"), hc.Signal("r", "rad/s"), hc.Signal("goal", "rad")
    kp, kd, ki = (
        hc.Signal("kp", "1", start=0.6),
        hc.Signal("kd", "s", start=0.3),
        hc.Signal("ki", "1", start=0.02),
    )
    total, error = hc.Signal("total", "rad"), psi.symbol - goal.symbol
    law = {"rudder": kp.symbol * error + kd.symbol * r.symbol + total.symbol}
    pilot = hc.Block("pilot", [total], [psi, r, goal], [craft.inputs[1]], [kp, kd, ki],
                     {"total": total.symbol + ki.symbol * error}, law, period=PERIOD)  # fmt: skip
    return craft, pilot


@pytest.fixture(scope="module")
def loop(blocks):
    return hc.interconnect(blocks, "heading")


@pytest.fixture(scope="module")
def ahead(loop):
    return loop.trim({"plant.u": 1.0}, {"goal": 0.0})


def by_hand(ahead):
    """The loop gain by python-control: psi'' = -c6 psi' - c8 T rudder sampled, and the pilot's law in z."""
    c = hc.vehicle("c17_simulation").coefficients()
    b = c["rudder_torque"] * ahead.inputs["thrust"]
    yaw = ct.ss([[0, 1], [0, -c["yaw_linear_drag"]]], [[0], [-b]], np.eye(2), 0)
    law = ct.ss([[1.0]], [[0.02, 0.0]], [[1.0]], [[0.6, 0.3]], PERIOD)
    return -law * ct.sample_system(yaw, PERIOD, "zoh")


def test_the_loop_gain_is_the_one_by_hand(blocks, ahead):
    points = np.exp(1j * PERIOD * np.geomspace(0.1, 30, 40))
    found = hc.bode(list(blocks), "rudder", ahead, friction="none")
    np.testing.assert_allclose(found.gain(points), by_hand(ahead)(points), rtol=1e-8)
    assert set(found.margins.outside.states) == {"plant.x", "plant.y", "plant.u"}


def test_its_margins_are_where_the_loop_by_hand_is_at_the_edge(blocks, ahead):
    found = hc.margins(list(blocks), "rudder", ahead, friction="none")
    L = by_hand(ahead)
    assert np.abs(ct.feedback(found.gain_up * L, 1).poles()).max() == pytest.approx(1.0, abs=1e-4)
    turned = np.angle(L(np.exp(1j * PERIOD * found.crossover)))
    assert np.degrees(np.pi + turned) == pytest.approx(found.phase, abs=0.01)
    z = np.exp(1j * PERIOD * np.linspace(0.01, np.pi / PERIOD, 20_000))
    assert found.disk == pytest.approx(1 / np.abs(1 / (1 + L(z)) - 0.5).max(), rel=1e-3)


def test_its_poles_are_those_of_the_loop_by_hand(loop, ahead):
    line = loop.linearize(ahead)
    assert line.dt == PERIOD
    closed = ct.feedback(by_hand(ahead), 1).poles()
    for pole in closed:
        assert np.abs(line.poles() - pole).min() < 1e-7


def test_a_step_of_the_simulation_is_a_step_of_the_linear_system(loop, ahead):
    line = loop.linearize(ahead)
    times = PERIOD * np.arange(31)
    size = 1e-4
    goal = np.full(31, size)
    motion = hc.simulate(
        loop, times, {"thrust": ahead.inputs["thrust"], "goal": goal}, x0=ahead.x, rtol=1e-10
    )
    linear = ct.forced_response(line, times, np.vstack([np.zeros(31), goal]))
    moved = motion.outputs - ahead.y[:, None]
    names = list(motion.output_labels)
    for name in ("psi", "r", "rudder"):
        k = names.index(name)
        np.testing.assert_allclose(moved[k], linear.outputs[line.output_labels.index(name)], atol=1e-3 * size)


def test_parts_of_different_periods_are_refused(blocks, ahead):
    craft, pilot = blocks
    u, k = hc.Signal("u", "m/s"), hc.Signal("k", "s/m", start=1.8)
    push = hc.Block("push", [], [u], [craft.inputs[0]], [k], period=0.25,
                    output_expressions={"thrust": k.symbol * u.symbol})  # fmt: skip
    with pytest.raises(hc.InputError, match=r"tick every 0.1 s, 0.25 s: a linear system needs one period"):
        hc.interconnect([craft, pilot, push], "two").linearize({"goal": 0.0}, friction="none")
