"""A hybrid Block is the same in every backend: when it ticks to the bit, what it computes to rounding."""

from fractions import Fraction
from itertools import pairwise

import control
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.blocks.ticks import Schedule

v, a, push = Signal("v", "m/s", start=1.0), Signal("a", "m/s^2"), Signal("push", "m/s^2")
CART = Block("cart", [v], [a, push], [v], derivatives={"v": a.symbol + push.symbol})
SEEN = Signal("seen", "m/s")


def sensor(period=0.0065536):
    noise = random_numbers(1, salt="sensor")
    size = Signal("size", "m/s", start=0.01)
    return Block(
        "sensor", noise.states, [v], [SEEN], (*noise.parameters, size), noise.next_values,
        {"seen": v.symbol + size.symbol * noise.values[0]}, noise.definitions, period=period,
    )  # fmt: skip


def brake(period=0.02):
    k = Signal("k", "1/s", start=2.0)
    return Block(
        "brake", [], [SEEN], [a], [k], output_expressions={"a": -k.symbol * SEEN.symbol}, period=period
    )


def watch(period=0.001):
    """Tells the time of its last tick, and counts them."""
    n, at = Signal("n"), Signal("at", "s")
    return Block(
        "watch", [n], [], [Signal("ticks"), at], derivatives={"n": n.symbol + 1},
        output_expressions={"ticks": n.symbol + 1, "at": time}, period=period,
    )  # fmt: skip


LOOP = interconnect([CART, brake(), sensor(), watch()])
TIMES = np.arange(1001) * 0.001
PUSH = np.where((TIMES > 0.2) & (TIMES < 0.5), 0.3, 0.0)


def rows(response):
    return dict(zip(response.output_labels, np.atleast_2d(response.outputs), strict=True))


@pytest.fixture(scope="module")
def expected():
    return rows(simulate(LOOP, TIMES, {"push": PUSH}))


def assert_same(found, expected, tolerance=1e-12):
    assert found["at"].tolist() == expected["at"].tolist()  # to the bit
    assert found["ticks"].tolist() == expected["ticks"].tolist()
    for name in ("v", "a", "seen"):
        assert found[name] == pytest.approx(expected[name], rel=tolerance, abs=tolerance)


# ---- the ticks ------------------------------------------------------------------------------------


def test_ticks_are_where_exact_fractions_say(expected):
    assert expected["at"].tolist() == [k / 1000 for k in range(1001)]
    assert expected["ticks"].tolist() == list(range(1, 1002))


@settings(deadline=None, max_examples=10)
@given(
    periods=st.lists(st.integers(1, 100_000), min_size=1, max_size=4),
    digits=st.integers(3, 7),
    start=st.floats(0.0, 100.0),
)
def test_a_schedule_takes_every_multiple_of_every_period_once_and_in_order(periods, digits, start):
    exact = [Fraction(p, 10**digits) for p in periods]
    schedule = Schedule([p / 10**digits for p in periods], start)
    taken = []
    for _ in range(20):
        at = schedule.time
        taken += [(at, k) for k in schedule.take(at)]
    assert taken == sorted(taken)
    assert all(at == float(round(Fraction(at) / exact[k]) * exact[k]) for at, k in taken)
    last = taken[-1][0]
    for k, period in enumerate(exact):
        first = -(-Fraction(start) // period)
        wanted = [float(m * period) for m in range(first, first + 21) if start < float(m * period) < last]
        assert [at for at, j in taken if j == k and start < at < last] == wanted


def test_a_period_without_exact_ticks_is_refused_with_the_nearest():
    with pytest.raises(
        InputError, match=r"0\.3333333333333333 s is not a whole number of picoseconds.*0\.333333333 s"
    ):
        simulate(interconnect([CART, brake(1 / 3), sensor()]), TIMES)


# ---- the backends ------------------------------------------------------------------------------------


def test_compiled_is_numpy(expected):
    compiled = LOOP.compile()
    assert_same(rows(compiled.simulate(TIMES, {"push": PUSH})), expected)
    assert_same(rows(compiled.simulate(TIMES, {"push": PUSH}, method="rk4", step=0.0025)), expected)


@pytest.mark.slow
def test_rows_between_ticks_are_not_smeared():
    """Rows that are finer or coarser than the ticks, or beside them, see the same run."""
    whole = interconnect([CART, brake(), sensor()])
    fine = np.arange(10001) * 0.0001
    compiled = whole.compile()
    every = rows(compiled.simulate(fine, rtol=1e-9))
    for method in ({"rtol": 1e-9}, {"method": "rk4", "step": 0.0025}):
        coarse = rows(compiled.simulate(fine[::777], **method))
        for name, values in coarse.items():
            assert values == pytest.approx(every[name][::777], rel=1e-12, abs=1e-12)
    held = rows(simulate(whole, fine))
    for name, values in held.items():
        assert values == pytest.approx(every[name], rel=1e-12, abs=1e-12)
    assert set(np.flatnonzero(np.diff(every["a"])) + 1) <= set(range(0, 10001, 200))


@pytest.mark.parametrize("step", [0.001, 0.01])
def test_python_control_is_numpy_whatever_the_step(expected, step):
    system = LOOP.to_control(step=step)
    stride = round(step / 0.001)
    pushed = PUSH.copy()
    pushed[:] = np.repeat(PUSH[::stride], stride)[: len(PUSH)]
    start = [s.start for s in LOOP.states]
    run = control.input_output_response(system, TIMES[::stride], pushed[None, ::stride], start)
    found = rows(simulate(LOOP, TIMES, {"push": pushed}))
    assert_same(rows(run), {name: values[::stride] for name, values in found.items()})
    with pytest.raises(InputError, match="has parts that tick and therefore no linearisation"):
        system.linearize(start, [0.0])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_the_fmu_is_numpy(expected, tmp_path, version, kind):
    path = LOOP.to_fmu(tmp_path / "loop.fmu", version=version, step=0.001, stop=1.0)
    assert validate_fmu(str(path)) == []
    pushed = np.array(list(zip(TIMES, PUSH, strict=True)), dtype=[("time", float), ("push", float)])
    steps = {"step_size": 0.001} if kind == "CoSimulation" else {"solver": "CVode"}
    run = simulate_fmu(
        str(path), fmi_type=kind, stop_time=1.0, output_interval=0.001, relative_tolerance=1e-8,
        input=pushed if kind == "CoSimulation" else None, **steps,
    )  # fmt: skip
    if kind == "CoSimulation":
        assert_same({name: run[name] for name in expected}, expected)
        return
    times = run["time"]
    last = np.flatnonzero(np.append(np.diff(times) > 1e-12, True))  # after the events of each time
    found = {name: run[name][last][np.isin(times[last].round(9), TIMES.round(9))] for name in expected}
    assert_same(found, rows(simulate(LOOP, TIMES)), 1e-7)


def test_a_tick_sees_inputs_that_jump_at_its_instant():
    x, u = Signal("x"), Signal("u")
    grab = Block("grab", [], [u], [x], output_expressions={"x": u.symbol}, period=0.5)
    hybrid = interconnect([grab, CART, brake().named("own"), sensor()])
    times, values = [0.0, 0.5, 0.75, 1.0], [1.0, 2.0, 3.0, 4.0]
    for run in (simulate(hybrid, times, {"u": values}), hybrid.compile().simulate(times, {"u": values})):
        assert rows(run)["x"].tolist() == [1.0, 2.0, 2.0, 4.0]


def test_going_on_in_steps_is_going_at_once():
    compiled = LOOP.compile()
    state = np.array([s.start for s in LOOP.states])
    cuts = [0.0, 0.0123, 0.02, 0.1, 0.1000001, 0.73, 1.0]
    for begin, end in pairwise(cuts):
        state = compiled.advance(begin, end, state, [0.0])
    state = compiled.advance(1.0, 1.0, state, [0.0])
    at_once = compiled.simulate([0.0, 1.0]).states[:, -1]
    assert state == pytest.approx(at_once, rel=1e-12, abs=1e-12)


def test_a_hybrid_block_is_a_part_as_any_other(expected):
    inner = interconnect([brake(), sensor()], "pilot")
    nested = interconnect([CART, inner, watch()])
    assert_same(rows(simulate(nested, TIMES, {"push": PUSH})), expected)


def test_the_order_of_parts_does_not_matter(expected):
    other = interconnect([watch(), brake(), sensor(), CART])
    assert_same(rows(simulate(other, TIMES, {"push": PUSH})), expected)


def test_two_that_need_each_other_take_their_next_states_after_all_outputs():
    """Two samples exchanged at each tick: as one sampled Block computes it."""
    p, q = Signal("p", start=1.0), Signal("q", start=2.0)
    x, y = Signal("x"), Signal("y")
    left = Block("left", [p], [y], [x], [], {"p": y.symbol}, {"x": p.symbol}, period=0.1)
    right = Block("right", [q], [x], [y], [], {"q": x.symbol}, {"y": q.symbol}, period=0.1)
    slow = watch(0.3)
    run = rows(simulate(interconnect([left, right, slow]), [0.0, 0.1, 0.2, 0.3]))
    assert run["x"].tolist() == [1.0, 2.0, 1.0, 2.0]
    assert run["y"].tolist() == [2.0, 1.0, 2.0, 1.0]


def test_a_sweep_over_the_seed_is_as_many_runs():
    compiled = interconnect([CART, brake(), sensor()]).compile()
    seeds = [1.0, 2.0, 3.0]
    swept = compiled.sweep([0.0, 0.5], params={"sensor.seed": seeds})["v"].final
    each = [compiled.simulate([0.0, 0.5], params={"sensor.seed": s}).states[0, -1] for s in seeds]
    assert swept.tolist() == each
    assert len(set(each)) == 3


def test_rows_a_hair_before_a_tick_are_at_it():
    """``k * period`` in floating point may be less than the exact instant."""
    whole = interconnect([CART, brake(), sensor(), watch(0.0065536)])
    grid = np.arange(150) * 0.0065536
    for run in (simulate(whole, grid), whole.compile().simulate(grid)):
        assert rows(run)["ticks"].tolist() == list(range(1, 151))


def test_what_is_fast_between_ticks_is_integrated_to_its_tolerance():
    x = Signal("x", start=1.0)
    lag = Block("lag", [x], [], [x], derivatives={"x": -x.symbol / Signal("T", "s", start=1e-3).symbol},
                parameters=[Signal("T", "s", start=1e-3)])  # fmt: skip
    grid = np.arange(11) * 0.001
    for run in (simulate(interconnect([lag, watch(0.01)]), grid, rtol=1e-8, atol=1e-12),):
        assert rows(run)["x"] == pytest.approx(np.exp(-grid / 1e-3), abs=1e-8)
