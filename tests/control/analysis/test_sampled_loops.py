"""Loops of plants that are sampled themselves, against eigenvalues, responses and sums by hand."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis import loop_margins, observability_gramian, packet_loop, stabilizability

H = 0.1
A = np.array([[1.0, 0.1, 0.0], [0.0, 0.9, 0.2], [0.0, 0.0, 0.6]])
B = np.array([[0.0], [0.0], [0.4]])
STATES = ["p", "v", "a"]


def plant():
    return hc.from_control(
        ct.ss(A, B, np.eye(3), 0, H, states=STATES, inputs=["F"], outputs=STATES, name="cart")
    )


def loop():
    """The plant, its regulator, the point at rest and L of the matrices by hand."""
    hold = hc.lqr(plant(), {"p": 0.0}, {"p": 1.0, "v": 0.1, "a": 0.1}, {"F": 0.5})
    K = ct.dlqr(A, B, np.diag([1.0, 0.1, 0.1]), [[0.5]])[0]
    return [plant(), hold], {f"{s}_ref": 0.0 for s in STATES}, K


def test_the_gain_margin_is_where_an_eigenvalue_leaves_the_unit_circle():
    blocks, rest, K = loop()
    found = hc.margins(blocks, "F", rest)
    for factor, stable in ((0.999, True), (1.001, False)):
        gain = factor * found.gain_up
        assert (np.abs(np.linalg.eigvals(A - gain * B @ K)).max() < 1.0) == stable
    assert found.phase == pytest.approx(ct.margin(ct.ss(A, B, K, 0, H))[1])


def test_a_negative_gain_at_frequency_zero_has_a_gain_margin():
    line = ct.ss([[0.5]], [[1.0]], [[-0.01]], 0, H)  # L(1) = -0.02
    assert loop_margins(line).gain_up == pytest.approx(50.0)


@pytest.mark.slow
def test_the_response_is_that_on_the_unit_circle_up_to_nyquists_frequency():
    blocks, rest, K = loop()
    found = hc.bode(blocks, "F", rest)
    assert found.frequencies[-1] == pytest.approx(np.pi / H)
    z = np.exp(1j * found.frequencies * H)
    L = np.array([(K @ np.linalg.solve(s * np.eye(3) - A, B)).item() for s in z])
    assert found.magnitude * np.exp(1j * np.radians(found.phase)) == pytest.approx(L, rel=1e-9)
    assert hc.nyquist(blocks, "F", rest).response == pytest.approx(L, rel=1e-9)
    w = np.linspace(1e-3, np.pi / H, 100_001)
    S = 1 / np.abs(1 + ct.ss(A, B, K, 0, H)(np.exp(1j * w * H)))
    assert hc.sensitivity(blocks, "F", rest).Ms == pytest.approx(S.max(), rel=1e-6)
    with pytest.raises(InputError, match=r"at most Nyquist's frequency, 31\.4159 rad/s"):
        hc.bode(blocks, "F", rest, frequencies=[1.0, 40.0])


def test_a_wire_of_a_whole_loop_may_have_a_dot_in_its_name():
    blocks, rest, _ = loop()
    whole = hc.interconnect(blocks, "loop")
    assert hc.margins(whole, "controller.F", rest).gain_up == pytest.approx(
        hc.margins(blocks, "F", rest).gain_up
    )


def test_commands_in_packets_are_held_over_steps_of_the_plant():
    y, c, k = hc.Signal("y"), hc.Signal("c"), hc.Signal("k", start=1.0)
    slow = hc.Block("slow", [y], [c], [y], [], {"y": 0.8 * y.symbol + 0.2 * c.symbol}, period=0.05)
    law = hc.Block("law", [], [y], [c], [k], output_expressions={"c": -k.symbol * y.symbol})
    # over two steps y+ = 0.64 y + 0.36 c
    assert packet_loop([slow, law], "c", period=0.1).growth(0.0) == pytest.approx(0.28**2)
    with pytest.raises(InputError, match="a multiple of the plant's period"):
        packet_loop([slow, law], "c", period=0.07)


def test_the_gramian_of_coefficients_is_a_sum_over_the_steps():
    y, c, a = hc.Signal("y"), hc.Signal("c"), hc.Signal("a", start=0.2)
    slow = hc.Block("slow", [y], [c], [y], [a], {"y": y.symbol + a.symbol * (c.symbol - y.symbol)}, period=H)
    u = np.sin(np.arange(30.0))
    x = np.zeros(30)
    for k in range(29):
        x[k + 1] = 0.8 * x[k] + 0.2 * u[k]
    gamma = np.r_[0.0, np.cumsum(u - x)[:-1]]
    found = observability_gramian(slow, H * np.arange(30), {"y": x, "c": u})
    assert found.matrix == pytest.approx(np.array([[30.0, gamma.sum()], [gamma.sum(), (gamma**2).sum()]]))
    with pytest.raises(InputError, match=r"rows 0\.1 s apart"):
        observability_gramian(slow, 0.2 * np.arange(30), {"y": x, "c": u})


@pytest.mark.parametrize(("stuck", "verdict"), [(0.5, "possible"), (-0.9, "possible"), (1.1, "impossible")])
def test_a_mode_that_no_input_moves_decides_by_the_unit_circle(stuck, verdict):
    system = ct.ss(np.diag([1.5, stuck]), [[1.0], [0.0]], np.eye(2), 0, H)
    found = stabilizability(hc.from_control(system))
    assert (found.verdict, found.linearised.uncontrollable) == (verdict, (pytest.approx(stuck),))


def test_brocketts_integrator_in_steps_cannot_be_held():
    x, y, z, u, v = (hc.Signal(name) for name in "xyzuv")
    steps = hc.Block(
        "steps", [x, y, z], [u, v], [x, y, z], [],
        {
            "x": x.symbol + u.symbol,
            "y": y.symbol + v.symbol,
            "z": z.symbol + x.symbol * v.symbol - y.symbol * u.symbol,
        },
        period=H,
    )  # fmt: skip
    found = stabilizability(steps)
    assert (found.verdict, found.brockett.onto) == ("impossible", False)
    assert "z per step = 1" in found.sentence()
