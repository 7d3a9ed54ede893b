"""A Block is a system written once; what it refuses, what it derives, and that it stays itself."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block, Expressions
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.sgn import regularise
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import UnitError, dimension
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse, waypoints
from hovercontrol.control.observers import regression
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, four_fan

U, R, A, K = (
    Signal("u", "m/s"),
    Signal("r", "rad/s"),
    Signal("a", "m/s^2"),
    Signal("k", "1/s", start=2.0),
)


def cart(**changes) -> Block:
    parts = {
        "states": [U],
        "inputs": [A],
        "outputs": [U],
        "parameters": [K],
        "derivatives": {"u": A.symbol - K.symbol * U.symbol},
    }
    return Block("cart", **{**parts, **changes})


def closed_loop() -> Block:
    craft = c17_experiment()
    return interconnect(
        [ellipse(1.15, 2.0, 0.7), tracking_controller(craft, limits=True), craft.plant()], "loop"
    )


# ---- what it refuses -----------------------------------------------------------------------------


def test_surge_plus_yaw_rate_is_refused_and_the_expression_named():
    with pytest.raises(UnitError, match=r"block 'cart': u': units do not fit in '.*r \+ u.*'"):
        cart(states=[U, R], derivatives={"u": K.symbol * (U.symbol + R.symbol), "r": sp.S.Zero})


def test_a_derivative_in_the_wrong_unit_is_refused():
    with pytest.raises(UnitError, match=r"u' must be in m/s\^2, but 'k' is in 1/s"):
        cart(derivatives={"u": K.symbol})


def test_an_output_in_the_wrong_unit_is_refused():
    with pytest.raises(UnitError, match=r"speed must be in m/s, but 'a' is in m/s\^2"):
        cart(outputs=[Signal("speed", "m/s")], output_expressions={"speed": A.symbol})


def test_a_definition_in_the_wrong_unit_is_refused_where_its_unit_was_given():
    with pytest.raises(UnitError, match="drag must be in N"):
        cart(definitions={"drag": K.symbol * U.symbol}, definition_signals=[Signal("drag", "N")])


def test_the_unit_of_a_definition_is_derived_even_if_it_is_a_root():
    block = cart(
        definitions={"root": sp.sqrt(U.symbol)},
        derivatives={"u": K.symbol * sp.Symbol("root", real=True) ** 2},
    )
    assert block.signal("root").dimension == dimension("m^(1/2)/s^(1/2)")


def test_time_is_in_seconds():
    with pytest.raises(UnitError, match="u'"):
        cart(derivatives={"u": A.symbol * time})
    cart(derivatives={"u": A.symbol * time * K.symbol})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": [U]}, "the name 'u' is used twice"),
        ({"outputs": [U, U]}, "two outputs are named 'u'"),
        ({"derivatives": {}}, "no derivative expression for 'u'"),
        ({"derivatives": {"u": A.symbol, "uu": A.symbol}}, "unknown signal 'uu'; did you mean 'u'"),
        ({"outputs": [Signal("speed", "m/s")]}, "no output expression for 'speed'"),
        (
            {"derivatives": {"u": Signal("aa", "m/s^2").symbol}},
            "unknown symbol 'aa' in u'; did you mean 'a'",
        ),
        ({"derivatives": {"u": sp.Symbol("a")}}, "must be real"),
        ({"derivatives": {"u": "a - k*u"}}, r"derivatives\['u'\]: expected an Expr, found 'a - k\*u'"),
        ({"derivatives": {"u": sp.true}}, "expected a SymPy expression"),
        ({"output_expressions": {"u": 2 * U.symbol}}, "has the name of another signal"),
        ({"definitions": {"u": A.symbol}}, "the name 'u' is used twice"),
    ],
)
def test_a_badly_made_block_is_refused_in_words(changes, message):
    with pytest.raises(InputError, match=message):
        cart(**changes)


def test_circular_definitions_are_refused_with_the_circle_spelled_out():
    p, q = (sp.Symbol(n, real=True) for n in "pq")
    with pytest.raises(InputError, match="circular: p -> q -> p"):
        cart(definitions={"p": q + U.symbol, "q": p})


@pytest.mark.parametrize("name", ["", "two words", "1st", "a.b"])
def test_a_block_has_a_name(name):
    with pytest.raises(InputError, match="is not a valid block name"):
        Block(name)


def test_an_unknown_signal_or_key_is_answered_with_the_nearest():
    plant = c17_simulation().plant()
    with pytest.raises(InputError, match="did you mean 'rudder'"):
        plant.signal("ruder")
    with pytest.raises(InputError, match=r"did you mean 'plant.yaw_coulomb'"):
        plant.parameter_values({"plant.yaw_colomb": 1.0})
    with pytest.raises(InputError, match=r"params\['plant.yaw_coulomb'\]: expected a number"):
        plant.parameter_values({"plant.yaw_coulomb": "much"})
    with pytest.raises(InputError, match="did you mean 'yaw_coulomb'"):
        plant.parameter("yaw_colomb")
    with pytest.raises(InputError, match="'text' or 'latex'"):
        plant.equations("html")


def test_values_are_changed_by_name_and_within_bounds():
    plant = c17_simulation().plant()
    other = plant.with_values({"plant.yaw_coulomb": 0.1, "u": 1.0, "thrust": 2.0})
    assert (other.signal("u").start, other.parameter("yaw_coulomb").start) == (1.0, 0.1)
    assert plant.parameter("yaw_coulomb").start == 0.83
    with pytest.raises(InputError, match="out of its bounds"):
        plant.with_values({"plant.yaw_coulomb": -0.1})
    with pytest.raises(InputError, match="no signal 'w'"):
        plant.with_values({"w": 1.0})
    with pytest.raises(InputError, match="is an output or definition and has no start value"):
        closed_loop().with_values({"error_x": 1.0})


def test_nothing_of_a_block_can_be_changed_in_place():
    block = cart()
    with pytest.raises(AttributeError):
        block.name = "other"  # type: ignore[misc]
    with pytest.raises(TypeError):
        block.derivatives["u"] = sp.S.Zero  # type: ignore[index]


# ---- what it derives -----------------------------------------------------------------------------


def test_direct_feedthrough_is_derived_through_definitions():
    half = sp.Symbol("half", real=True)
    block = cart(
        outputs=[U, Signal("push", "m/s^2"), Signal("rest", "m/s^2")],
        definitions={"half": A.symbol / 2},
        output_expressions={"push": half, "rest": K.symbol * U.symbol},
    )
    assert block.feedthrough == {"u": (), "push": ("a",), "rest": ()}


def test_the_controllers_commands_depend_on_everything_but_its_tracking_error_only_on_position():
    reach = tracking_controller(c17_simulation()).feedthrough
    assert reach["error_x"] == ("x", "psi", "x_ref")
    assert set(reach["thrust"]) == {
        "x",
        "y",
        "psi",
        "u",
        "v",
        "r",
        "x_ref",
        "y_ref",
        "vx_ref",
        "vy_ref",
        "ax_ref",
        "ay_ref",
    }


@pytest.mark.parametrize("craft", [c17_simulation, four_fan])
def test_the_jacobian_by_the_coefficients_is_the_regressor(craft):
    plant = craft().plant()
    r = regression(plant)
    columns = [[p.name for p in plant.parameters].index(c.name) for c in r.coefficients]
    rows = [[s.name for s in plant.states].index(s.name) for s in r.states]
    assert plant.jacobian(columns="parameters").extract(rows, columns) == r.G


@pytest.mark.parametrize("rows", ["derivatives", "outputs"])
@pytest.mark.parametrize("columns", ["states", "inputs", "parameters"])
def test_jacobians_are_those_of_finite_differences(rows, columns, rng):
    block = closed_loop() if columns != "inputs" else tracking_controller(c17_simulation())
    f = block.to_numpy()
    x = rng.normal(0, 0.5, len(block.states))
    u = rng.normal(0, 0.5, len(block.inputs))
    p = dict(block.default_parameters)
    evaluate = f.derivatives if rows == "derivatives" else f.outputs
    found = f.jacobian(0.3, x, u, p, rows, columns)

    def at(j, h):
        xx, uu, pp = x.copy(), u.copy(), dict(p)
        if columns == "states":
            xx[j] += h
        elif columns == "inputs":
            uu[j] += h
        else:
            pp[list(pp)[j]] += h
        return evaluate(0.3, xx, uu, pp)

    h = 1e-5
    assert found.shape == (
        len(getattr(block, "states" if rows == "derivatives" else rows)),
        len(getattr(block, columns)),
    )
    for j in range(found.shape[1]):
        slope = (8 * (at(j, h) - at(j, -h)) - (at(j, 2 * h) - at(j, -2 * h))) / (12 * h)
        assert found[:, j] == pytest.approx(slope, rel=1e-6, abs=1e-6), j


def test_the_symbolic_jacobian_is_the_numeric_one(rng):
    block = tracking_controller(c17_simulation())
    u, p = rng.normal(0, 1, len(block.inputs)), block.parameter_values()
    symbols = [s.symbol for s in (*block.inputs, *block.parameters)]
    symbolic = sp.lambdify(
        symbols, block.jacobian("outputs", "inputs").applyfunc(regularise), "numpy", cse=True
    )
    found = block.to_numpy().jacobian(0.0, (), u, rows="outputs", columns="inputs")
    assert np.allclose(symbolic(*u, *p), found, rtol=1e-11, atol=1e-11)


# ---- that it stays itself ------------------------------------------------------------------------


def test_the_same_words_make_the_same_block():
    assert closed_loop() == closed_loop()
    assert hash(closed_loop()) == hash(closed_loop())
    assert cart() != cart(parameters=[K.replace(start=3.0)])
    assert cart() != cart(derivatives={"u": A.symbol})
    assert len({cart(), cart(), closed_loop()}) == 2


def test_the_order_in_which_definitions_are_written_does_not_matter():
    p, q = (sp.Symbol(n, real=True) for n in "pq")
    rows = {"p": K.symbol * U.symbol, "q": 2 * p}
    derivatives = {"u": A.symbol - q}
    one = cart(definitions=rows, derivatives=derivatives)
    two = cart(definitions=dict(reversed(rows.items())), derivatives=derivatives)
    assert one == two


def test_pickles_and_copies_are_equal_and_still_work():
    block = closed_loop()
    block.to_numpy()
    block.feedthrough, block.content_hash  # noqa: B018  (caches must not get in the way)
    for twin in (pickle.loads(pickle.dumps(block)), copy.deepcopy(block), copy.copy(block)):
        assert twin == block
        assert twin.content_hash == block.content_hash
        assert np.array_equal(
            twin.to_numpy().derivatives(0.1, np.ones(6)),
            block.to_numpy().derivatives(0.1, np.ones(6)),
        )


def test_the_content_hash_tells_any_change():
    variants = [
        cart(),
        cart(parameters=[K.replace(start=3.0)]),
        cart(states=[U.replace(description="surge")]),
        cart(states=[U.replace(upper=9.0)]),
        cart(derivatives={"u": A.symbol}),
        cart().named("wagon"),
        cart(definitions={"d": K.symbol * U.symbol}),
    ]
    assert len({b.content_hash for b in variants}) == len(variants)


HASHES = """
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.controllers.references import ellipse, waypoints
from hovercontrol.craft.models.vehicles import c17_experiment
craft = c17_experiment()
parts = [ellipse(1.15, 2.0, 0.7), tracking_controller(craft, limits=True), craft.plant()]
e = kalman_bucy(craft.plant(), ["yaw_coulomb"])
print(interconnect(parts).content_hash, e.content_hash)
print(waypoints([[0, 0], [1, 2], [3, 1]], [0, 1, 2]).content_hash)
print(interconnect([*parts, e]).equations("latex"))
"""


@pytest.mark.slow
def test_content_hash_and_equations_are_the_same_in_every_process():
    outputs = {
        subprocess.run(
            [sys.executable, "-c", HASHES],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("0", "4711")
    }
    assert len(outputs) == 1
    assert waypoints([[0, 0], [1, 2], [3, 1]], [0, 1, 2]).content_hash in outputs.pop()


def test_expressions_are_equal_only_in_the_same_order():
    one, two = Expressions({"a": 1, "b": 2}), Expressions({"b": 2, "a": 1})
    assert one != two
    assert one == Expressions([("a", 1), ("b", 2)])
    assert dict(one) == {"a": 1, "b": 2}


# ---- names by their last part --------------------------------------------------------------------


def test_states_and_parameters_of_a_loop_go_by_their_last_part_in_every_call():
    """A cart with ``v' = (F - c v)/m`` under ``F = kp (w - v)``: its pole is ``-(c + kp)/m``."""
    m, c = hc.Signal("m", "kg", start=2.0), hc.Signal("c", "N*s/m", start=1.0)
    v, w, F = hc.Signal("v", "m/s"), hc.Signal("w", "m/s"), hc.Signal("F", "N")
    kp = hc.Signal("kp", "N*s/m", start=3.0)
    plant = hc.Block("cart", [v], [F], [v], [m, c], {"v": (F.symbol - c.symbol * v.symbol) / m.symbol})
    law = hc.Block("law", [], [v, w], [F], [kp], output_expressions={"F": kp.symbol * (w.symbol - v.symbol)})
    loop = hc.interconnect([plant, law], "loop", outputs=["F"])
    t = np.linspace(0.0, 1.0, 5)
    wanted = 0.5 * np.exp(-3.0 * t)  # kp = 5, from 0.5 m/s
    run = hc.simulate(loop, t, x0={"v": 0.5}, params={"kp": 5.0}, rtol=1e-9)
    assert run["v"] == pytest.approx(wanted, rel=1e-6) and run["F"] == pytest.approx(-5 * run["cart.v"])
    assert loop.linearize(params={"kp": 5.0}).poles() == pytest.approx([-3.0])
    assert loop.to_control().linearize(0, 0, params={"kp": 5.0}).poles() == pytest.approx([-3.0])
    assert loop.linearize({"v": 0.5}).poles() == pytest.approx([-2.0])
    assert loop.trim({"v": 1.0}, params={"kp": 2.0}).inputs["w"] == pytest.approx(1.5)
    swept = loop.compile().sweep(t, x0={"v": [0.0, 0.5]}, params={"kp": 5.0})
    assert swept["F"].final == pytest.approx([0.0, -5 * wanted[-1]], abs=1e-6)
    with pytest.raises(InputError, match=r"no signal 'vv'; known: F, cart.v, w"):
        run["vv"]
