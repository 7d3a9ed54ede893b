"""Unknown functions in a Block: they have units and equations, and no backend computes them."""

import numpy as np
import pytest
import sympy as sp
from scipy.interpolate import CubicSpline

import hovercontrol as hc
from hovercontrol.blocks.lookup import cubic
from hovercontrol.blocks.unknown import fill, unknown_functions

S = hc.Signal("S", "kg/m^3", start=1.0)
X = hc.Signal("X", "kg/m^3", start=1.0)


def reactor() -> hc.Block:
    mu = hc.unknown("mu", of=["S"], unit="1/s")
    return hc.Block("reactor", [S, X], [], [S, X], [], {"S": -2 * mu * X.symbol, "X": mu * X.symbol})


def test_several_equations_use_one_function() -> None:
    assert reactor().equations() == "S' = -2*X*mu(S)\nX' = X*mu(S)"
    assert [str(call) for call in unknown_functions(reactor())["mu"]] == ["mu(S)"]


def test_its_unit_must_fit_where_it_stands() -> None:
    wrong = hc.unknown("mu", of=["S"], unit="kg")
    with pytest.raises(hc.UnitError, match="S' must be in"):
        hc.Block("reactor", [S], [], [S], [], {"S": -wrong * S.symbol})


def test_a_function_of_an_unknown_signal_is_refused() -> None:
    with pytest.raises(hc.InputError, match="unknown symbol 'Sx' in S'; did you mean 'S'"):
        hc.Block("reactor", [S], [], [S], [], {"S": -hc.unknown("mu", of=["Sx"], unit="1/s") * S.symbol})


@pytest.mark.parametrize("backend", ["compiled", "control", "casadi"])
def test_no_backend_computes_it(backend: str) -> None:
    with pytest.raises(hc.InputError, match=r"mu|UnknownFunction") as raised:
        reactor().to(backend)
    assert "\n" not in str(raised.value)


def test_numpy_says_how_to_fill_it() -> None:
    with pytest.raises(hc.InputError, match=r"'mu' is not known: hc.identify\(block, logs\).block has it"):
        reactor().to_numpy().derivatives(0.0, [1.0, 1.0])


def test_filled_it_is_a_block_like_any_other() -> None:
    k = hc.Signal("k", "kg/m^3", start=4.0)
    m = hc.Signal("m", "1/s", start=0.3)
    filled = fill(reactor(), "mu", lambda a: m.symbol * a / (k.symbol + a), [m, k])
    mu = 0.3 * 2.0 / (4.0 + 2.0)
    assert np.allclose(filled.to_numpy().derivatives(0.0, [2.0, 3.0]), [-6.0 * mu, 3.0 * mu])


def test_the_cubic_spline_is_scipys() -> None:
    knots, values = np.array([0.0, 0.7, 1.5, 2.0, 4.0]), np.array([1.0, -1.0, 2.0, 0.5, 3.0])
    x = sp.Symbol("x", real=True)
    at = np.linspace(0.0, 4.0, 41)
    found = sp.lambdify(x, cubic(x, knots, values.tolist()), "numpy")(at)
    assert np.allclose(found, CubicSpline(knots, values)(at))
