"""Loops in the frequency domain: python-control's own functions on hand-made systems, and closed formulas."""

import math

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hovercontrol as hc
from hovercontrol.control.analysis import loop_gain

THREE_LAGS = ct.tf([2.0], [1.0, 3.0, 2.0, 0.0])  # 2/(s (s + 1)(s + 2))
C17 = hc.vehicle("c17_simulation").coefficients()
KP, KD = 0.6, 0.4


@pytest.fixture(scope="module")
def blocks():
    """C17's craft and a pilot who holds its heading."""
    craft = hc.vehicle("c17_simulation").plant()
    psi, r, goal = hc.Signal("psi", "rad"), hc.Signal("r", "rad/s"), hc.Signal("goal", "rad")
    kp, kd = hc.Signal("kp", "1", start=KP), hc.Signal("kd", "s", start=KD)
    law = {"rudder": kp.symbol * (psi.symbol - goal.symbol) + kd.symbol * r.symbol}
    rudder = craft.inputs[1]
    return [craft, hc.Block("pilot", [], [psi, r, goal], [rudder], [kp, kd], output_expressions=law)]


@pytest.fixture(scope="module")
def loop(blocks):
    return hc.interconnect(blocks, "heading")


@pytest.fixture(scope="module")
def ahead(loop):
    return loop.trim({"plant.u": 1.0}, {"goal": 0.0})


def by_hand(friction=0.0):
    """The loop gain by hand: r' = -c8 T rudder - (c6 + friction) r, rudder = kp psi + kd r, T = c1/c7."""
    b = C17["rudder_torque"] * C17["surge_coulomb"] / C17["thrust"]
    return ct.tf([b * KD, b * KP], [1.0, C17["yaw_linear_drag"] + friction, 0.0])


# ---- the loop of a craft ---------------------------------------------------------------------------------


def test_the_loop_cut_at_the_rudder_is_the_one_by_hand(blocks, loop, ahead):
    w = np.geomspace(0.01, 100, 50)
    for given_as in (loop, blocks):
        L = loop_gain(given_as, "rudder", ahead, friction="none")
        np.testing.assert_allclose(L(1j * w), by_hand()(1j * w), rtol=1e-9)
    slow = loop_gain(loop, "rudder", ahead, friction="describing", amplitude={"plant.r": 0.1})
    slope = C17["yaw_coulomb"] * 4 / (math.pi * 0.1)
    np.testing.assert_allclose(slow(1j * w), by_hand(slope)(1j * w), rtol=1e-9)


def test_its_margins_are_those_of_the_loop_by_hand(loop, ahead):
    found, expected = hc.margins(loop, "rudder", ahead, friction="none"), ct.margin(by_hand())
    assert found.phase == pytest.approx(expected[1], rel=1e-6)
    assert found.crossover == pytest.approx(expected[3], rel=1e-6)
    assert found.outside.states == ("plant.u", "plant.x", "plant.y")
    assert hc.bode(loop, "rudder", ahead, friction="none").margins == found


def test_the_smoothed_slope_warns_where_a_loop_is_judged(loop, ahead):
    with pytest.warns(hc.SmoothedFrictionWarning, match=r"plant\.r"):
        smooth = hc.margins(loop, "rudder", ahead)
    none = hc.margins(loop, "rudder", ahead, friction="none")
    assert smooth.phase - none.phase > 10  # degrees that the craft under way has not


def test_a_loop_at_its_gain_margin_neither_grows_nor_decays(blocks):
    lagged = hc.Signal("lagged", "rad")
    servo_rate = hc.Signal("servo", "1/s", start=8.0)
    sent = hc.Signal("sent", "rad")
    servo = hc.Block("servo", [lagged], [sent], [hc.Signal("rudder", "rad")], [servo_rate],
                     {"lagged": servo_rate.symbol * (sent.symbol - lagged.symbol)},
                     {"rudder": lagged.symbol})  # fmt: skip
    craft, pilot = blocks
    pilot = hc.rename(pilot, {"rudder": "sent"}).with_values({"kp": 0.1, "kd": 0.005})
    loop = hc.interconnect([craft, pilot, servo], "heading")
    ahead = loop.trim({"plant.u": 1.0}, {"goal": 0.0})
    found = hc.margins(loop, "sent", ahead, friction="none")
    edge = {"pilot.kp": 0.1 * found.gain_up, "pilot.kd": 0.005 * found.gain_up}
    poles = loop.linearize(ahead, params=edge, friction="none").poles()
    swinging = poles[np.abs(poles.imag) > 1e-3]
    assert np.abs(swinging.real).max() < 1e-6
    over = hc.nyquist(loop, "sent", ahead, params={k: 1.01 * v for k, v in edge.items()}, friction="none")
    assert (over.encirclements, over.open_loop_unstable, over.closed_loop_unstable) == (2, 0, 2)


# ---- hand-made systems, against python-control -----------------------------------------------------------


def test_bode_is_python_controls_frequency_response():
    w = np.geomspace(0.1, 10, 30)
    found = hc.bode(THREE_LAGS, frequencies=w)
    expected = ct.frequency_response(THREE_LAGS, w)
    np.testing.assert_allclose(found.magnitude, expected.magnitude, rtol=1e-9)
    np.testing.assert_allclose(found.phase, np.degrees(np.unwrap(expected.phase)), atol=1e-6)
    np.testing.assert_allclose(found.phase, -90 - np.degrees(np.arctan(w) + np.arctan(w / 2)), atol=1e-6)
    gm, pm, wg, wp = ct.margin(THREE_LAGS)
    assert (found.margins.gain_up, found.margins.phase) == pytest.approx((gm, pm))
    assert found.margins.crossover == pytest.approx(wp) and wg == pytest.approx(math.sqrt(2))


def test_phase_begins_where_the_field_begins_it():
    for numerator, denominator, first in (
        ([1.0], [1.0, 1.0], 0),
        ([1.0], [1.0, 0.0], -90),
        ([1.0, 0.1], [1.0, 0.0, 0.0], -180),
        ([1.0], [1.0, 1.0, 0.0, 0.0, 0.0], -270),
        ([1.0, 0.0], [1.0, 2.0, 1.0], 90),
        ([-0.5], [1.0, 1.0], -180),
    ):
        assert hc.bode(ct.tf(numerator, denominator)).phase[0] == pytest.approx(first, abs=7)


@pytest.mark.parametrize(
    "L",
    [
        THREE_LAGS,
        3.5 * THREE_LAGS,
        ct.tf([2.0], [1.0, -1.0]),
        ct.tf([0.5], [1.0, -1.0]),
        ct.tf([4.0, 4.0], [1.0, -1.0, 0.0]),
        ct.tf([1.0], [1.0, 1.0, 0.0], 0.1),
    ],
    ids=str,
)
def test_encirclements_are_python_controls(L):
    found = hc.nyquist(L)
    if L.dt == 0:
        counted = ct.nyquist_response(L, warn_encirclements=False, warn_nyquist=False)
        assert found.encirclements == counted.count
    closed = ct.feedback(L, 1).poles()
    unstable = np.sum(np.abs(closed) > 1 if L.dt else closed.real > 0)
    assert found.closed_loop_unstable == unstable == found.encirclements + found.open_loop_unstable


@settings(max_examples=6)
@given(k=st.floats(0.1, 5.0), a=st.floats(0.2, 5.0), b=st.floats(0.2, 5.0))
def test_peaks_are_the_largest_of_a_fine_grid(k, a, b):
    L = ct.tf([k], np.polymul([1.0, a], [1.0, b, 0.0]))
    found = hc.sensitivity(L)
    if np.any(ct.feedback(L, 1).poles().real >= -1e-6):
        return
    w = np.geomspace(1e-4, 1e4, 8_001)
    S = np.abs(ct.feedback(1, L)(1j * w))
    T = np.abs(ct.feedback(L, 1)(1j * w))
    assert S.max() * (1 - 1e-9) <= found.Ms <= S.max() * (1 + 1e-3)
    assert T.max() * (1 - 1e-9) <= found.Mt <= T.max() * (1 + 1e-3)
    distance = np.abs(1 + L(1j * w)).min()
    assert 1 / found.Ms == pytest.approx(distance, rel=1e-3)


def test_peaks_of_a_loop_of_second_order_are_the_textbooks():
    # T = w0^2/(s^2 + 2 z w0 s + w0^2): Mt = 1/(2 z sqrt(1 - z^2)) at w0 sqrt(1 - 2 z^2)
    w0, z = 3.0, 0.2
    found = hc.sensitivity(ct.tf([w0**2], [1.0, 2 * z * w0, 0.0]))
    assert found.Mt == pytest.approx(1 / (2 * z * math.sqrt(1 - z**2)))
    assert found.Mt_frequency == pytest.approx(w0 * math.sqrt(1 - 2 * z**2), rel=1e-6)
    np.testing.assert_allclose(found.S + found.T, 1.0)


def test_what_ms_guarantees_is_never_more_than_the_margins():
    found = hc.sensitivity(THREE_LAGS)
    assert 1 < found.gain_margin <= found.margins.gain_up
    assert 0 < found.phase_margin <= found.margins.phase
    disk = ct.disk_margins(ct.ss(THREE_LAGS), np.geomspace(0.01, 100, 4000))
    assert found.margins.disk == pytest.approx(disk[0], rel=1e-3)


def test_an_unstable_loop_has_no_peaks():
    assert math.isnan(hc.sensitivity(4 * THREE_LAGS).Ms)


def test_a_sampled_loop_has_its_response_up_to_half_its_rate():
    x, e = hc.Signal("x", "1"), hc.Signal("e", "1")
    k = hc.Signal("k", "1", start=0.5)
    total = hc.Block("total", [x], [e], [x], derivatives={"x": x.symbol + e.symbol}, period=0.1)
    law = hc.Block("law", [], [x], [e], [k], output_expressions={"e": -k.symbol * x.symbol}, period=0.1)
    found = hc.sensitivity([total, law], "e")
    L = ct.tf([0.5], [1.0, -1.0], 0.1)
    assert found.frequencies[-1] == pytest.approx(math.pi / 0.1)
    np.testing.assert_allclose(found.S, ct.feedback(1, L)(np.exp(0.1j * found.frequencies)), rtol=1e-9)
    assert found.Ms == pytest.approx(2 / 1.5)  # |z - 1|/|z - 0.5| at z = -1
    assert found.margins.gain_up == pytest.approx(4.0)  # k = 2 is the edge


# ---- figures and errors ----------------------------------------------------------------------------------


def test_each_result_has_a_figure_with_units_and_the_numbers(loop, ahead):
    for result, said in (
        (hc.bode(loop, "rudder", ahead, friction="none"), "phase margin 78 deg at 4.62 rad/s"),
        (hc.nyquist(loop, "rudder", ahead, friction="none"), "0 clockwise encirclements"),
        (hc.sensitivity(loop, "rudder", ahead, friction="none"), "Sensitivity S"),
        (hc.bode(4 * THREE_LAGS), "the loop is unstable"),
        (hc.sensitivity(4 * THREE_LAGS), "the loop is unstable"),
    ):
        figure = result.plot()
        assert figure is plt.gcf() and said in figure.get_suptitle()
        assert all("[" in axis.get_ylabel() for axis in figure.axes)
        plt.close(figure)


def test_results_read_as_one_line():
    assert repr(hc.bode(THREE_LAGS)) == "<Bode: gain margin 3, phase margin 32.61 deg at 0.7494 rad/s>"
    assert repr(hc.bode(4 * THREE_LAGS)) == "<Bode: the loop is unstable>"
    assert repr(hc.nyquist(4 * THREE_LAGS)).startswith(
        "<Nyquist: 2 clockwise encirclements, unstable poles 0"
    )
    assert repr(hc.sensitivity(ct.tf([1.0], [1.0, 1.0, 0.0]))).endswith("Mt 1.155 at 0.7071 rad/s>")


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda loop, at: hc.bode(loop, "ruder", at), "no signal 'ruder' that can be cut; did you mean 'rud"),
        (lambda loop, at: hc.bode(loop, "psi", at), r"it is the signal plant\.psi under this name; give the"),
        (lambda loop, at: hc.bode(loop, "rudder"), "nothing drives 'thrust', 'goal': a loop to"),
        (lambda loop, at: hc.bode(loop), "wire: expected the signal at which the loop is broken"),
        (lambda loop, at: hc.bode(THREE_LAGS, "rudder"), "is the loop gain itself"),
        (lambda loop, at: hc.nyquist(ct.ss([], [], [], np.eye(2))), "one input and one output, found 2"),
        (lambda loop, at: hc.bode(THREE_LAGS, frequencies=[0.0, 1.0]), "frequencies: expected positive"),
        (lambda loop, at: hc.sensitivity("rudder"), "sensitivity: loop: expected"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_one_line(loop, ahead, call, line):
    with pytest.raises(hc.InputError, match=line):
        call(loop, ahead)


def test_a_wire_that_holds_a_state_is_cut_between_blocks(blocks, ahead):
    craft, pilot = blocks
    slow = hc.Block("pilot", [], pilot.inputs, pilot.outputs, pilot.parameters, period=0.2,
                    output_expressions=pilot.output_expressions)  # fmt: skip
    with pytest.raises(hc.InputError, match=r"the signal pilot\.held_rudder under this name"):
        hc.bode(hc.interconnect([craft, slow], "heading"), "rudder", ahead)


def test_a_bode_plot_with_a_delay_ends_where_its_approximation_does():
    """The response of ``exp(-s T)/s`` is ``exp(-j w T)/(j w)``, on the whole default grid."""
    v, F, T = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2"), hc.Signal("T", "s", start=0.5)
    k = hc.Signal("k", "1/s", start=1.0)
    plant = hc.Block("plant", [v], [F], [v], [T], {"v": F.symbol}, delays={"F": T.symbol})
    law = hc.Block("law", [], [v], [F], [k], output_expressions={"F": -k.symbol * v.symbol})
    found = hc.bode([plant, law], "F")
    w = found.frequencies
    assert w[-1] == pytest.approx(16.0)
    assert found.magnitude * np.exp(1j * np.radians(found.phase)) == pytest.approx(
        np.exp(-0.5j * w) / (1j * w), rel=2e-5
    )
    with pytest.raises(hc.InputError, match="expected at most 16 rad/s"):
        hc.bode([plant, law], "F", frequencies=[20.0])
