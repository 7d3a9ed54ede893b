"""The solver on smooth systems: order, tolerance, dense output, counts and errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate
from scipy.integrate import solve_ivp

from .support import DOP853, DORMAND_PRINCE, NOT_FINITE, OK, RK4, STEP_TOO_SMALL, TOO_MANY_STEPS

X0 = [1.0, 0.0, 2.0, 0.0, 0.5, 0.0]
P = [1.0, 0.5, 100.0]


def right_hand_side(t, x, p):
    return [
        x[1], -x[0], x[3], p[0] * (1 - x[2] ** 2) * x[3] - x[2], np.sin(t) - 0.7 * np.tanh(x[4] / p[1]),
        np.sqrt(p[2] - t),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def reference():
    times = np.linspace(0.0, 10.0, 1001)
    solution = solve_ivp(right_hand_side, (0, 10), X0, "DOP853", times, rtol=1e-13, atol=1e-14, args=(P,))
    return times, solution.y.T


def orders(errors):
    return np.log2(np.divide(errors[:-1], errors[1:]))


def test_order_of_runge_kutta_is_four(build, reference):
    times, expected = reference
    runs = [build("smooth").simulate(times, X0, P, method=RK4, step=h) for h in (0.04, 0.02, 0.01)]
    last = [np.abs(run.states[-1] - expected[-1]).max() for run in runs]
    assert orders(last) == pytest.approx(4.0, abs=0.2)
    assert orders([np.abs(run.states - expected).max() for run in runs]).min() > 3.7  # between steps too


def test_order_of_dormand_prince_is_five_and_four_between_the_steps(build, reference):
    """Steps of one length: the tolerance is so wide that `step` alone limits them."""
    times, expected = reference
    runs = [build("smooth").simulate(times, X0, P, rtol=1.0, atol=1e3, step=h) for h in (0.2, 0.1, 0.05)]
    assert orders([np.abs(run.states[-1] - expected[-1]).max() for run in runs]).min() > 4.6
    assert orders([np.abs(run.states - expected).max() for run in runs]).min() > 3.7


def test_order_of_dop853_is_eight_and_seven_between_the_steps(build):
    """Two oscillators and sin(t), exact; the others of smooth.c stand apart with errors of their own."""
    times = np.linspace(0.0, 16.0, 321)
    exact = np.array(
        [np.cos(times), -np.sin(times), np.cos(times), -np.sin(times), 0.5 + 1 - np.cos(times)]
    ).T
    x0, p, wide = [1.0, 0.0, 1.0, 0.0, 0.5, 0.0], [0.0, 1e300, 100.0], {"rtol": 1.0, "atol": 1e3}
    errors = []
    for h in (1.6, 0.8, 0.4):
        run = build("smooth").simulate(times, x0, p, method=DOP853, step=h, **wide)
        off = np.abs(run.states[:, :5] - exact).max(axis=1)
        errors.append((off[-1], off.max()))
    last, between = map(orders, zip(*errors, strict=True))
    assert last.min() > 7.6
    assert between.min() > 6.7


@pytest.mark.parametrize("method", [DORMAND_PRINCE, DOP853])
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_error_follows_the_tolerance(build, reference, rtol, method):
    times, expected = reference
    run = build("smooth").simulate(times, X0, P, rtol=rtol, atol=rtol, method=method)
    assert run.status == OK
    assert np.abs(run.states[:, :5] - expected[:, :5]).max() < 200 * rtol


def test_a_step_of_dop853_is_that_of_scipy(build):
    """From the same state over the same length, to rounding; and a run takes about as many evaluations."""
    for h in (0.05, 0.1, 0.2):
        run = build("smooth").simulate([0.0, h], X0, P, method=DOP853, rtol=1.0, atol=1e3)
        one = integrate.DOP853(
            lambda t, x: right_hand_side(t, x, P), 0.0, X0, h, rtol=1.0, atol=1e3, first_step=h
        )
        assert one.step() is None and one.t == h
        np.testing.assert_allclose(run.last, one.y, rtol=1e-14, atol=1e-15)
    for rtol in (1e-6, 1e-9, 1e-12):
        solver = build("smooth").solver(rtol=rtol, atol=rtol, method=DOP853)
        assert solver.set(0.0, X0, p=P) == OK
        assert solver.advance(10.0) == OK
        scipy = solve_ivp(right_hand_side, (0, 10), X0, "DOP853", rtol=rtol, atol=rtol, args=(P,))
        assert 0.8 * scipy.nfev < solver.counts["evaluations"] < 1.1 * scipy.nfev


def test_harmonic_oscillator_over_a_thousand_turns(build):
    solver = build("oscillator").solver(rtol=1e-11)
    assert solver.set(0.0, [1.0, 0.0], [0.0], [1.0, 0.0]) == OK
    assert solver.advance(2000 * np.pi) == OK
    assert solver.states == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.filterwarnings("ignore:overflow")  # SciPy's Jacobian of the states that stand apart
def test_stiff_systems_come_through(build):
    """Van der Pol with damping 100 and regularised friction of width 1e-3, against an implicit method."""
    p, times = [100.0, 1e-3, 100.0], np.linspace(0.0, 20.0, 21)
    run = build("smooth").simulate(times, X0, p, rtol=1e-6)
    assert run.status == OK
    expected = solve_ivp(right_hand_side, (0, 20), X0, "Radau", times, rtol=1e-9, atol=1e-11, args=(p,)).y.T
    assert run.states == pytest.approx(expected, abs=3e-5)


@pytest.mark.parametrize(("method", "cost", "rejected"), [(DORMAND_PRINCE, 6, 0.1), (DOP853, 12, 0.3)])
def test_a_step_costs_six_or_twelve_evaluations(build, method, cost, rejected):
    solver = build("smooth").solver(rtol=1e-8, method=method)
    assert solver.set(0.0, X0, p=P) == OK
    for until in np.linspace(0.5, 10.0, 20):
        assert solver.advance(until) == OK
    counts = solver.counts
    first = 2  # the derivative at the start, and one to choose the first step
    assert counts["evaluations"] == first + cost * (counts["accepted"] + counts["rejected"])
    assert counts["rejected"] < rejected * counts["accepted"]


def test_no_more_steps_than_scipy(build):
    solver = build("smooth").solver(rtol=1e-6, atol=1e-8)
    assert solver.set(0.0, X0, p=P) == OK
    assert solver.advance(10.0) == OK
    scipy = solve_ivp(right_hand_side, (0, 10), X0, "RK45", rtol=1e-6, atol=1e-8, args=(P,))
    assert solver.counts["evaluations"] < 1.05 * scipy.nfev


def test_until_is_met_exactly(build):
    for options in ({"rtol": 1e-6}, {"method": RK4, "step": 0.01}, {"method": DOP853}):
        solver = build("smooth").solver(**options)
        assert solver.set(0.0, X0, p=P) == OK
        for until in (0.1, 1 / 3, 1 / 3 + 1e-15, 5.0, np.pi * 2):
            assert solver.advance(until) == OK
            assert solver.time == until
        before = solver.counts["accepted"]
        assert solver.advance(1.0) == OK  # in the past: nothing happens
        assert solver.counts["accepted"] == before


def test_a_short_advance_does_not_shorten_the_next_steps(build):
    steps = []
    for extra in (0.0, 1e-6):
        solver = build("smooth").solver(rtol=1e-6)
        assert solver.set(0.0, X0, p=P) == OK
        for until in np.linspace(0.5, 10.0, 20):
            assert solver.advance(until) == OK
            assert solver.advance(until + extra) == OK
        steps.append(solver.counts["accepted"])
    assert steps[1] <= steps[0] + 20 + 5


@pytest.mark.parametrize("method", [DORMAND_PRINCE, DOP853])
def test_results_do_not_depend_on_a_fine_grid(build, method):
    """Grid times are read inside the steps: a grid a hundred times finer changes nothing."""
    coarse = build("smooth").simulate(np.linspace(0, 10, 11), X0, P, rtol=1e-6, method=method)
    fine = build("smooth").simulate(np.linspace(0, 10, 1001), X0, P, rtol=1e-6, method=method)
    assert fine.states[::100] == pytest.approx(coarse.states, rel=1e-12, abs=1e-13)
    assert np.array_equal(fine.last, coarse.last)


@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"method": RK4, "step": 0.01}, {"method": DOP853}])
def test_no_number_stops_at_the_last_good_time(build, options):
    run = build("smooth").simulate(np.linspace(0, 10, 101), X0, [1.0, 0.5, 5.0], **options)
    assert run.status == NOT_FINITE
    assert 4.97 < run.reached <= 5.0
    assert np.isfinite(run.last).all()
    assert np.isfinite(run.states[:50]).all()
    assert np.isnan(run.states[52:]).all()
    assert np.isnan(run.outputs[52:]).all()


def test_no_number_at_the_start(build):
    solver = build("smooth").solver()
    assert solver.set(0.0, X0, p=[1.0, 0.5, -1.0]) == OK
    assert solver.advance(1.0) == NOT_FINITE
    assert solver.time == 0.0
    assert solver.set(0.0, p=P) == OK  # and it can go on
    assert solver.advance(1.0) == OK


def test_number_of_steps_is_limited(build):
    for options in ({"rtol": 1e-8}, {"method": RK4, "step": 0.01}):
        solver = build("smooth").solver(max_steps=20, **options)
        assert solver.set(0.0, X0, p=P) == OK
        assert solver.advance(10.0) == TOO_MANY_STEPS
        assert 0.0 < solver.time < 10.0
        assert solver.counts["accepted"] + solver.counts["rejected"] == 20
        reached = solver.time
        assert solver.advance(reached + 1e-3) == OK  # each advance has its own


def test_error_that_cannot_be_met(build):
    solver = build("smooth").solver(rtol=0.0, atol=1e-40)
    assert solver.set(1.0, X0, p=P) == OK
    assert solver.advance(2.0) == STEP_TOO_SMALL
    assert np.isfinite(solver.states).all()


def test_longest_step_is_kept(build):
    solver = build("smooth").solver(rtol=1e-2, step=0.05)
    assert solver.set(0.0, X0, p=P) == OK
    assert solver.advance(10.0) == OK
    assert solver.counts["accepted"] >= 200
