"""Observability at an operating point: against python-control's matrices and what is plain of a craft."""

import control
import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm, solve_continuous_lyapunov

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from tests.control.observers.observed_plants import cart

CRAFT = hc.vehicle("c17_simulation")


@pytest.mark.parametrize(
    ("at", "measured", "hidden"),
    [
        ({}, ["x", "y", "psi"], []),
        ({}, ["x", "y"], ["psi", "r"]),
        ({"u": 1.0}, ["x", "y"], []),
        ({"u": 1.0}, ["u", "v", "r"], ["x", "y", "psi"]),
        ({"u": 1.0, "v": -0.5, "r": 0.4}, ["psi"], ["x", "y", "u", "v"]),
        ({"v": 0.3}, ["x", "psi"], ["y", "v"]),
    ],
)
def test_the_hidden_states_are_those_of_the_observability_matrix(at, measured, hidden):
    plant = CRAFT.plant()
    found = hc.observability(plant, at, measured)
    state = [at.get(s.name, 0.0) for s in plant.states]
    linear = plant.linearize(state)
    C = np.array([np.eye(6)[[s.name for s in plant.states].index(m)] for m in measured])
    # Scaled in time, so that powers of the fast friction modes do not drown the rest.
    scaled = control.obsv(linear.A / np.linalg.norm(linear.A, 2), C)
    assert found.rank == np.linalg.matrix_rank(scaled, tol=1e-14) == 6 - len(hidden)
    assert found.observable == (not hidden)
    names = {name for change in found.hidden for name, v in change.items() if abs(v) > 1e-6}
    assert names == set(hidden)
    for change in found.hidden:
        assert np.abs(scaled @ [change[s.name] for s in plant.states]).max() < 1e-9


def test_the_gramian_is_the_integral_and_tends_to_that_of_all_time():
    a, b = hc.Signal("a", nominal=2.0), hc.Signal("b")
    p, q, k = (hc.Signal(n, "1/s", start=v) for n, v in (("p", 3.0), ("q", 0.7), ("k", 1.3)))
    rates = {"a": -p.symbol * a.symbol + k.symbol * b.symbol, "b": -q.symbol * b.symbol}
    block = hc.Block("pair", [a, b], [], [a], [p, q, k], rates)
    A, C = np.array([[-3.0, 0.65], [0.0, -0.7]]), np.array([[1.0, 0.0]])  # a and the output in units of 2
    wanted, _ = quad_vec(lambda t: expm(A.T * t) @ C.T @ C @ expm(A * t), 0.0, 1.5, epsabs=1e-13)
    found = hc.observability(block, [0.0, 0.0], ["a"], window=1.5)
    np.testing.assert_allclose(found.gramian, wanted, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.singular_values, np.linalg.svd(wanted)[1], rtol=0, atol=1e-12)
    long = hc.observability(block, None, ["a"], window=200.0)
    np.testing.assert_allclose(long.gramian, solve_continuous_lyapunov(A.T, -C.T @ C), rtol=0, atol=1e-10)


def test_what_is_hidden_but_decays_is_detectable():
    """The roll of a damped second cart is hidden from the first, and dies out."""
    x, v, w = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("w", "m/s")
    k = hc.Signal("k", "1/s", start=2.0)
    block = hc.Block("two", [x, v, w], [], [x], [k], {"x": v.symbol, "v": 0, "w": -k.symbol * w.symbol})
    found = hc.observability(block, None, ["x"])
    assert (found.rank, found.observable, found.detectable) == (2, False, True)
    assert found.hidden_modes == pytest.approx((-2.0,))
    assert "unobservable: w, decaying by itself" in found.sentence()
    hc.extended_kalman(block, ["x"], process_noise={}, measurement_noise={"x": 1.0})  # no warning


def test_a_hidden_combination_is_told_with_its_units():
    """A sum is measured: of two constants only their sum is seen."""
    a, b = hc.Signal("a", "m"), hc.Signal("b", "m")
    total = hc.Signal("total", "m")
    block = hc.Block(
        "sum", [a, b], [], [total], derivatives={"a": 0, "b": 0},
        output_expressions={"total": a.symbol + 2 * b.symbol},
    )  # fmt: skip
    found = hc.observability(block, None, ["total"])
    assert found.sentence().endswith("unobservable: +1 m a with -0.5 m b")
    assert not found.detectable


def test_what_is_seen_least_is_named():
    """Over 1 s at 1 m/s a yaw rate that dry friction stops within 12 ms hardly moves the craft aside."""
    text = hc.observability(CRAFT, {"u": 1.0}, ["x", "y"]).sentence()
    assert "with x, y measured: all 6 states are observable; weakest: r (singular value 2e-14 s" in text


def test_points_of_python_control_and_points_with_x_and_u_are_taken():
    plant = CRAFT.plant()
    point = control.OperatingPoint(np.array([0, 0, 0.3, 1.0, 0, 0]), np.array([1.8, 0.0]))

    class Trim:
        x, u = point.states, point.inputs

    a, b, c = (
        hc.observability(plant, at, ["x", "y"])
        for at in (point, Trim(), dict(zip(("x", "y", "psi", "u", "v", "r"), point.states, strict=True)))
    )
    np.testing.assert_array_equal(a.gramian, b.gramian)
    assert a.rank == c.rank == 6


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"at": {"w": 1.0}}, "no state or input 'w'"),
        ({"at": [1.0]}, "expected 2 finite states"),
        ({"at": {"v": float("nan")}}, "expected 2 finite states"),
        ({"at": "fast"}, "expected 2 finite states, found 'fast'"),
        ({"measured": ["z"]}, "no output 'z'"),
        ({"measured": []}, "expected different names"),
        ({"window": 0.0}, "window must be positive"),
        ({"params": {"cart.drog": 1.0}}, "unknown parameter 'cart.drog'"),
    ],
)
def test_what_it_cannot_use_is_refused_in_one_line(given, said):
    with pytest.raises(InputError, match=said):
        hc.observability(cart(), **({"measured": ["x"]} | given))
