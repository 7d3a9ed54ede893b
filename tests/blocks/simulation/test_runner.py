"""Stepping is simulating: whatever the grid, the Block, the engine; and a snapshot goes on to the bit."""

import dataclasses
import pickle
import shutil

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol import Block, InputError, Signal, interconnect, time, vehicle
from hovercontrol.blocks.backends import engines
from hovercontrol.blocks.backends.compiled import compile_block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.simulation.trajectory import simulate

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
TIGHT = {"rtol": 1e-10, "atol": 1e-12}

v, a, push = Signal("v", "m/s", start=1.0), Signal("a", "m/s^2"), Signal("push", "m/s^2")
SEEN, FELT, LATE = Signal("seen", "m/s"), Signal("felt", "m/s^2"), Signal("late", "s", start=0.013)
DRAG, K = Signal("drag", "1/s", start=0.5), Signal("k", "1/s", start=1.0)


def cart(**delays):
    slope = {"v": a.symbol + push.symbol - DRAG.symbol * v.symbol}
    return Block(
        "cart", [v], [a, push], [v, FELT], [DRAG, *([LATE] if delays else [])], slope,
        {"felt": push.symbol}, delays=delays,
    )  # fmt: skip


def sensor(period=0.0065536):
    """Sees v with noise: its random numbers are states."""
    noise, size, lever = (
        random_numbers(1, salt="sensor"),
        Signal("size", "m/s", start=0.01),
        Signal("lever", "s"),
    )
    seen = v.symbol + size.symbol * noise.values[0] + lever.symbol * push.symbol
    return Block(
        "sensor", noise.states, [v, push], [SEEN], [*noise.parameters, size, lever.replace(start=0.1)],
        noise.next_values, {"seen": seen}, noise.definitions, period=period,
    )  # fmt: skip


def brake(period=0.02):
    """Brakes hard from 1.2 m/s on until below 0.8 m/s, and counts its ticks: phases."""
    mode, n = Signal("mode", modes=("free", "hard")), Signal("n")
    high, low = Signal("high", "m/s", start=1.2), Signal("low", "m/s", start=0.8)
    hard = sp.Piecewise((1, SEEN.symbol > high.symbol), (0, SEEN.symbol < low.symbol), (mode.symbol, True))
    return Block(
        "brake", [mode, n], [SEEN], [a, Signal("ticks")], [K, high, low],
        {"mode": hard, "n": n.symbol + 1},
        {"a": -(1 + 3 * hard) * K.symbol * SEEN.symbol, "ticks": n.symbol}, period=period,
    )  # fmt: skip


EYE = Block("eye", [], [v], [SEEN], output_expressions={"seen": v.symbol}, period=0.01)
HYBRID = interconnect([cart(), brake(), sensor()], "hybrid", inputs=["push"])
LATE_HYBRID = interconnect([cart(push=LATE.symbol), brake(), EYE], "late", inputs=["push"])
AT, LONG, HIGH = (
    Signal("at", "s", start=0.105),
    Signal("long", "s", start=0.02),
    Signal("high", "m/s^2", start=50.0),
)
DURING = (time > AT.symbol) & (time < AT.symbol + LONG.symbol)
PULSE = Block(
    "pulse", [v], [push], [v], [AT, LONG, HIGH],
    {"v": push.symbol + sp.Piecewise((HIGH.symbol, DURING), (0, True))},
)  # fmt: skip
CRAFT = vehicle("c17_experiment").plant()
WATCHED = interconnect([cart(), brake(), EYE], "watched", inputs=["push"])
GROWTH = Block(
    "growth", [v], [], [v], [Signal("k", "1/s", lower=0.0), Signal("c", "1/m")],
    {"v": -K.symbol * v.symbol + Signal("c", "1/m").symbol * v.symbol**2},
)  # fmt: skip
BLOCKS = {"hybrid": HYBRID, "late": LATE_HYBRID, "pulse": PULSE, "craft": CRAFT, "sampled": brake()}


def start(block, engine, **options):
    return (block.compile(friction="smooth") if engine == "native" else block).start(**options)


def stepped(runner, grid, inputs):
    """Rows as `simulate` has them: at each time after that time's inputs have jumped."""
    states, outputs = [], []
    for k in range(len(grid)):
        runner.set(inputs=inputs[:, k])
        states.append(runner.state)
        outputs.append(runner.outputs)
        if k < len(grid) - 1:
            runner.step(None, grid[k + 1] - grid[k])
    return np.array(states).T, np.array(outputs).T


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("name", BLOCKS)
def test_stepping_is_simulating_the_same_grid(name, engine):
    block = BLOCKS[name]
    whole = block.in_continuous_time

    @settings(deadline=None, max_examples=8, database=None)
    @given(
        counts=st.lists(st.integers(1, 40), min_size=3, max_size=8),
        unit=st.sampled_from([0.001, 0.0065536, 0.01]),
        values=st.lists(st.sampled_from([-1.0, 0.0, 0.3, 2.0]), min_size=20, max_size=20),
    )
    def holds(counts, unit, values):
        grid = np.cumsum([0, *counts]) * unit
        n = len(whole.inputs)
        u = np.resize(values, (n, len(grid)))
        expected = simulate(whole, grid, u if n else None, hold="zero", **TIGHT)
        states, outputs = stepped(start(block, engine, **TIGHT), grid, u)
        np.testing.assert_allclose(states, np.atleast_2d(expected.states), 1e-7, 1e-8)
        np.testing.assert_allclose(outputs, np.atleast_2d(expected.outputs), 1e-7, 1e-8)

    holds()


@needs_cc
def test_dry_friction_sticks_and_lets_go_as_in_a_whole_simulation():
    compiled = compile_block(CRAFT)
    grid = np.arange(0.0, 3.0, 0.02)
    u = np.array([np.where(grid < 1.0, 3.0, np.where(grid < 2.0, 0.0, 5.0)), np.where(grid < 0.5, 0.4, -0.2)])
    expected = compiled.simulate(grid, u, **TIGHT)
    states, _ = stepped(compiled.start(**TIGHT), grid, u)
    np.testing.assert_allclose(states, expected.states, 1e-7, 1e-8)
    assert (states[4] == 0.0).any()  # it does stick


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
def test_ticks_stay_on_time_over_many_steps(engine):
    """A sum of 0.001 s leaves the grid of ticks after some thousand steps; the runner's clock does not."""
    runner = start(brake(0.02), engine)
    steps = 30_000 if engine == "native" else 3_000
    for _ in range(steps):
        ticks = runner.step([0.0], 0.001)[1]
    assert runner.time == pytest.approx(steps * 0.001, rel=1e-15)
    assert ticks == steps // 20


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("name", BLOCKS)
def test_from_a_snapshot_it_goes_on_to_the_bit_also_elsewhere(name, engine):
    block = BLOCKS[name]
    n = len(block.in_continuous_time.inputs)
    runner = start(block, engine)
    for k in range(7):
        runner.step([0.5 + 0.1 * k] * n, 0.011)
    snapshot = pickle.loads(pickle.dumps(runner.save()))
    first = [runner.step([1.5] * n, 0.003 * (k + 1)) for k in range(9)]
    runner.restore(snapshot)
    again = [runner.step([1.5] * n, 0.003 * (k + 1)) for k in range(9)]
    other = start(block, engine)
    other.restore(snapshot)
    elsewhere = [other.step([1.5] * n, 0.003 * (k + 1)) for k in range(9)]
    assert np.array_equal(first, again) and np.array_equal(first, elsewhere)
    assert runner.time == other.time and np.array_equal(runner.state, other.state)


def shortened(snapshot, by):
    """The snapshot as its maker would have it, its last part cut or made longer."""
    *rest, saved = snapshot.data
    if isinstance(saved, bytes):
        return dataclasses.replace(snapshot, data=(*rest, saved[:by] if by < 0 else saved + bytes(by)))
    states = saved[4][:by] if by < 0 else saved[4] * 2
    return dataclasses.replace(snapshot, data=(*rest, (*saved[:4], states, *saved[5:])))


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_damaged_snapshot_is_refused_and_changes_nothing(engine, rng):
    """Bits flipped in what pickle wrote, parts too short or too long, numbers that are none."""
    runner, same = (start(LATE_HYBRID, engine) for _ in range(2))
    for each in (runner, same):
        each.step([0.5], 0.011)
    snapshot = runner.save()
    none = dataclasses.replace(snapshot, data=(np.nan, *snapshot.data[1:]))
    for wrong in (shortened(snapshot, -8), shortened(snapshot, 8), shortened(snapshot, -1), none,
                  dataclasses.replace(snapshot, data=snapshot.data[:-1])):  # fmt: skip
        with pytest.raises(InputError, match="the snapshot is not one of save") as refused:
            runner.restore(wrong)
        assert "\n" not in str(refused.value)
    content, first = pickle.dumps(snapshot), same.step([1.5], 0.007).tolist()
    assert runner.step([1.5], 0.007).tolist() == first
    for _ in range(150):
        flipped = bytearray(content)
        bit = int(rng.integers(8 * len(content)))
        flipped[bit // 8] ^= 1 << bit % 8
        try:
            found = pickle.loads(bytes(flipped))
        except Exception:  # pickle's own
            continue
        try:
            runner.restore(found)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert runner.step([1.5], 0.007).tolist() == first


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
def test_what_is_set_acts_at_once_and_ticks_see_it(engine):
    runner = start(WATCHED, engine, x0={"cart.v": 0.5}, inputs={"push": 0.2}, time=3.0)
    assert runner.time == 3.0 and runner.inputs.tolist() == [0.2]
    n = runner.state_labels.index("brake.n")
    assert runner.state[n] == 1.0  # the tick at 3.0 s
    runner.set(state={"cart.v": 2.0})
    assert runner.state[runner.state_labels.index("cart.v")] == 2.0
    assert runner.state[n] == 1.0  # taken again, not once more
    assert runner.state[runner.state_labels.index("brake.mode")] == 1.0  # it sees 2 m/s
    runner.set(state={"brake.n": 10.0})
    assert runner.state[n] == 11.0
    runner.step(None, 0.012)
    runner.set(state={"brake.n": 20.0})  # no tick here
    assert runner.state[n] == 20.0
    assert runner.step({"push": 1.0}, 0.01)[runner.output_labels.index("felt")] == 1.0


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_parameter_that_is_set_is_that_of_a_new_run(engine):
    runner = start(GROWTH, engine, params={"growth.k": 2.0}, **TIGHT)
    runner.step(None, 0.5)
    runner.set(params={"growth.k": 0.5})
    assert runner.params == {"growth.k": 0.5, "growth.c": 0.0}
    with pytest.raises(InputError, match=r"growth\.k = -1 1/s is out of its bounds"):
        runner.set(params={"growth.k": -1.0})
    assert runner.step(None, 2.0)[0] == pytest.approx(np.exp(-2.0), rel=1e-8)


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("work", "line"),
    [
        (lambda r: r.step([1.0, 2.0], 0.1), r"expected 1 inputs \(push\), found 2 of shape \(2,\)"),
        (lambda r: r.step({"puhs": 1.0}, 0.1), "unknown input 'puhs'; did you mean 'push'"),
        (lambda r: r.step([np.nan], 0.1), "input 'push' is nan"),
        (lambda r: r.step(["x"], 0.1), r"expected numbers as inputs, found \['x'\]"),
        (lambda r: r.step([0.0], 0.0), "expected a step longer than 0 s, found 0.0"),
        (lambda r: r.set(state={"cart.w": 0.0}), "unknown state 'cart.w'; did you mean 'cart.v'"),
        (lambda r: r.set(state=[1.0]), "expected 2 initial states|expected 1 initial states|found 1"),
        (lambda r: r.set(params={"cart.late": 0.5}), "the delay of an input cannot change"),
        (lambda r: r.restore(start(CRAFT, "python").save()), "snapshot is of block plant, not of block late"),
    ],
)
def test_wrong_use_is_one_line_and_changes_nothing(work, line, engine):
    runner, same = (start(LATE_HYBRID, engine) for _ in range(2))
    with pytest.raises(InputError, match=line) as refused:
        work(runner)
    assert "\n" not in str(refused.value)
    runner.set(inputs=[0.0])
    assert np.array_equal(runner.step(None, 0.05), same.step(None, 0.05))


@needs_cc
@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_run_that_cannot_go_on_says_where_and_can_go_back(engine):
    runner = start(GROWTH, engine, params={"growth.c": 1.0})
    begin = runner.save()
    runner.step(None, 0.5)
    with pytest.raises(InputError, match=r"growth': the run stops at t = (0\.5|0\.9|1)"):
        runner.step(None, 1.0)
    runner.restore(begin)
    assert runner.step(None, 0.5)[0] == pytest.approx(2.0, rel=1e-4)


def test_without_a_compiler_python_does_the_work(monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    engines.engine_of.cache_clear()
    engines._warn_once.cache_clear()
    try:
        with pytest.warns(UserWarning, match="run on NumPy"):
            runner = HYBRID.compile().start()
        assert np.array_equal(runner.step([0.3], 0.1), HYBRID.start().step([0.3], 0.1))
    finally:
        engines.engine_of.cache_clear()
