"""The NumPy backend: one point, many points, exact Jacobians, and the same numbers in both."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import circle, waypoints
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, four_fan

P, Q = Signal("p"), Signal("q")


def blocks():
    craft = c17_experiment()
    return [
        craft.plant(),
        four_fan().plant(),
        tracking_controller(craft, limits=True),
        circle(1.0),
        waypoints([[0, 0], [1, 1]], [0, 1]),
    ]


@pytest.mark.parametrize("block", blocks(), ids=lambda b: b.name)
def test_many_points_at_once_are_the_same_as_one_by_one(block, rng):
    f = block.to_numpy()
    t = rng.uniform(-1, 2, 20)
    x, u = rng.normal(size=(len(block.states), 20)), rng.normal(size=(len(block.inputs), 20))
    for many in (f.derivatives, f.outputs):
        one = np.array([many(t[k], x[:, k], u[:, k]) for k in range(20)]).T
        assert np.allclose(many(t, x, u), one, rtol=1e-12, atol=1e-14)


def test_points_may_lie_on_a_grid_and_inputs_may_be_shared(rng):
    f = c17_simulation().plant().to_numpy()
    x = rng.normal(size=(6, 4, 5))
    assert f.derivatives(0.0, x, [1.0, 0.2]).shape == (6, 4, 5)
    assert np.allclose(f.derivatives(0.0, x, [1.0, 0.2])[:, 2, 3], f.derivatives(0.0, x[:, 2, 3], [1.0, 0.2]))
    assert f.jacobian(0.0, x, np.ones((2, 4, 5))).shape == (6, 6, 4, 5)


def test_times_may_be_a_plain_list():
    assert circle(1.0).to_numpy().outputs([0, 1], ())[0] == pytest.approx([1.0, np.cos(1.0)])


FUNCTIONS = [
    sp.sign(P.symbol),
    sp.Abs(P.symbol),
    sp.Max(P.symbol, Q.symbol, 0.3),
    sp.Min(P.symbol, Q.symbol),
    sp.atan2(P.symbol, Q.symbol),
    sp.Pow(P.symbol, sp.Rational(1, 3)),
    sp.sqrt(P.symbol),
    1 / P.symbol,
    P.symbol**Q.symbol,
    sp.log(P.symbol),
    sp.exp(P.symbol),
    sp.floor(P.symbol),
    sp.Heaviside(P.symbol),
    P.symbol**4,
    P.symbol**-2,
    sp.Pow(P.symbol, sp.Rational(5, 2)),
    1 / sp.sqrt(P.symbol),
    sp.tanh(P.symbol),
    sp.Piecewise(
        (P.symbol, (P.symbol > 0) & (Q.symbol < 1)),
        (Q.symbol, sp.Or(P.symbol < -1, Q.symbol > 0)),
        (0.5, True),
    ),
    sp.Mod(P.symbol, 1.5),
]


@pytest.mark.parametrize("expression", FUNCTIONS, ids=str)
def test_every_function_is_the_same_for_floats_and_arrays_even_where_it_is_no_number(expression):
    f = Block("f", inputs=[P, Q], outputs=[Signal("y")], output_expressions={"y": expression}).to_numpy()
    points = np.array([[-1.3, -1.0, 0.0, 0.5, 2.0, 0.0, -0.4], [0.7, 2.0, 0.0, 1.0, -3.0, 2.0, -1.5]])
    with np.errstate(all="ignore"):
        many = f.outputs(0.0, (), points)[0]
        for k, (p, q) in enumerate(points.T):
            one = f.outputs(0.0, (), [p, q])
            assert one.dtype == float
            assert np.array_equal(one, many[k : k + 1], equal_nan=True) or one[0] == pytest.approx(
                many[k], rel=1e-14
            )


def test_limits_have_an_exact_jacobian_too(rng):
    block = tracking_controller(c17_experiment(), limits=True)
    inside, outside = np.zeros(12), rng.normal(size=12) * 50
    f = block.to_numpy()
    assert f.outputs(0.0, (), outside)[0] == pytest.approx(6.1)
    assert not f.jacobian(0.0, (), outside, rows="outputs", columns="inputs")[0].any()
    inside[10] = 1.0
    assert f.jacobian(0.0, (), inside, rows="outputs", columns="inputs")[0].any()


@pytest.mark.parametrize(
    ("x", "u", "message"),
    [
        ([0.0] * 5, [0.0] * 2, r"expected 6 state values \(x, y, psi, u, v, r\), found 5"),
        ([0.0] * 6, [0.0] * 3, r"expected 2 input values \(thrust, rudder\), found 3"),
        (0.0, [0.0] * 2, "found 1"),
    ],
)
def test_wrong_shapes_are_refused_with_the_names_that_were_expected(x, u, message):
    with pytest.raises(InputError, match=message):
        c17_simulation().plant().to_numpy().derivatives(0.0, x, u)


def test_a_name_that_looks_like_code_is_only_a_name():
    odd = Signal("lambda_")
    block = Block(
        "b",
        [Signal("x0", "1")],
        [Signal("c0", "1/s")],
        [Signal("x0")],
        [Signal("u0", "1/s", start=3.0), odd],
        {"x0": Signal("c0").symbol * odd.symbol + Signal("u0").symbol},
    )
    assert block.to_numpy().derivatives(0.0, [1.0], [2.0]) == pytest.approx([3.0])


def test_a_valve_behind_a_dead_zone_has_the_jacobian_of_its_closed_form():
    """dp/dt = k e (s - sgn(e) p)^(1/2), e the opening beyond a dead zone."""
    p, u, d, s, k = Signal("p"), Signal("u"), Signal("d"), Signal("s"), Signal("k", "1/s")
    e = sp.Max(0, u.symbol - d.symbol) - sp.Max(0, -u.symbol - d.symbol)
    law = k.symbol * e * sp.sqrt(s.symbol - sp.sign(e) * p.symbol)
    f = Block("valve", [p], [u], [p], [d, s, k], {"p": law}).to_numpy()
    slope = f.jacobian(0.0, [2.0], [0.5], {"d": 0.1, "s": 7.0, "k": 3.0})[0, 0]
    assert slope == pytest.approx(-3.0 * 0.4 / (2.0 * np.sqrt(5.0)))
