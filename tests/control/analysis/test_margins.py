"""Margins are where simulations of the nonlinear loops begin to grow; a frozen one is close to that."""

import ast
import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol import Block, InputError, Signal, interconnect
from hovercontrol.blocks.interconnect import rename
from hovercontrol.control.analysis.cut_loop import CutLoop, cut_blocks
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference
from hovercontrol.control.analysis.stability_margins import loop_margins, margins, margins_along
from hovercontrol.control.controllers import lqr, tracking_controller
from hovercontrol.control.controllers.k06 import forward, setpoints
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.documents.k06.law_loop import delayed_force, force_craft

M, J, D = 2.6, 0.096, 0.32
K1, K2, SURGE = 1.0, 4.0, 1.1  # table 6.2
AHEAD = {"craft.u": SURGE}


def k06_loop(delay=0.0):
    """K06's forward law on its craft, by a link with a delay or without."""
    law = forward(k1=K1, k2=K2, name="law")
    told = setpoints([law], {"surge_ref": SURGE})
    if not delay:
        return [force_craft(), law, told]
    late = rename(law, {"force_x": "sent_x", "force_y": "sent_y"})
    return [force_craft(), delayed_force(delay), late, told]


def grows(blocks, between, state=AHEAD, seconds=60.0):
    """Whether the nonlinear loop leaves straight motion with a Block put into the wire of force_y."""
    wire = Signal("force_y_returned", "N")
    loop = interconnect([cut_blocks(blocks, ["force_y"], "loop"), between(wire)], "whole").compile()
    start = {f"loop.{name}": value for name, value in state.items()} | {"loop.craft.v": 1e-4}
    ways = loop.simulate(np.linspace(0.0, seconds, 601), x0=start, rtol=1e-9, atol=1e-14)
    yaw = np.abs(ways.states[list(ways.state_labels).index("loop.craft.r")])
    return yaw[-100:].max() > yaw[100:200].max()


def gain(factor):
    def between(wire):
        out, times = Signal("force_y", "N"), Signal("times", start=factor)
        product = times.symbol * wire.symbol
        return Block("factor", [], [wire], [out], [times], output_expressions={"force_y": product})

    return between


def lag(seconds):
    """An all-pass: gain 1, phase -2 atan(w T)."""

    def between(wire):
        x, out = Signal("lagged", "N"), Signal("force_y", "N")
        per_second = Signal("rate", "1/s", start=1 / seconds)
        slope = (wire.symbol - x.symbol) * per_second.symbol
        return Block(
            "lag", [x], [wire], [out], [per_second], {"lagged": slope},
            output_expressions={"force_y": 2 * x.symbol - wire.symbol},
        )  # fmt: skip

    return between


def disk_edge(alpha, seconds, sign):
    """The factor (1 + delta/2)/(1 - delta/2), delta an all-pass of size alpha: on the disk's edge."""

    def between(wire):
        x, out = Signal("turned", "N"), Signal("force_y", "N")
        per_second, size = Signal("rate", "1/s", start=1 / seconds), Signal("size", start=sign * alpha)
        a = size.symbol
        added = a * (2 * x.symbol - wire.symbol) / (1 + a / 2)
        slope = (wire.symbol + added / 2 - x.symbol) * per_second.symbol
        return Block(
            "edge", [x], [wire], [out], [per_second, size], {"turned": slope},
            output_expressions={"force_y": wire.symbol + added},
        )  # fmt: skip

    return between


# ---- against formulas ------------------------------------------------------------------------------------


def test_a_loop_of_three_lags_is_the_textbooks():
    found = loop_margins(control.tf([2.0], [1.0, 3.0, 2.0, 0.0]))  # 2/(s (s + 1)(s + 2))
    assert found.gain_up == pytest.approx(3.0)
    w = found.crossover
    assert w * math.hypot(w, 1) * math.hypot(w, 2) == pytest.approx(2.0)
    assert found.phase == pytest.approx(90 - math.degrees(math.atan(w) + math.atan(w / 2)))
    assert found.delay == pytest.approx(math.radians(found.phase) / w)
    assert not loop_margins(control.tf([7.0], [1.0, 3.0, 2.0, 0.0])).stable


def test_the_loop_cut_at_the_side_force_is_k06s_linearisation():
    # v' = -u_ref r + F_Y/m, r' = -d F_Y/J, F_Y = -k2 (v - d r)
    A = np.array([[0.0, -SURGE], [0.0, 0.0]])
    B, C = np.array([[1 / M], [-D / J]]), np.array([[K2, -K2 * D]])
    line = -CutLoop(k06_loop(), "force_y").linearize(AHEAD)
    w = np.geomspace(0.1, 100, 20)
    expected = control.ss(A, B, C, 0)(1j * w)
    np.testing.assert_allclose(line(1j * w), expected, rtol=1e-9)
    A[0, 1] = -2.8 / M  # P_X = 2.8 of the table: 1.077 m/s
    poles = np.linalg.eigvals(A - B @ C)
    assert sorted(poles.imag) == pytest.approx([-2.44, 2.44], abs=0.01)  # FACTS: -2.90 +- 2.44i
    assert poles.real == pytest.approx(-2.90, abs=0.01)


def test_a_delay_in_the_loop_is_taken_off_its_delay_margin():
    without, late = (margins(k06_loop(delay), "force_y", AHEAD) for delay in (0.0, 0.07754))
    assert late.delay == pytest.approx(without.delay - 0.07754, abs=1e-5)
    assert late.crossover == pytest.approx(without.crossover, rel=1e-6)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(st.floats(0.2, 5.0), st.floats(0.1, 5.0), st.floats(0.1, 5.0))
def test_no_margin_promises_more_than_one_that_contains_it(k, a, b):
    found = loop_margins(control.tf([k], np.polymul([1.0, a], [1.0, b, 0.0])))
    if found.stable:
        assert found.jitter <= found.delay * (1 + 1e-4)
        assert found.disk_gain <= found.gain_up * (1 + 1e-4)
        assert found.disk_phase <= found.phase * (1 + 1e-4)
        assert found.disk_phase == pytest.approx(2 * math.degrees(math.atan(found.disk / 2)), rel=1e-6)


# ---- against simulations of the nonlinear loop -----------------------------------------------------------


def test_the_gain_margin_is_where_the_loop_begins_to_grow():
    blocks = k06_loop(0.07754)
    edge = margins(blocks, "force_y", AHEAD).gain_up
    assert not grows(blocks, gain(0.97 * edge))
    assert grows(blocks, gain(1.03 * edge))


def test_the_phase_margin_is_where_the_loop_begins_to_grow():
    blocks = k06_loop(0.07754)
    found = margins(blocks, "force_y", AHEAD)
    seconds = math.tan(math.radians(found.phase) / 2) / found.crossover
    assert not grows(blocks, lag(0.97 * seconds))
    assert grows(blocks, lag(1.03 * seconds))


@pytest.mark.slow
def test_within_the_disk_nothing_grows_and_beyond_something_does():
    blocks = k06_loop(0.07754)
    disk = margins(blocks, "force_y", AHEAD).disk
    turns = [(t, sign) for t in np.geomspace(0.01, 1.0, 7) for sign in (-1, 1)]
    assert not any(grows(blocks, disk_edge(0.97 * disk, *turn), seconds=40.0) for turn in turns)
    line = -CutLoop(blocks, "force_y").linearize(AHEAD)
    w = np.geomspace(1.0, 100.0, 4000)
    worst = np.argmax(np.abs(1 / (1 + line(1j * w)) - 0.5))
    angle = np.angle(1 / (1 / (1 + line(1j * w[worst])) - 0.5))  # of the delta that brings it to the edge
    sign = 1 if angle < 0 else -1
    turn = math.tan((-angle if sign > 0 else math.pi - angle) / 2) / w[worst]
    assert any(grows(blocks, disk_edge(1.03 * disk, turn, s)) for s in (sign, -sign))


def delayed_run(delay, seconds=30.0, h=2e-3):
    """The nonlinear craft, F_Y late by a delay that may vary: yaw rates at the middle and at the end."""
    x, sent, seen = np.array([SURGE, 1e-4, 0.0]), [0.0], []
    for k in range(round(seconds / h)):
        late = delay(k * h) / h
        place = max(len(sent) - 1 - late, 0.0)
        low = int(place)
        force = sent[low] + (place - low) * (sent[min(low + 1, len(sent) - 1)] - sent[low])
        push = -K1 * (x[0] - SURGE)

        def slope(x, push=push, force=force):
            u, v, r = x
            return np.array([v * r + push / M, -u * r + force / M, -D * force / J])

        a = slope(x)
        x = x + h * slope(x + h / 2 * a)
        sent.append(-K2 * (x[1] - D * x[2]))
        seen.append(abs(x[2]))
    third = len(seen) // 3
    return max(seen[third : 2 * third]), max(seen[2 * third :])


def test_the_delay_margin_is_where_the_loop_begins_to_grow():
    edge = margins(k06_loop(), "force_y", AHEAD).delay
    for factor, expected in ((0.95, False), (1.05, True)):
        middle, end = delayed_run(lambda t, f=factor: f * edge)
        assert bool(end > middle) is expected


def test_a_delay_that_varies_within_the_jitter_margin_is_borne(rng):
    longest = 0.98 * margins(k06_loop(), "force_y", AHEAD).jitter
    steps = rng.uniform(size=10_000)
    ways = [
        lambda t: longest * (t * 6.3 / (2 * math.pi) % 1),
        lambda t: longest * (math.sin(12.5 * t) > 0),
        lambda t: longest * steps[int(t / 0.02)],
    ]
    for way in ways:
        middle, end = delayed_run(way, seconds=20.0)
        assert end < middle


# ---- along a motion --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ellipse():
    """C17's loop without its wire, and a period of its motion along the ellipse."""
    model = c17_simulation()
    blocks = [model.plant(), tracking_controller(model, control_point=0.2, k1=2.0, k2=2.0), c17_ellipse()]
    loop = interconnect(blocks, "loop").compile()
    begin = {k: v for k, v in on_reference(c17_ellipse(), 0.2).items() if k.startswith("plant")}
    settled = loop.simulate([0.0, 20 * np.pi], x0=begin).states[:, -1]
    return blocks, settled, loop.simulate(np.linspace(20 * np.pi, 22 * np.pi, 25), x0=settled)


@pytest.mark.slow
def test_the_frozen_delay_margin_of_the_rudder_is_close_to_what_the_craft_bears(ellipse):
    blocks, settled, motion = ellipse
    frozen = margins_along(blocks, "rudder", motion)
    assert frozen["delay"] == pytest.approx(frozen["delay"][::-1], rel=0.5)
    worst = frozen.worst
    assert worst.stable
    assert worst.delay == pytest.approx(frozen["delay"].min())
    assert 0.04 < worst.delay < 0.05
    assert tracking_error(blocks, settled, 0.95 * worst.delay) < 0.02
    assert tracking_error(blocks, settled, 1.25 * worst.delay) > 0.5


def tracking_error(blocks, start, delay, seconds=15.0, h=0.005):
    """The largest error in the last third with the rudder late [m]; inf where the craft spins away."""
    plant, rest = blocks[0], interconnect(blocks[1:], "rest")
    slope, tell = plant.to_numpy(), rest.to_numpy()
    seen = [[s.name for s in plant.states].index(s.name) for s in rest.inputs]
    rows = {s.name: k for k, s in enumerate(rest.outputs)}
    x, asked, errors = np.array(start), [], []
    for k in range(round(seconds / h)):
        out = tell.outputs(k * h, (), x[seen])
        asked.append(out[rows["rudder"]])
        u = [out[rows["thrust"]], asked[max(k - round(delay / h), 0)]]
        a = slope.derivatives(0.0, x, u)
        x = x + h * slope.derivatives(0.0, x + h / 2 * a, u)
        errors.append(math.hypot(out[rows["error_x"]], out[rows["error_y"]]))
        if not np.isfinite(x).all() or abs(x[5]) > 50:
            return math.inf
    return max(errors[-len(errors) // 3 :])


def test_an_unstable_instant_has_no_margins_and_the_way_neither(ellipse):
    blocks, _, motion = ellipse
    wrong = [blocks[0], blocks[1].with_values({"k1": 0.01, "k2": 0.01}), blocks[2]]
    frozen = margins_along(wrong, "rudder", motion)
    assert not frozen["stable"].all()
    assert not frozen.worst.stable
    assert math.isnan(frozen.worst.delay)


def test_the_error_of_open_setpoints_gives_the_point_at_which_the_loop_is_cut():
    craft = c17_simulation().plant()
    ahead = craft.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    loop = [craft, lqr(craft, ahead, {"y": 1.0, "u": 1.0}, {"thrust": 1.0, "rudder": 4.0})]
    with pytest.raises(InputError, match="nothing drives 'y_ref', 'psi_ref', 'u_ref'") as refusal:
        margins(loop, "rudder", ahead, friction="none")
    point = ast.literal_eval(str(refusal.value).partition("at=")[2])
    assert point["plant.u"] == point["u_ref"] == 1.0
    assert margins(loop, "rudder", point, friction="none").phase > 60.0  # an LQR's


# ---- bad input -------------------------------------------------------------------------------------------


def test_bad_input_is_refused(ellipse):
    blocks, _, motion = ellipse
    with pytest.raises(InputError, match="no block drives 'force_z'; did you mean 'force_"):
        margins(k06_loop(), "force_z")
    with pytest.raises(InputError, match="nothing drives 'surge_ref': a loop to be cut must be closed"):
        margins(k06_loop()[:2], "force_y")
    with pytest.raises(InputError, match="'surge_rf'; did you mean 'surge_ref'"):
        margins(k06_loop()[:2], "force_y", {"surge_rf": 1.0})
    with pytest.raises(InputError, match=r"no state or input 'craft\.w'; did you mean"):
        margins(k06_loop(), "force_y", {"craft.w": 1.0})
    with pytest.raises(InputError, match=r"motion: no state 'craft\.u'"):
        margins_along(k06_loop(), "force_y", motion)
    with pytest.raises(InputError, match="no margin 'delays'; did you mean 'delay'"):
        margins_along(blocks, "rudder", motion)["delays"]


@pytest.mark.parametrize("wire", ["F", "v"])
def test_a_delay_of_an_input_counts(wire):
    """The loop ``k exp(-s T)/s``: phase margin ``90 deg - k T``, gain margin ``pi/(2 k T)``."""
    v, F, w = Signal("v", "m/s"), Signal("F", "m/s^2"), Signal("w", "m/s")
    T, k = Signal("T", "s", start=0.3), Signal("k", "1/s", start=2.0)
    plant = Block("plant", [v], [F], [v], [T], {"v": F.symbol}, delays={"F": T.symbol})
    law = Block("law", [], [v, w], [F], [k], output_expressions={"F": k.symbol * (w.symbol - v.symbol)})
    found = margins([plant, law], wire, at={"w": 0.0})
    assert found.phase == pytest.approx(90 - math.degrees(0.6), abs=1e-6)
    assert found.gain_up == pytest.approx(math.pi / 1.2, rel=1e-6)
    assert not margins([plant, law], wire, at={"w": 0.0}, params={"T": 0.8}).stable


def test_a_late_command_is_linearised_at_its_value():
    """Thrust n^2 of a late command n = 3 has the slope 6: the loop is ``6 k exp(-s T)/(s + 1)``."""
    v, n, w = Signal("v", "m/s"), Signal("n"), Signal("w", "m/s")
    T, a, b = Signal("T", "s", start=0.2), Signal("a", "m/s^2", start=1.0), Signal("b", "1/s", start=1.0)
    k, trim = Signal("k", "s/m", start=0.5), Signal("trim", start=3.0)
    slope = a.symbol * n.symbol**2 - b.symbol * v.symbol
    plant = Block("plant", [v], [n], [v], [T, a, b], {"v": slope}, delays={"n": T.symbol})
    law = Block(
        "law", [], [v, w], [n], [k, trim],
        output_expressions={"n": trim.symbol + k.symbol * (w.symbol - v.symbol)},
    )  # fmt: skip
    found = margins([plant, law], "n", at={"v": 9.0, "w": 9.0})
    _, phase, _, crossover = control.margin(control.tf([3.0], [1.0, 1.0]))
    assert found.phase == pytest.approx(phase - math.degrees(0.2 * crossover), abs=1e-4)


@pytest.mark.parametrize("step", [0.01, 0.1, 0.5])
def test_a_sampled_mass_with_drag_under_pid_bears_any_smaller_gain(step):
    """Near z = 1 the phase tends to -180 deg and does not cross it."""
    plant = control.c2d(control.ss(control.tf([1.0], [1.0, 1.0, 0.0])), step)
    pid = control.tf([1.0 + 1.5 / step + 0.2 * step, -1.0 - 3.0 / step, 1.5 / step], [1.0, -1.0, 0.0], step)
    found = loop_margins(plant * control.ss(pid))
    assert found.stable and found.gain_down == 0.0 and "jitter" not in repr(found)
    assert f"= {20 * math.log10(found.gain_up):.3g} dB" in repr(found)
