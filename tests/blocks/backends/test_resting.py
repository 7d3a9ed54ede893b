"""States that rest at zero are found from the equations alone, and leaving them out changes no result."""

import shutil

import numpy as np
import pytest
import sympy as sp

from hovercontrol import Block, Signal, interconnect
from hovercontrol.blocks.backends.compiled import compile_block
from hovercontrol.blocks.backends.resting import without_resting_states
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
LOOP = interconnect(list(loop_parts(load_scenario("table1")).values()), "loop")
NAMES = [s.name for s in LOOP.states]
ZERO = "estimator.P[3,7]"  # between the dry frictions of surge and yaw
GRID = np.linspace(0.0, 5.0, 51)
TIGHT = {"rtol": 1e-9, "atol": 1e-12}


def block(derivatives, parameters=(), starts=None, **more):
    starts = starts or {}
    states = [Signal(name, start=starts.get(name, 0.0)) for name in derivatives]
    rate = Signal("rate", "1/s", start=1.0)
    full = {name: rate.symbol * e for name, e in derivatives.items()}
    return Block("b", states, [], states[:1], [*parameters, rate], full, **more)


X, Y, Z, D = (sp.Symbol(n, real=True) for n in ("x", "y", "z", "d"))
K = Signal("k")


def kept(b):
    return [b.states[k].name for k in without_resting_states(b)[1]]


def test_covariances_that_nothing_couples_rest():
    smaller, places = without_resting_states(LOOP)
    assert len(smaller.states) == len(places) == 83 - 28
    left_out = set(NAMES) - {s.name for s in smaller.states}
    assert ZERO in left_out
    assert all(name.startswith("estimator.P[") for name in left_out)


def test_without_them_the_other_derivatives_are_the_same(rng):
    smaller, places = without_resting_states(LOOP)
    x, kept_x, near = np.zeros(83), rng.normal(size=55), {"rel": 1e-12, "abs": 1e-12}
    x[list(places)] = kept_x
    whole, part = LOOP.to_numpy(), smaller.to_numpy()
    expected = whole.derivatives(0.3, x)
    assert part.derivatives(0.3, kept_x) == pytest.approx(expected[list(places)], **near)
    assert not np.delete(expected, places).any()
    assert part.outputs(0.3, kept_x) == pytest.approx(whole.outputs(0.3, x), **near)


def test_two_that_only_move_each_other_rest_together():
    assert kept(block({"x": 1 + Z, "y": Y + Z * sp.cos(X), "z": sp.sin(Y) * X})) == ["x"]


def test_one_that_is_moved_takes_along_what_it_moves():
    assert kept(block({"x": -X, "y": Z, "z": X}, starts={"x": 1.0})) == ["x", "y", "z"]


def test_a_start_elsewhere_or_a_push_at_zero_is_no_rest():
    assert kept(block({"x": X, "y": Y}, starts={"y": 1.0})) == ["y"]
    assert kept(block({"x": 1 + X, "y": sp.cos(Y)})) == ["x", "y"]
    assert kept(block({"x": 1 + X, "y": K.symbol + Y}, [K])) == ["x", "y"]  # though k is zero by default


def test_a_definition_between_is_seen_through():
    assert kept(block({"x": 1 + D, "y": D + Y}, definitions={"d": Y * X})) == ["x"]


def test_where_zero_has_no_value_nothing_is_left_out():
    assert kept(block({"x": 1 + sp.sin(Y) / Y, "y": Y})) == ["x", "y"]


@pytest.mark.slow
@needs_cc
def test_a_simulation_without_them_is_the_whole_ones():
    ready = compile_block(LOOP)
    assert len(ready._engine.resting) == 28
    found = ready.simulate(GRID, **TIGHT)
    nearly = {ZERO: 1e-300}  # not zero, and nothing else
    whole = ready.simulate(GRID, x0=nearly, **TIGHT)
    np.testing.assert_allclose(found.states, whole.states, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.outputs, whole.outputs, rtol=1e-9, atol=1e-12)
    assert not found.states[ready._engine.resting].any()
    assert found.state_labels == whole.state_labels == NAMES


@pytest.mark.slow
@needs_cc
def test_states_that_do_not_start_at_rest_move():
    ready = compile_block(LOOP, friction="smooth")
    x0 = {ZERO: 1e-3}
    expected = simulate(LOOP, GRID, x0=x0, method="DOP853", **TIGHT)
    found = ready.simulate(GRID, x0=x0, **TIGHT)
    np.testing.assert_allclose(found.states, expected.states, rtol=1e-6, atol=1e-8)
    assert found.states[NAMES.index(ZERO), -1] != 0.0


@needs_cc
def test_a_sweep_takes_both_kinds_of_start():
    ready = compile_block(LOOP)
    grid, keep = np.linspace(0, 1, 11), {"plant.x": [0.1, 0.2]}
    rest, moving = (ready.sweep(grid, x0={**keep, ZERO: [0.0, value]}) for value in (0.0, 1e-3))
    assert not rest.states_final[:, ready._engine.resting].any()
    np.testing.assert_allclose(rest.states_final[0], moving.states_final[0], rtol=1e-8, atol=1e-12)
    single = ready.simulate(grid, x0={"plant.x": 0.2, ZERO: 1e-3})
    np.testing.assert_array_equal(moving.states_final[1], single.states[:, -1])
