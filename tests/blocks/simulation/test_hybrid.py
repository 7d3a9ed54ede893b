"""Sampled Blocks: what they may say, and how they run beside a continuous one."""

import math

import control
import numpy as np
import pytest
import sympy as sp
from fmpy import simulate_fmu

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.blocks.units import UnitError
from hovercontrol.control.controllers.k06 import bang_bang_heading, origin, proportional_heading
from hovercontrol.fmi.exporter.export import export_fmu
from tests.blocks.simulation.loops import run_loop

v, a, n = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("n")
CART = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})


def counter(period=0.1, name="counter", start=0.0):
    return Block(
        name,
        [n.replace(start=start)],
        [],
        [n.replace(name="count")],
        derivatives={"n": n.symbol + 1},
        output_expressions={"count": n.symbol},
        period=period,
    )


def brake(period=0.25, k=2.0):
    gain = Signal("k", "1/s", start=k)
    return Block(
        "brake", [], [v], [a], [gain], output_expressions={"a": -gain.symbol * v.symbol}, period=period
    )


# ---- the declaration ------------------------------------------------------------------------------


def test_next_values_have_the_unit_of_their_state():
    memory = Block("memory", [v.replace(name="w")], [v], derivatives={"w": v.symbol}, period=0.1)
    assert memory.equations() == "next w = v"
    assert "w^{+} &= v" in memory.equations("latex")
    with pytest.raises(UnitError, match="next w must be in m/s, but 'v/t' is in m/s"):
        Block("memory", [v.replace(name="w")], [v], derivatives={"w": v.symbol / time}, period=0.1)


def test_a_mode_is_a_named_integer():
    mode = Signal("mode", modes=("stop", "turn"))
    assert (mode.mode("turn"), mode.lower, mode.upper) == (1, 0.0, 1.0)
    with pytest.raises(InputError, match=r"mode: unknown mode 'trun'; did you mean 'turn'\?"):
        mode.mode("trun")
    for bad in ({"modes": "stop"}, {"modes": ("a", "a")}, {"modes": ("a", "b"), "unit": "m"}):
        with pytest.raises(InputError, match="mode"):
            Signal("mode", **bad)
    with pytest.raises(InputError, match="out of its bounds"):
        Signal("mode", modes=("a", "b"), start=2)


@pytest.mark.parametrize("period", [-0.1, math.inf, math.nan])
def test_a_period_is_finite_and_not_negative(period):
    with pytest.raises(InputError, match="period must not be negative"):
        counter(period)


def test_a_sampled_block_runs_alone_its_outputs_held(tmp_path):
    times = [0.0, 0.05, 0.1, 0.25, 0.3]
    for run in (simulate(counter(), times), counter().compile().simulate(times)):
        assert np.ravel(run.outputs).tolist() == [0.0, 0.0, 1.0, 2.0, 3.0]
    for write in (Block.to_fmu, export_fmu):
        path = write(counter(), tmp_path / "counter.fmu", step=0.05, stop=0.3)
        run = simulate_fmu(str(path), stop_time=0.3, output_interval=0.05)
        assert run["count"].tolist() == [0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0]


def test_its_python_control_face_is_a_discrete_time_system():
    system = counter(0.5).to_control()
    assert system.dt == 0.5
    response = control.input_output_response(system, np.arange(4) * 0.5)
    assert response.outputs.ravel().tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("make", [bang_bang_heading, proportional_heading, origin])
def test_hybrid_controllers_are_the_same_in_python_control(make, rng):
    block = make()
    names = [s.name for s in block.inputs]
    walk = np.cumsum(rng.normal(0, 0.05, (len(names), 400)), axis=1)
    seen = control.input_output_response(block.to_control(), np.arange(400) * block.period, walk).outputs
    ticking = Ticking(block)
    told = [list(ticking.tick(0.0, dict(zip(names, row, strict=True))).values()) for row in walk.T]
    assert seen == pytest.approx(np.array(told).T, rel=1e-12, abs=1e-12)


def test_blocks_without_states_tick_with_sampled_ones_and_others_make_a_hybrid():
    double = Block(
        "double",
        [],
        [n.replace(name="count")],
        [n],
        output_expressions={"n": 2 * sp.Symbol("count", real=True)},
    )
    assert interconnect([counter(), double]).period == 0.1
    whole = interconnect([CART, counter(), brake()])
    assert (whole.period, [(t.name, t.period) for t in whole.ticks]) == (
        0.0,
        [("counter", 0.1), ("brake", 0.25)],
    )
    assert [s.name for s in whole.states] == ["cart.v", "counter.held_count", "counter.n", "brake.held_a"]
    assert whole.n_continuous == 1
    assert interconnect([counter(), brake()]).n_continuous == 0


# ---- the run --------------------------------------------------------------------------------------


def test_a_sampled_gain_in_the_loop_gives_the_exact_discrete_decay():
    run = run_loop(CART, brake(period=0.1, k=3.0), 2.0, x0={"v": 1.0})
    assert run.time == pytest.approx(np.arange(21) * 0.1)
    assert run.states[0] == pytest.approx(0.7 ** np.arange(21), rel=1e-12)


def test_between_ticks_the_plant_is_integrated_and_the_command_held():
    run = run_loop(CART, brake(period=0.1, k=3.0), 0.5, x0={"v": 1.0}, step=0.02)
    at = {round(float(t), 6): value for t, value in zip(run.time, run.outputs.T, strict=True)}
    assert at[0.06][0] == pytest.approx(1 - 0.06 * 3)
    assert at[0.06][1] == at[0.0][1] == -3.0
    assert run.output_labels == ["v", "a"]


def test_ticks_of_several_periods_fall_exactly_on_their_multiples():
    slow = brake(period=0.3, k=1.0)
    idle = Block("idle", [v.replace(name="w")], [a], derivatives={"w": a.symbol})
    run = run_loop(
        interconnect([CART, idle]), [counter(0.0065536), slow], 1.0, x0={"cart.v": 1.0}, step=0.0065536
    )
    counts = run.outputs[run.output_labels.index("count")]
    assert counts.tolist() == list(range(len(counts)))


def test_of_two_that_tick_together_one_sees_what_the_other_tells_whatever_their_order():
    echo = Block(
        "echo",
        [],
        [n.replace(name="count")],
        [n.replace(name="heard")],
        output_expressions={"heard": sp.Symbol("count", real=True)},
        period=0.1,
    )
    for blocks in ([counter(), echo, brake()], [echo, counter(), brake()]):
        run = run_loop(CART, blocks, 0.5)
        row = {name: run.outputs[i] for i, name in enumerate(run.output_labels)}
        assert row["heard"].tolist() == row["count"].tolist() == [0, 1, 2, 3, 4, 5]


def test_a_hundredfold_faster_tick_comes_a_hundredfold_nearer_to_the_continuous_loop():
    exact = math.exp(-2.0)
    coarse, fine = (
        abs(run_loop(CART, brake(period=p), 1.0, x0={"v": 1.0}, step=1.0).states[0, -1] - exact)
        for p in (0.1, 0.001)
    )
    assert coarse / fine == pytest.approx(100, rel=0.1)


def test_parameters_go_to_their_block_and_unknown_keys_are_refused():
    run = run_loop(CART, brake(), 0.25, x0={"v": 1.0}, params={"brake.k": 4.0})
    assert run.states[0, -1] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(InputError, match=r"unknown parameter 'brake\.q'; did you mean 'brake\.k'\?"):
        run_loop(CART, brake(), 1.0, params={"brake.q": 1.0})


def test_other_parameters_may_hold_from_a_tick_on():
    block = Ticking(brake(k=2.0))
    assert block.tick(0.0, {"v": 1.0}) == {"a": -2.0}
    block.set_parameters({"brake.k": 3.0})
    assert block.tick(0.25, {"v": 1.0}) == {"a": -3.0}
