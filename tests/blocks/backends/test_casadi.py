"""CasADi's functions of a Block compute what NumPy's do, and their derivatives are the Block's exact ones."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.app.commands.exportable import choose
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.documents.scenarios import load_scenario, scenario_names
from tests.blocks.backends import designed

ca = pytest.importorskip("casadi")

LAWS = [n for n in scenario_names() if load_scenario(n).controller is not None]
PARTS = ["force_command", "rudder_lookup", "thrust_lookup", "variable_pitch", "imu", "table1:estimator"]


def points(block, n=100, states=None):
    rng = np.random.default_rng(1)
    for _ in range(n):
        x = states(block, rng) if states else rng.normal(0, 1, len(block.states))
        yield rng.uniform(0, 3), x, rng.normal(0, 1, len(block.inputs))


def assert_same(block, n=100, states=None):
    """Compare to 1e-12, or to 8 times the change by rounding the arguments, which must be below 1e-8."""
    functions, expected = block.to("casadi"), block.to_numpy()
    rng = np.random.default_rng(2)
    for t, x, u in points(block, n, states):
        for own, other in (
            (functions.derivatives, expected.derivatives),
            (functions.outputs, expected.outputs),
        ):
            found, wanted = np.array(own(t, x, u, functions.parameters)).ravel(), other(t, x, u)
            assert np.isfinite(wanted).all() or states is None
            room = 1e-12 * np.abs(wanted) + 1e-13 * np.abs(wanted).max(initial=1.0)
            if not (np.abs(found - wanted) <= room).all():
                room = np.maximum(room, 8 * rounding(other, t, x, u, rng))
                assert (room <= 1e-8 * np.abs(wanted).max(initial=1.0)).all()
            assert (np.abs(found - wanted) <= room).all()


def rounding(function, t, x, u, rng):
    """Return the largest change of each value when states and inputs change by one unit in the last place."""
    at, changed = function(t, x, u), []
    for _ in range(8):
        moved = [np.nextafter(a, rng.choice([-np.inf, np.inf], a.shape)) for a in (x, u)]
        changed.append(np.abs(function(t, *moved) - at))
    return np.max(changed, axis=0)


@pytest.mark.parametrize("name", hc.VEHICLES)
def test_each_vehicle_is_numpys_with_its_jacobians(name):
    block = hc.vehicle(name).plant()
    assert_same(block)
    f = block.to_casadi()
    for rows, function in (("derivatives", f.derivatives), ("outputs", f.outputs)):
        jacobian = function.jacobian()
        for t, x, u in points(block):
            result = np.zeros(function.size_out(0))
            parts = jacobian(t, x, u, f.parameters, result)
            for k, columns in enumerate(("states", "inputs", "parameters"), 1):
                wanted = block.to_numpy().jacobian(t, x, u, rows=rows, columns=columns)
                np.testing.assert_allclose(np.array(parts[k]), wanted, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("name", LAWS)
def test_each_controller_is_numpys(name):
    assert_same(choose(f"{name}:controller").block, 100)


@pytest.mark.slow("monitor")
@pytest.mark.parametrize("name", designed.MAKERS)
def test_what_a_design_or_a_search_returns_is_numpys(name):
    assert_same(designed.designed(name), 20, designed.near_start)


def test_designed_controllers_and_guidance_are_numpys():
    plant = hc.vehicle("c17_simulation").plant()
    straight = plant.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    assert_same(hc.lqr(plant, straight, {"y": 1.0, "u": 1.0}, {"thrust": 1.0, "rudder": 4.0}))
    weights = {"u": 1.0, "integral_u": 4.0}
    assert_same(hc.lqi(plant, straight, weights, {"thrust": 1.0}, integrate="u"))
    assert_same(hc.course_control(gain=2.0, yaw_rate=10.0))
    assert_same(hc.line_of_sight([[0.0, 0.0], [10.0, 0.0]], lookahead=2.0).in_continuous_time)


@pytest.mark.parametrize("name", PARTS)
def test_parts_with_tables_modes_and_random_numbers_are_numpys(name):
    assert_same(choose(name).block)


#: The solution for a position from ranges is ill-conditioned at random points: NumPy's own values change by
#: 1e-11 to 1e-9 there when an argument changes by one unit in the last place.
NAVIGATION = ["mechanisation", "heading_filter", "range_solver", "coupled_filter", "range_filter"]


@pytest.mark.slow("coupled", "range_filter")
@pytest.mark.parametrize("name", NAVIGATION)
def test_filters_of_the_navigation_are_numpys_as_far_as_rounding_allows(name):
    assert_same(choose(name).block)


def test_ticks_of_a_hybrid_block_are_functions():
    v, n, k = hc.Signal("v", "m/s", start=1.0), hc.Signal("n", "m/s"), hc.Signal("k", "1/s", start=0.5)
    cart = hc.Block("cart", [v], [], [v], [k], derivatives={"v": -k.symbol * v.symbol})
    count = hc.Block("count", [n], [v], [n], derivatives={"n": n.symbol + v.symbol}, period=0.1)
    loop = hc.interconnect([cart, count])
    f, x = loop.to_casadi(), [2.0, 3.0, 5.0]
    now = dict(zip((s.name for s in loop.states), x, strict=True))
    found = np.array(f.ticks[0](0.0, x, [], f.parameters)).ravel()
    updated = dict(zip(loop.ticks[0].updates, found, strict=True))
    assert updated["count.n"] == now["count.n"] + now["cart.v"]


def test_a_sampled_block_has_next_values():
    noise = random_numbers(1, salt="a")
    block = hc.Block("a", noise.states, [], [hc.Signal("z")], noise.parameters, noise.next_values,
                     {"z": noise.values[0]}, noise.definitions, period=1.0)  # fmt: skip
    assert block.to_casadi().derivatives.name() == "next"
    assert_same(block)


def test_functions_with_jumps_are_numpys():
    p, q = hc.Signal("p"), hc.Signal("q")
    functions = {
        "mod": sp.Mod(p.symbol, q.symbol),
        "step": sp.Heaviside(p.symbol),
        "sign": sp.sign(p.symbol),
        "top": sp.Max(p.symbol, q.symbol, 0.3),
        "piece": sp.Piecewise((sp.sqrt(p.symbol), p.symbol > 0), (q.symbol, True)),
    }
    block = hc.Block("odd", (), (p, q), tuple(hc.Signal(n) for n in functions), output_expressions=functions)
    f = block.to_casadi().outputs
    for value in (-2.3, -1.0, 0.0, 0.4, 3.7):
        found = np.array(f(0.0, [], [value, 0.7], [])).ravel()
        np.testing.assert_allclose(found, block.to_numpy().outputs(0.0, [], [value, 0.7]), rtol=1e-14)


def test_a_table_of_two_axes_has_its_slopes():
    from hovercontrol.blocks.lookup import bilinear

    i, j = hc.Signal("i"), hc.Signal("j")
    z = bilinear("table", [[0, 1, 2], [10, 11, 12]], i.symbol, j.symbol)
    block = hc.Block("table", (), (i, j), (hc.Signal("z"),), output_expressions={"z": z})
    f = block.to_casadi().outputs
    assert float(f(0.0, [], [0.5, 1.25], [])) == 6.25
    slopes = f.jacobian()(0.0, [], [0.5, 1.25], [], 0.0)[2]
    assert np.array(slopes).ravel().tolist() == [10.0, 1.0]


def test_what_has_no_form_is_refused_in_one_line():
    v, a, late = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), hc.Signal("late", "s", start=0.25)
    delayed = hc.Block("cart", [v], [a], [v], [late], {"v": a.symbol}, delays={"a": late.symbol})
    with pytest.raises(hc.InputError, match="the input 'a' acts with a delay"):
        delayed.to_casadi()
