"""Modes beside a loop change none of its margins; python-control, which sees only the loop, agrees."""

import control as ct
import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag

import hovercontrol as hc
from hovercontrol.control.analysis import loop_margins, margins, margins_along
from hovercontrol.control.analysis.cut_loop import CutLoop
from hovercontrol.control.analysis.stability_margins import Margins

S = hc.Signal
AHEAD = {"plant.u": 1.0}

#: Matrices of modes that do not decay.
INTEGRATES, TWICE = np.zeros((1, 1)), np.array([[0.0, 1.0], [0.0, 0.0]])
SWINGS = np.array([[0.0, 2.0], [-2.0, 0.0]])
GROWS = np.array([[0.3]])
FIELDS = ("gain_up", "gain_down", "phase", "crossover", "disk", "delay", "jitter")


def heading_loop(name, **change):
    """A craft that holds its heading by its rudder; nobody feeds its position back."""
    psi, r, p, d = S("psi", "rad"), S("r", "rad/s"), S("kp", "rad", start=0.8), S("kd", "s", start=0.5)
    level = S("level", "1", start=2.0)
    turn = {"rudder": p.symbol * sp.sin(psi.symbol) + d.symbol * r.symbol, "thrust": level.symbol}
    plant = hc.vehicle(name).plant()
    level = level.replace(unit=plant.signal("thrust").unit)
    law = hc.Block("law", [], [psi, r], plant.inputs, [p, d, level], output_expressions=turn)
    return [plant, law.with_values(change) if change else law]


def beside(loop, modes, how, rng, sizes=0.0):
    """Return a loop with modes beside it that its input does not move, or its output does not see.

    Both are hidden by a change of states: their rows of B or columns of C are full.
    """
    n, m = loop.nstates, len(modes)
    A, B = block_diag(loop.A, modes), np.vstack([loop.B, rng.normal(size=(m, 1))])
    C = np.hstack([loop.C, rng.normal(size=(1, m))])
    if how == "not moved":
        B[n:] = 0.0
    else:
        C[:, n:] = 0.0
    Q = np.linalg.qr(rng.normal(size=(n + m, n + m)))[0]
    T = Q * 10.0 ** rng.uniform(-sizes, sizes, n + m)
    Ti = np.linalg.inv(T)
    return ct.ss(T @ A @ Ti, T @ B, C @ Ti, loop.D)


def assert_same_margins(found, expected):
    assert found.stable
    for name in FIELDS:
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-4, abs=1e-9), name


# ---- craft -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["c17_simulation", "c17_experiment", "hoverdemon"])
def test_a_position_that_nobody_feeds_back_counts_in_no_margin(name):
    blocks = heading_loop(name)
    found = margins(blocks, "rudder", AHEAD)
    line = -CutLoop(blocks, "rudder").linearize(AHEAD)
    gain, phase, _, crossover = ct.margin(line)
    assert found.stable
    assert (found.gain_up, found.phase) == (gain, pytest.approx(phase, rel=1e-6))
    assert found.crossover == pytest.approx(crossover, rel=1e-6)
    assert {"plant.x", "plant.y"} <= set(found.outside.states) <= {"plant.x", "plant.y", "plant.u", "plant.v"}
    assert not np.any(found.outside.poles) and not found.outside.grow


def test_a_loop_that_is_unstable_stays_so():
    wrong = margins(heading_loop("c17_simulation", kp=-0.8), "rudder", AHEAD)
    assert not wrong.stable and np.isnan(wrong.phase)
    assert "plant.x" in wrong.outside.states


def test_along_a_motion_the_position_counts_in_no_margin_either():
    blocks = heading_loop("c17_simulation")
    motion = hc.simulate(hc.interconnect(blocks, "loop"), np.linspace(0.0, 2.0, 5), x0={"plant.u": 1.0})
    along = margins_along(blocks, "rudder", motion)
    assert along["stable"].all() and along.worst.stable
    assert {"plant.x", "plant.y"} <= set(along.worst.outside.states)


def test_a_chain_of_integrators_beside_the_loop_is_at_zero_and_grows_not():
    """A speed controller on K06's craft, which has no drag: r, psi, then y integrate one another."""
    u, gain = S("u", "m/s"), S("k", "kg/s", start=1.3)
    commands = hc.vehicle("hoverdemon").plant().inputs
    one = S("one", "m/s", start=1.0)
    law = {"thrust": -gain.symbol * (u.symbol - one.symbol), "rudder": sp.S.Zero}
    controller = hc.Block("law", [], [u], commands, [gain, one], output_expressions=law)
    found = margins([hc.vehicle("hoverdemon").plant(), controller], "thrust", AHEAD)
    assert found.phase == pytest.approx(90.0) and found.crossover == pytest.approx(1.3 / 2.6)
    assert found.outside.poles == (0j,) * 5 and not found.outside.grow
    assert set(found.outside.states) == {f"plant.{name}" for name in ("x", "y", "psi", "v", "r")}


# ---- linear systems, their modes hidden by a change of states --------------------------------------------


@pytest.mark.slow("modes1", "modes2", "modes3")
@pytest.mark.parametrize("how", ["not moved", "not seen"])
@pytest.mark.parametrize("modes", [INTEGRATES, TWICE, SWINGS, block_diag(INTEGRATES, SWINGS)])
@pytest.mark.parametrize("sizes", [0.0, 2.0])
def test_hidden_modes_that_do_not_decay_change_no_margin(how, modes, sizes, rng):
    loop = ct.ss(ct.tf([2.0], [1.0, 3.0, 2.0, 0.0]))  # its own integrator stays
    for _ in range(5):
        found = loop_margins(beside(loop, modes, how, rng, sizes))
        assert_same_margins(found, loop_margins(loop))
        expected = sorted(np.linalg.eigvals(modes), key=lambda p: (p.real, p.imag))
        seen = sorted(found.outside.poles, key=lambda p: (p.real, p.imag))
        np.testing.assert_allclose(seen, expected, atol=1e-5)


@pytest.mark.slow
@given(st.floats(0.2, 5.0), st.floats(0.1, 5.0), st.floats(0.1, 5.0), st.integers(0, 99))
def test_whatever_the_loop_an_integrator_beside_it_changes_nothing(k, a, b, seed):
    loop = ct.ss(ct.tf([k], np.polymul([1.0, a], [1.0, b, 0.0])))
    expected = loop_margins(loop)
    how = ("not moved", "not seen")[seed % 2]
    found = loop_margins(beside(loop, INTEGRATES, how, np.random.default_rng(seed)))
    if not expected.stable:
        assert not found.stable
    elif expected.gain_up > 1.001:
        assert_same_margins(found, expected)


@pytest.mark.parametrize("how", ["not moved", "not seen"])
def test_a_hidden_mode_that_grows_is_told(how, rng):
    loop = ct.ss(ct.tf([2.0], [1.0, 3.0, 2.0, 0.0]))
    found = loop_margins(beside(loop, GROWS, how, rng))
    assert not found.stable and found.outside.grow
    assert found.outside.poles == (pytest.approx(0.3),)
    assert "growing" in str(found.outside)


def test_a_growing_state_beside_the_loop_is_named():
    A, B = block_diag([[-1.0]], GROWS), [[1.0], [0.0]]
    found = loop_margins(ct.ss(A, B, [[2.0, 0.0]], 0, states=["v", "runaway"]))
    assert str(found.outside) == "outside the loop, growing: runaway; poles [rad/s] 0.3"
    assert Margins(stable=True).outside.poles == ()


@pytest.mark.parametrize("integral", [1e-2, 1e-6])
def test_a_slow_integrator_inside_the_loop_stays_inside(integral):
    loop = ct.ss(ct.tf([1.0, integral], [1.0, 0.0]) * ct.tf([2.0], [1.0, 1.0]))
    found = loop_margins(loop)
    assert found.stable and not found.outside.poles
    assert found.phase == pytest.approx(ct.margin(loop)[1])
    away = loop_margins(ct.ss(ct.tf([1.0, -integral], [1.0, 0.0]) * ct.tf([2.0], [1.0, 1.0])))
    assert not away.stable


def test_a_wire_that_does_not_come_back_bears_all():
    found = loop_margins(ct.ss([[0.0]], [[1.0]], [[0.0]], 0))
    assert (found.stable, found.gain_up, found.gain_down, found.phase) == (True, np.inf, 0.0, np.inf)
    assert found.delay == np.inf and found.jitter == np.inf


@pytest.mark.parametrize("loop", [ct.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], 0), ct.tf([1.0], [1.0, 0.5], True)])
def test_another_loop_is_refused(loop):
    with pytest.raises(hc.InputError, match="expected a loop with one input and one output and a known step"):
        loop_margins(loop)
