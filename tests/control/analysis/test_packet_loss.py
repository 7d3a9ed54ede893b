"""Loss of packets: the mean square follows its recursion, and nonlinear loops grow where it says."""

import numpy as np
import pytest

from hovercontrol import Block, InputError, Signal, interconnect
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference
from hovercontrol.control.analysis.packet_loss import PacketLoop, packet_loop, packet_loop_along
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.k06 import forward, setpoints
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.documents.k06.law_loop import force_craft

M, J, D = 2.6, 0.096, 0.32
K1, K2, SURGE = 1.0, 4.0, 1.1  # table 6.2
LAW = forward(k1=K1, k2=K2, name="law")
K06 = [force_craft(), LAW, setpoints([LAW], {"surge_ref": SURGE})]
FORCE, AHEAD, PERIOD = ["force_x", "force_y"], {"craft.u": SURGE}, 0.2


@pytest.mark.parametrize("a", [1.1, 2.0, 5.0])
def test_k06_5_2_is_borne_up_to_a_squared_times_the_loss(a):
    loop = PacketLoop(np.zeros((1, 1, 1)), np.full((1, 1, 1), a))
    assert loop.critical == pytest.approx(1 / a**2)
    assert loop.growth(0.5) == pytest.approx(a**2 / 2)


@pytest.mark.parametrize("a", [1.1, 2.0, 5.0])
def test_with_one_retransmission_the_bound_is_k06s_a_times_q(a):
    """Both tries corrupted: q^2, and a^2 q^2 > 1 is |a| q > 1 as K06 prints; three tries bear more still."""
    loop = PacketLoop(np.zeros((1, 1, 1)), np.full((1, 1, 1), a))
    assert loop.critical_corruption() == pytest.approx(1 / a)
    assert loop.critical_corruption(1) == loop.critical
    assert loop.critical_corruption(3) == pytest.approx(a ** (-2 / 3))
    rng = np.random.default_rng(1)
    for q, grows in ((0.9 / a, False), (1.1 / a, True)):
        corrupted = rng.uniform(size=(200_000, 2)) < q
        lost = corrupted.all(axis=1)  # the first try and the second
        assert bool(a**2 * lost.mean() > 1) is grows  # E x(k+1)^2 = a^2 P(lost) E x(k)^2 + 1


def test_a_plant_that_is_stable_by_itself_bears_the_loss_of_all():
    assert PacketLoop(np.zeros((1, 1, 1)), np.full((1, 1, 1), 0.9)).critical == np.inf
    assert PacketLoop(np.full((1, 1, 1), 1.1), np.zeros((1, 1, 1))).critical == 0.0


@pytest.mark.parametrize("lost", ["hold", "zero"])
def test_without_loss_the_growth_is_that_of_the_sampled_loop(lost):
    loop = packet_loop(K06, FORCE, PERIOD, AHEAD, lost=lost)
    poles = np.linalg.eigvals(loop.arrives[0])
    assert loop.growth(0.0) == pytest.approx(np.abs(poles).max() ** 2)


def test_random_runs_have_the_second_moment_of_the_recursion():
    loop = packet_loop(K06, FORCE, PERIOD, AHEAD)
    start = np.array([0.0, 0.1, 0.0, 0.0, 0.0])
    runs = loop.simulate(0.2, start, 6, 40_000)
    squares = np.einsum("ni,nj->nij", runs[6], runs[6])
    moment = np.linalg.matrix_power(loop.second_moment(0.2), 6) @ np.kron(start, start)
    off = squares.std(axis=0) / np.sqrt(40_000)
    assert (np.abs(squares.mean(axis=0) - moment.reshape(5, 5)) <= 5 * off + 1e-15).all()


PACKETS = 14


def k06_runs(lost):
    """K06's nonlinear craft by hand (2.10) by every pattern of lost packets: (v - d r)^2, and how many.

    All 2^14 patterns, each with its probability, leave no chance: a mean square is made by few rare runs.
    """
    patterns = (np.arange(2**PACKETS)[:, None] >> np.arange(PACKETS)) & 1
    u, v, r = np.full(2**PACKETS, SURGE), np.full(2**PACKETS, 1e-5), np.zeros(2**PACKETS)
    fx, fy, seen, h = np.zeros(len(u)), np.zeros(len(u)), [], PERIOD / 20
    for missing in patterns.T:
        seen.append((v - D * r) ** 2)
        kept = 0.0 if lost == "zero" else 1.0
        fx = np.where(missing, kept * fx, -K1 * (u - SURGE))
        fy = np.where(missing, kept * fy, -K2 * (v - D * r))
        for _ in range(20):
            um, vm, rm = u + h / 2 * (v * r + fx / M), v + h / 2 * (fy / M - u * r), r - h / 2 * D * fy / J
            u, v, r = u + h * (vm * rm + fx / M), v + h * (fy / M - um * rm), r - h * D * fy / J
    return np.array(seen), patterns.sum(axis=1)


@pytest.mark.parametrize("lost", ["hold", "zero"])
def test_the_mean_square_of_the_nonlinear_craft_follows_the_recursion_to_its_growth(lost):
    loop = packet_loop(K06, FORCE, PERIOD, AHEAD, lost=lost)
    assert 0.1 < loop.critical < 0.6
    squares, missing = k06_runs(lost)
    start = np.kron(*[[0.0, 1e-5, 0.0, 0.0, 0.0]] * 2)
    row = np.kron(*[[0.0, 1.0, -D, 0.0, 0.0]] * 2)
    for loss, grows in ((0.6 * loop.critical, False), (1.5 * loop.critical, True)):
        weight = loss**missing * (1 - loss) ** (PACKETS - missing)
        mean, step = squares @ weight, loop.second_moment(loss)
        powers = [row @ np.linalg.matrix_power(step, k) @ start for k in range(PACKETS)]
        np.testing.assert_allclose(mean, powers, rtol=0.01)
        assert bool(mean[-1] > mean[-4]) is grows
        assert (loop.growth(loss) > 1) is grows


def test_more_loss_at_longer_periods_is_worse():
    critical = [packet_loop(K06, FORCE, period, AHEAD).critical for period in (0.05, 0.1, 0.2, 0.3)]
    assert (np.diff(critical) < 0).all()


def test_along_a_motion_that_stands_still_it_is_the_loop_of_the_point():
    closed = interconnect(K06, "loop")
    motion = closed.compile().simulate(np.arange(5) * PERIOD, x0=AHEAD)
    along = packet_loop_along(K06, FORCE, motion)
    one = packet_loop(K06, FORCE, PERIOD, AHEAD)
    assert len(along.arrives) == 4
    assert along.growth(0.1) == pytest.approx(one.growth(0.1))
    assert along.critical == pytest.approx(one.critical)


@pytest.mark.slow
def test_c17s_ellipse_bears_every_second_packet_lost_at_22_ms():
    model, reference = c17_simulation(), c17_ellipse()
    blocks = [model.plant(), tracking_controller(model, control_point=0.2, k1=2.0, k2=2.0), reference]
    loop = interconnect(blocks, "loop").compile()
    begin = {k: v for k, v in on_reference(reference, 0.2).items() if k.startswith("plant")}
    settled = loop.simulate([0.0, 20 * np.pi], x0=begin).states[:, -1]
    motion = loop.simulate(np.linspace(20 * np.pi, 22 * np.pi, 281), x0=settled)
    along = packet_loop_along(blocks, ["thrust", "rudder"], motion)
    period = along.growth(0.0) ** 280
    assert period == pytest.approx(np.exp(-4 * np.pi), rel=1.0)  # z'' + 2 z' + 2 z = 0 shrinks as exp(-t)
    assert along.growth(0.5) < 1 < along.growth(0.75)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: packet_loop(K06, FORCE, 0.0), "period must be positive"),
        (lambda: packet_loop(K06, FORCE, 0.1, lost="keep"), "lost: expected 'hold' or 'zero', found 'keep'"),
        (lambda: packet_loop(K06, ["force_z"], 0.1), "no block drives 'force_z'"),
        (lambda: packet_loop(K06, FORCE, 0.1).growth(1.5), "expected a probability, 0 to 1, found 1.5"),
        (lambda: packet_loop(K06, FORCE, 0.1).critical_corruption(0), "tries: expected 1 or more, found 0"),
        (lambda: PacketLoop(np.eye(2), np.eye(2)), r"expected two arrays \(n_steps, n, n\)"),
    ],
)
def test_bad_input_is_refused(call, line):
    with pytest.raises(InputError, match=line):
        call()


def test_a_law_that_ticks_with_the_packets_is_the_law_itself():
    v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    law = {"a": -k.symbol * v.symbol}
    blocks = [Block("law", [], [v], [a], [k], output_expressions=law, period=period) for period in (0.0, 0.1)]
    plain, ticking = (packet_loop([cart, block], "a", period=0.2) for block in blocks)
    for lost in (0.0, 0.3, 0.8):
        assert ticking.growth(lost) == pytest.approx(plain.growth(lost))
