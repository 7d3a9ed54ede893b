"""Inputs that act late: a delayed step is a step, only later, in every backend."""

import math
import pickle

import control
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import arrivals, pade, registers, undelayed
from hovercontrol.blocks.interconnect import interconnect, prefix, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.blocks.units import UnitError
from hovercontrol.control.observers.regression import regression
from hovercontrol.craft.effects import effect
from hovercontrol.craft.hardware.links import constant_delay
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation

x, v = Signal("x", "m"), Signal("v", "m/s")
push, brake = Signal("push", "m/s", start=0.5), Signal("brake", "m/s")
rate, late, later = Signal("rate", "1/s", start=2.0), Signal("late", "s", start=0.3), Signal("later", "s")
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def lag(**changes):
    """x' = rate (push - x), the push late."""
    made = Block(
        "lag", [v], [push], [v, Signal("felt", "m/s")], [rate, late],
        {"v": rate.symbol * (push.symbol - v.symbol)}, {"felt": push.symbol}, delays={"push": late.symbol},
    )  # fmt: skip
    return made.with_values(changes) if changes else made


def response(t, late, size, rate=2.0, start=0.5):
    """The lag's exact answer to a step from its input's start value to `size` at time 0."""
    before = start * (1 - np.exp(-rate * t))
    after = size + (start * (1 - math.exp(-rate * late)) - size) * np.exp(-rate * (t - late))
    return np.where(t < late, before, after)


def backends():
    try:
        find_compiler()
    except NoCompilerError:
        return [simulate]
    return [simulate, lambda block, *args, **options: block.compile().simulate(*args, **options)]


# ---- exact answers --------------------------------------------------------------------------------


@pytest.mark.parametrize("run", backends())
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.25, 0.3, 0.777, 5.0])
def test_a_delayed_step_gives_the_exact_answer(run, delay):
    t = np.linspace(0.0, 2.0, 21)
    found = run(lag(), t, {"push": 2.0}, params={"lag.late": delay}, **TIGHT)
    np.testing.assert_allclose(found.outputs[0], response(t, delay, 2.0), atol=1e-8)
    arrived = t >= delay - 1e-12
    np.testing.assert_array_equal(found.outputs[1], np.where(arrived, 2.0, 0.5))
    assert (found.inputs == 2.0).all()  # what is sent, not what arrives


@settings(max_examples=10, deadline=None)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=12),
    st.integers(0, 30),
    st.sampled_from([0.02, 0.1, 1 / 3]),
)
def test_a_delay_of_whole_samples_is_a_shift(sent, n, step):
    """Where t + delay is only rounding away from a sample, it is that sample."""
    t = np.arange(len(sent)) * step
    found = arrivals(lag(), t, np.array([sent]), [2.0, n * step])
    assert len(found.times) == len(t)
    shifted = [*[push.start] * n, *sent][: len(sent)]
    assert found.inputs[0].tolist() == shifted


@settings(max_examples=10, deadline=None)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=8),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_what_arrives_is_what_was_sent_a_delay_ago(sent, one, other):
    block = Block(
        "two", [v], [push, brake], [v], [late, later], {"v": (push.symbol - brake.symbol) / late.symbol},
        delays={"brake": later.symbol, "push": late.symbol},
    )  # fmt: skip
    t = np.linspace(0.0, 1.0, len(sent))
    found = arrivals(block, t, np.array([sent, sent[::-1]]), [one, other])
    assert (np.diff(found.times) > 0).all()
    np.testing.assert_array_equal(found.times[found.given], t)
    for at, *values in zip(found.times, *found.inputs, strict=True):
        rows = zip(values, (sent, sent[::-1]), (one, other), (push, brake), strict=True)
        for value, row, delay, signal in rows:
            near = {int(np.searchsorted(t, at - delay + e, side="right")) - 1 for e in (-1e-12, 1e-12)}
            assert value in {row[k] if k >= 0 else signal.start for k in near}


def test_a_delayed_craft_moves_as_one_whose_commands_are_shifted_by_hand():
    craft = c17_simulation().with_effects([effect("input_delay", seconds=0.13)])
    plant, plain = craft.plant(), c17_simulation().plant()
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 2.0, 41)
    sent = rng.uniform([[0.0], [-0.5]], [[2.0], [0.5]], (2, 41))
    found = simulate(plant, t, sent, **TIGHT)
    f = plain.to_numpy()
    state, states = np.zeros(6), [np.zeros(6)]
    edges = np.unique(np.concatenate([t, t + 0.13, [2.0]]))
    for a, b in zip(edges[edges < 2.0], edges[1:], strict=False):
        k = int(np.searchsorted(t, 0.5 * (a + b) - 0.13)) - 1
        u = sent[:, k] if k >= 0 else np.zeros(2)
        run = solve_ivp(lambda t, x, u=u: f.derivatives(t, x, u), (a, b), state, method="DOP853", **TIGHT)
        state = run.y[:, -1]
        if np.isclose(b, t).any():
            states.append(state)
    np.testing.assert_allclose(found.outputs, np.transpose(states), atol=1e-7)


def test_late_measurements_are_those_of_a_craft_that_moves_later():
    """x(t - tau) of a craft without a clock in its equations, and both kinds of delay add up."""
    t = np.linspace(0.0, 2.0, 101)
    sent = [1.0 + np.sin(3 * t), 0.3 * np.cos(2 * t)]
    model = c17_simulation()
    on_time = simulate(model.plant(), t, sent, **TIGHT).outputs
    offset = model.with_effects([effect("time_offset", seconds=0.1)])
    seen = simulate(offset.plant(), t, sent, **TIGHT).outputs
    np.testing.assert_allclose(seen[:, 5:], on_time[:, :-5], atol=1e-8)
    np.testing.assert_array_equal(seen[:, :5], 0.0)
    both = offset.with_effects([effect("input_delay", seconds=0.04)])
    seen = simulate(both.plant(), t, sent, **TIGHT).outputs
    np.testing.assert_allclose(seen[:, 7:], on_time[:, :-7], atol=1e-8)


# ---- sweeps ---------------------------------------------------------------------------------------


def test_a_sweep_over_delays_gives_each_runs_own_answer():
    t = np.linspace(0.0, 2.0, 21)
    delays = [0.3, 0.0, 0.9, 0.3, 0.15, 3.0]
    found = lag().compile().sweep(t, inputs={"push": 2.0}, params={"lag.late": delays}, **TIGHT)
    expected = [float(response(2.0, delay, 2.0)) for delay in delays]
    np.testing.assert_allclose(found["v"].final, expected, atol=1e-8)
    np.testing.assert_array_equal(found["felt"].minimum, [2.0 if d == 0 else 0.5 for d in delays])
    assert found.parameters["lag.late"].tolist() == delays
    one = lag().compile().sweep(t, inputs={"push": 2.0}, x0={"v": [0.0, 1.0, 2.0]}, **TIGHT)
    assert one["v"].final[0] == found["v"].final[0]


def test_a_sweep_over_too_many_delays_is_refused():
    with pytest.raises(InputError, match="1500 different delays in one sweep; at most 1000"):
        lag().compile().sweep([0.0, 1.0], params={"lag.late": np.linspace(0, 1, 1500)})


# ---- python-control -------------------------------------------------------------------------------


def test_python_control_offers_its_two_ways():
    with pytest.raises(InputError, match=r"no continuous delay.*'push'.*pade=4.*step=h") as caught:
        lag().to_control()
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no input acts late"):
        undelayed(lag()).to_control(pade=2)


def test_shift_registers_are_exact_where_inputs_change_at_their_step():
    rng = np.random.default_rng(1)
    t = np.arange(101) * 0.05
    sent = rng.normal(size=t.size)
    system = lag().to_control(step=0.05)
    assert control.isdtime(system, strict=True) and system.dt == 0.05
    start = [s.start for s in registers(lag(), 0.05).states]  # python-control begins at zero by itself
    run = control.input_output_response(system, t, sent, start)
    expected = simulate(lag(), t, sent, **TIGHT)
    np.testing.assert_allclose(run.outputs[0], expected.outputs[0], atol=1e-5)
    np.testing.assert_array_equal(run.outputs[1], expected.outputs[1])


def test_shift_registers_are_the_links_of_the_hardware():
    """The same loop, wired by hand from a delay line and the plant."""
    chain = constant_delay([push], 0.3, 0.1, name="link")
    wired = interconnect([rename(undelayed(lag()), {"push": "push_received"}), chain], outputs=["v", "felt"])
    t = np.arange(41) * 0.1
    sent = np.sin(7 * t)
    ours, theirs = simulate(registers(lag(), 0.1), t, sent), simulate(wired, t, sent)
    np.testing.assert_array_equal(ours.outputs, theirs.outputs)
    np.testing.assert_allclose(ours.outputs[0], simulate(lag(), t, sent, **TIGHT).outputs[0], atol=1e-6)


def test_a_delay_between_two_steps_is_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"0\.3 s is not a multiple.*0\.28 s and 0\.35 s"):
        lag().to_control(step=0.07)


def test_registers_have_no_parameter_that_would_do_nothing():
    with pytest.raises(InputError, match=r"lag\.late"):
        lag().to_control(step=0.1).dynamics(0, np.zeros(8), [0.0], params={"lag.late": 0.1})


@pytest.mark.parametrize("order", range(1, 7))
def test_pades_fraction_meets_the_delay_up_to_its_order(order):
    """exp(-s T): the fraction's error begins with s^(2 order) as the textbooks say."""
    block = Block("pure", inputs=[push], outputs=[Signal("y", "m/s")], parameters=[late],
                  output_expressions={"y": push.symbol}, delays={"push": late.symbol})  # fmt: skip
    system = block.to_control(pade=order).linearize(np.zeros(order), [0.0])
    errors = [abs(system(1j * w) - np.exp(-0.3j * w)) for w in (0.5, 1.0)]
    assert errors[1] < 0.1
    if errors[0] > 1e-11:
        assert math.log2(errors[1] / errors[0]) == pytest.approx(2 * order, abs=0.1 * order)


def test_pades_fraction_rests_at_the_start_value():
    found = simulate(pade(lag(), 4), [0.0, 1.0, 2.0], {"push": 0.5}, {"v": 0.5}, **TIGHT)
    np.testing.assert_allclose(found.outputs, 0.5, atol=1e-9)


@pytest.mark.parametrize("order", [0, 11, 1.5, "4"])
def test_a_wrong_order_is_refused(order):
    with pytest.raises(InputError, match="whole number from 1 to 10"):
        pade(lag(), order)


# ---- a Block says it --------------------------------------------------------------------------------


def test_names_follow_the_signals():
    block = prefix(lag(), "left")
    assert dict(block.delays) == {"left_push": late.symbol}
    t, sent = np.linspace(0, 1, 11), np.linspace(1, 2, 11)
    np.testing.assert_array_equal(simulate(block, t, sent).outputs, simulate(lag(), t, sent).outputs)
    plant = c17_simulation().with_effects([effect("input_delay", seconds=0.1)]).plant()
    own = sp.Symbol("rival.input_delay_seconds", real=True)
    assert set(plant.named("rival").delays.values()) == {own}
    assert lag() == pickle.loads(pickle.dumps(lag()))
    assert len({lag().content_hash, undelayed(lag()).content_hash}) == 2
    assert "push acts late by late" in lag().equations()
    assert "acts late by" in lag().equations("latex")


def test_an_open_input_stays_late_in_the_whole():
    watch = Block("watch", [x], [v], [x], derivatives={"x": v.symbol})
    whole = interconnect([lag(), watch])
    assert dict(whole.delays) == {"push": sp.Symbol("lag.late", real=True)}
    t = np.linspace(0.0, 2.0, 21)
    found = dict(
        zip((s.name for s in whole.outputs), simulate(whole, t, 2.0 + 0 * t, **TIGHT).outputs, strict=True)
    )
    np.testing.assert_allclose(found["v"], response(t, 0.3, 2.0), atol=1e-8)
    assert found["x"][-1] == pytest.approx(
        np.trapezoid(response(np.linspace(0, 2, 20001), 0.3, 2.0), dx=1e-4)
    )


def test_a_late_input_that_is_driven_is_refused_with_what_to_do():
    law = Block("law", [], [v], [push], output_expressions={"push": -v.symbol})
    with pytest.raises(
        InputError, match=r"'push' acts with a delay in block 'lag'.*'law' drives.*links.*pade"
    ):
        interconnect([lag(), law])
    closed = interconnect([pade(lag()), law])
    assert len(closed.states) == 5 and not closed.delays


def test_an_input_that_is_late_in_one_block_only_is_refused():
    watch = Block("watch", [], [push], [Signal("sent", "m/s")], output_expressions={"sent": push.symbol})
    with pytest.raises(InputError, match=r"late by lag\.late in block 'lag' but at once in block 'watch'"):
        interconnect([lag(), watch])


@pytest.mark.parametrize(
    ("delays", "error", "line"),
    [
        ({"pusch": late.symbol}, InputError, "'pusch', which is not an input.*push"),
        ({"v": late.symbol}, InputError, "'v', which is not an input"),
        ({"push": v.symbol}, InputError, "depends on 'v', which is not a parameter"),
        ({"push": rate.symbol}, UnitError, "must be in s"),
        ({"push": "late"}, InputError, "expected an Expr"),
    ],
)
def test_a_wrong_delay_is_refused(delays, error, line):
    with pytest.raises(error, match=line):
        Block("lag", [v], [push], [v], [rate, late], {"v": rate.symbol * push.symbol}, delays=delays)


def test_nothing_acts_before_it_is_sent():
    with pytest.raises(InputError, match=r"acts -0\.1 s late.*cannot be negative"):
        simulate(lag(), [0.0, 1.0], params={"lag.late": -0.1})
    early = c17_simulation().with_effects([effect("time_offset", seconds=-0.05)])
    with pytest.raises(InputError, match=r"time_offset_seconds = -0.05 s: measurements would react"):
        early.plant()
    both = early.with_effects([effect("input_delay", seconds=0.08)])
    assert simulate(both.plant(), [0.0, 0.02, 0.04], [[1.0] * 3, [0.0] * 3]).outputs[3, 1:].tolist() > [
        0.0,
        0.0,
    ]


def test_sampled_blocks_have_links_not_delays():
    with pytest.raises(InputError, match="links"):
        Block("held", [v], [push], [v], [late], {"v": push.symbol}, delays={"push": late.symbol}, period=0.1)


def test_what_cannot_remember_says_so():
    compiled = lag().compile()
    for call in (
        lambda: lag().to_numpy().derivatives(0.0, [0.0], [0.0]),
        lambda: compiled.derivatives(0.0, [0.0], [0.0]),
        lambda: compiled.advance(0.0, 0.1, [0.0], [0.0]),
        lambda: regression(lag()),
    ):
        with pytest.raises(InputError, match=r"'push' acts with a delay.*undelayed") as caught:
            call()
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="hold, found hold='linear'"):
        simulate(lag(), [0.0, 1.0], hold="linear")


def test_any_block_takes_the_effect():
    plain = Block("lag", [v], [push], [v], [rate], {"v": rate.symbol * (push.symbol - v.symbol)})
    model = BlockModel(plain, ["input_delay"], [effect("input_delay", seconds=0.3)])
    t = np.linspace(0.0, 2.0, 21)
    found = simulate(model.plant(), t, 2.0 + 0 * t, **TIGHT).outputs
    np.testing.assert_allclose(found, response(t, 0.3, 2.0), atol=1e-8)


def test_a_hybrid_block_samples_what_arrives():
    sensor = Block("sensor", [], [Signal("felt", "m/s")], [Signal("told", "m/s")], period=0.1,
                   output_expressions={"told": sp.Symbol("felt", real=True)})  # fmt: skip
    whole = interconnect([lag(), sensor])
    t = np.arange(41) * 0.05
    for run in backends():
        found = run(whole, t, 2.0 + 0 * t)
        told = found.outputs[list(found.output_labels).index("told")]
        np.testing.assert_array_equal(told, np.where(t >= 0.3 - 1e-9, 2.0, 0.5))


def test_a_model_without_inputs_has_no_delays():
    assert (
        not Model("drift", [effect("surge_linear_drag", 0.4), effect("time_offset", seconds=0.1)])
        .plant()
        .delays
    )
