"""Lookup tables as expressions: what they compute, and that every backend prints them alike."""

import pickle

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import RegularGridInterpolator

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.lookup import Entries, bilinear, entry, linear
from hovercontrol.blocks.mathml import equations
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators import fan_force, fan_tables, thrust_force, thrust_lookup
from hovercontrol.craft.hardware.actuators.signals import RPM
from hovercontrol.craft.models.vehicles import hoverdemon

I, J, OUT = Signal("i"), Signal("j"), Signal("out")
numbers = st.floats(-1e4, 1e4).map(lambda x: round(x, 6))


def table_block(values):
    out = {"out": bilinear("demo", values, I.symbol, J.symbol)}
    return Block("lookup", inputs=[I, J], outputs=[OUT], output_expressions=out)


RNG = np.random.default_rng(7)
TABLE = RNG.normal(size=(14, 161))
BLOCK = table_block(TABLE)
PLACES = RNG.uniform([-2, -2], [15, 163], (400, 2)).T


def by_scipy(values, places):
    axes = [np.arange(n) for n in values.shape]
    inside = [np.clip(p, 0, n - 1) for p, n in zip(places, values.shape, strict=True)]
    return RegularGridInterpolator(axes, values)(np.transpose(inside))


def test_a_table_of_k06s_size_is_what_scipy_interpolates():
    found = BLOCK.to_numpy().outputs(0.0, (), PLACES)[0]
    assert found == pytest.approx(by_scipy(TABLE, PLACES), abs=1e-12)


@settings(max_examples=10, deadline=None)
@given(arrays(float, st.tuples(st.integers(2, 5), st.integers(2, 6)), elements=numbers), st.data())
def test_any_table_at_any_place_also_one_by_one(values, data):
    f = table_block(values).to_numpy()
    place = [data.draw(st.floats(-3, n + 2)) for n in values.shape]
    one = f.outputs(0.0, (), place)[0]
    many = f.outputs(0.0, (), np.array([place, place]).T)[0]
    assert one == pytest.approx(by_scipy(values, np.array([place]).T)[0], abs=1e-9 * (1 + abs(values).max()))
    assert many == pytest.approx([one, one], abs=1e-12)


def test_entries_themselves_are_met_exactly():
    rows, columns = np.meshgrid(np.arange(14.0), np.arange(161.0), indexing="ij")
    found = BLOCK.to_numpy().outputs(0.0, (), np.array([rows.ravel(), columns.ravel()]))[0]
    assert found.reshape(TABLE.shape) == pytest.approx(TABLE, abs=1e-14)


def test_machine_code_moves_a_craft_as_the_plain_functions_do():
    moving = interconnect([hoverdemon().plant(), thrust_force()], "craft")
    f, compiled = moving.to_numpy(), moving.compile()
    for speed, rudder in RNG.uniform([-1400, -0.8], [1400, 0.8], (20, 2)):
        x0 = [0, 0, 0, 0.3, 0.1, 0.5]
        for by_machine, plain in ((compiled.derivatives, f.derivatives), (compiled.outputs, f.outputs)):
            assert by_machine(0.0, x0, [speed, rudder]) == pytest.approx(
                plain(0.0, x0, [speed, rudder]), rel=1e-12, abs=1e-13
            )


def test_slopes_are_those_of_the_cell():
    f = BLOCK.to_numpy()
    place = np.array([3.3, 70.7])
    slopes = f.jacobian(0.0, (), place, rows="outputs", columns="inputs")[0]
    h = 1e-4
    by_difference = [
        (f.outputs(0.0, (), place + h * e) - f.outputs(0.0, (), place - h * e))[0] / (2 * h)
        for e in np.eye(2)
    ]
    assert slopes == pytest.approx(by_difference, rel=1e-6)


@pytest.mark.parametrize("form", ["text", "latex"])
def test_a_reader_sees_the_tables_name_and_none_of_its_entries(form):
    text = BLOCK.equations(form)
    assert "demo" in text
    assert len(text) < 6000
    assert "demo" in next(equations(BLOCK))[1]


def test_c_has_each_entry_once():
    source = c_source(BLOCK, partials=False)
    assert source.count(repr(float(TABLE[3, 5]))) == 1
    assert len(source) < 30 * TABLE.size


def test_blocks_of_equal_tables_are_equal_and_travel():
    other = TABLE.copy()
    other[5, 5] += 1e-9
    assert table_block(TABLE) == BLOCK == pickle.loads(pickle.dumps(BLOCK))
    assert table_block(TABLE).content_hash == BLOCK.content_hash
    assert table_block(other) != BLOCK
    assert table_block(other).content_hash != BLOCK.content_hash


def test_a_table_in_a_tick_is_in_the_hash_too():
    """The cache of generated code goes by the hash: with the table's name alone, an older table came back."""
    one, other = (
        thrust_lookup(table=fan_tables(lambda speed, rudder, k=k: k * fan_force(speed, rudder))[0])
        for k in (1.0, 0.9)
    )
    ticking = [interconnect([block], "loop", hybrid=True) for block in (one, other)]
    assert len({block.content_hash for block in ticking}) == 2


def test_an_entry_is_a_staircase_over_its_index():
    squares = Entries("squares", [k**2 for k in range(10)])
    k = sp.Symbol("k", real=True)
    for at, value in ((-3, 0), (0, 0), (2.99, 4), (3, 9), (9.5, 81), (1e9, 81)):
        assert entry(k, squares).subs(k, at) == sp.Float(value)
    assert entry(k, squares).diff(k) == 0
    assert entry(k, squares) == entry(k, Entries("squares", [k**2 for k in range(10)]))
    assert entry(k, squares) != entry(k, Entries("squares", range(10)))


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(st.floats(0.01, 3), numbers), min_size=2, max_size=25), st.floats(-2, 60))
def test_a_line_through_knots_is_numpys(steps, x):
    knots = np.cumsum([d for d, _ in steps])
    values = np.array([y for _, y in steps])
    X = Signal("x")
    f = Block(
        "line", inputs=[X], outputs=[OUT], output_expressions={"out": linear(X.symbol, knots, values)}
    ).to_numpy()
    steepest = np.abs(np.diff(values) / np.diff(knots)).max()
    assert f.outputs(0.0, (), [x])[0] == pytest.approx(
        np.interp(x, knots, values), abs=1e-10 * (1 + steepest * 60)
    )


def test_units_are_still_checked():
    speed = Signal("speed", "rad/s")
    with pytest.raises(InputError, match="must be dimensionless"):
        Block(
            "wrong",
            inputs=[speed],
            outputs=[OUT],
            output_expressions={"out": entry(speed.symbol / (60 * RPM), Entries("demo", [1, 2]))},
        )
