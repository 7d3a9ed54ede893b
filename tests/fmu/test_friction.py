"""Dry friction done right: sticking is exact, events are where they belong, modes agree with the forces."""

from __future__ import annotations

import ctypes
import itertools
from functools import cache

import mpmath
import numpy as np
import pytest
from mpmath import mp

from .support import DOP853, DORMAND_PRINCE, OK, RK4, STEP_TOO_SMALL, doubles, pointer


@cache
def pieces(c: float, until: float) -> list[tuple[float, int]]:
    """Times at which v' = sin t - c sgn v, from rest, changes its mode, and the modes; to 30 digits."""
    with mp.workdps(30):
        c = mp.mpf(c)
        breakaway = mpmath.asin(c)
        found, t, mode = [(mp.mpf(0), 0)], breakaway, 1
        while t < until:
            found.append((t, mode))

            def away(s, t=t, mode=mode):  # how far v is from zero after it left at t
                return mode * (mpmath.cos(t) - mpmath.cos(s)) - c * (s - t)

            s = t + mp.mpf(1) / 10
            while away(s + mp.mpf(1) / 100) > 0:
                s += mp.mpf(1) / 100
            end = mpmath.findroot(away, (s, s + mp.mpf(1) / 100), solver="anderson", tol=1e-28)
            force = mpmath.sin(end)
            if abs(force) > c:
                t, mode = end, int(mpmath.sign(force))
                continue
            found.append((end, 0))
            turns = [(mpmath.pi * k + breakaway, (-1) ** k) for k in range(20)]
            t, mode = next(turn for turn in turns if turn[0] > end)
        return [(float(t), mode) for t, mode in found]


def exact(c: float, times: np.ndarray) -> np.ndarray:
    switches = pieces(c, float(times[-1]))
    v = np.zeros_like(times)
    for (start, mode), (end, _) in itertools.pairwise([*switches, (np.inf, 0)]):
        inside = (times >= start) & (times < end)
        if mode:
            v[inside] = np.cos(start) - np.cos(times[inside]) - mode * c * (times[inside] - start)
    return v


def only_first(c):
    """Parameters of driven.c with the other two speeds at rest for good."""
    return [c, 0.0, 1.0, 0.0, 1.0, 1.0]


TIMES = np.linspace(0.0, 20.0, 2001)


@pytest.mark.parametrize("method", [DORMAND_PRINCE, DOP853])
@pytest.mark.parametrize("c", [0.7, 0.3])  # with rest after each slip; without
@pytest.mark.parametrize(
    ("rtol", "bound"),
    [(1e-4, 5e-3), (1e-5, 5e-4), (1e-6, 2e-5), (1e-7, 2e-6), (1e-8, 2e-7), (1e-10, 3e-9), (1e-12, 3e-11)],
)
def test_driven_mass_follows_the_exact_solution(build, c, rtol, bound, method):
    run = build("driven").simulate(TIMES, [0, 0, 0], only_first(c), rtol=rtol, method=method)
    assert run.status == OK
    assert np.abs(run.states[:, 0] - exact(c, TIMES)).max() < bound


def test_fixed_steps_follow_it_too_and_keep_their_order(build):
    errors = [
        np.abs(
            build("driven").simulate(TIMES, [0, 0, 0], only_first(0.3), method=RK4, step=step).states[:, 0]
            - exact(0.3, TIMES)
        ).max()
        for step in (0.1, 0.05, 0.025)
    ]
    assert errors[-1] < 2e-9
    assert np.log2(np.divide(errors[:-1], errors[1:])).min() > 3.7


def test_one_event_per_change_of_mode(build):
    solver = build("driven").solver(rtol=1e-8)
    assert solver.set(0.0, [0, 0, 0], p=only_first(0.7)) == OK
    assert solver.advance(20.0) == OK
    assert solver.counts["events"] == sum(0.0 < t < 20.0 for t, _ in pieces(0.7, 20.0))


def test_sticking_velocity_is_exactly_zero(build):
    run = build("driven").simulate(TIMES, [0, 0, 0], only_first(0.7), rtol=1e-6)
    sticking = run.outputs[:, 3] == 0
    assert 0.2 < sticking.mean() < 0.3
    assert np.all(run.states[sticking, 0] == 0.0)
    assert np.all(run.states[:, 1:] == 0.0)


@pytest.mark.parametrize(
    "options", [{"rtol": 1e-4}, {"rtol": 1e-9}, {"method": RK4, "step": 0.3}, {"method": DOP853}]
)
def test_breakaway_from_rest_at_the_exact_time(build, options):
    """A ramp p1 t against p2: it slips from t = p2/p1 on, with v = p1 (t - p2/p1)^2 / 2."""
    run = build("driven").simulate(
        [0.0, 2.4999999999, 2.5000000001, 7.0], [0, 0, 0], [2, 0.1, 0.25, 0, 1, 1], **options
    )
    assert run.outputs[:, 4].tolist() == [0, 0, 1, 1]
    assert run.states[1, 1] == 0.0
    assert run.states[3, 1] == pytest.approx(0.05 * 4.5**2, rel=1e-12)


def test_breakaway_is_seen_though_nothing_moves(build):
    """States at rest tell the error control nothing; a force that peaks now and then is not missed."""
    solver = build("driven").solver(rtol=1e-3)
    assert solver.set(0.0, [0, 0, 0], p=[2000.0, 0.0, 1.0, 1.0, 1.0 / 7.0, 0.999]) == OK
    assert solver.advance(7.0 * np.arcsin(0.999) - 1e-9) == OK
    assert solver.modes == [0, 0, 0]
    assert solver.advance(7.0 * np.arcsin(0.999) + 1e-9) == OK
    assert solver.modes == [0, 0, 1]


@pytest.mark.parametrize(
    "p",
    [[8.0, 6.0, 1.7, 1.0, 0.8, 1.5], [30.0, 5.0, 5.0, 2.0, 1.0, 0.5], [20.0, 3.0, 1.0, 1.5, 0.5, 1.0]],
)
def test_three_coupled_axes_against_tiny_steps_without_modes(build, p):
    runtime, parameters = build("axes"), doubles(p)
    reference = []
    for every in (10_000, 20_000):
        x, states = np.zeros(6), np.empty((200, 6))
        runtime.lib.moreau(
            pointer(x), pointer(parameters), ctypes.c_double(0.1 / every), ctypes.c_long(200 * every),
            ctypes.c_long(every), pointer(states),
        )  # fmt: skip
        reference.append(states)
    uncertain = np.abs(reference[1] - reference[0]).max()
    assert uncertain < 5e-5
    times = np.linspace(0.0, 20.0, 201)
    best = runtime.simulate(times, np.zeros(6), p, rtol=1e-11)
    assert np.abs(best.states[1:] - reference[1]).max() < 3 * uncertain + 1e-9
    assert len({tuple(modes) for modes in best.outputs[:, 6:]}) >= 7  # sticking and slipping in many ways
    assert np.all(best.states[:, 3:][best.outputs[:, 6:] == 0] == 0.0)
    for options, bound in (
        ({"rtol": 1e-6}, 1e-5),
        ({"rtol": 1e-8}, 2e-7),
        ({"method": RK4, "step": 0.005}, 2e-7),
    ):
        run = runtime.simulate(times, np.zeros(6), p, **options)
        assert run.status == OK
        assert np.abs(run.states - best.states).max() < bound


def test_modes_from_rest_agree_with_the_forces(build, rng):
    """On a rigid link one axis's mode decides over the other's; exactly one pair of modes is consistent."""
    solver = build("linked").solver()
    for _ in range(500):
        q, c, u = rng.uniform(-0.95, 0.95), rng.uniform(0.1, 1.0, 2), rng.uniform(-3.0, 3.0, 2)
        assert solver.set(0.0, [0, 0], u, [q, *c]) == OK
        consistent = []
        for modes in itertools.product((-1, 0, 1), repeat=2):
            fits = True
            for k, mode in enumerate(modes):
                other = modes[1 - k]
                a = u[k] + q * (u[1 - k] - c[1 - k] * other) if other else (1 - q * q) * u[k]
                b = c[k] if other else (1 - q * q) * c[k]
                fits &= mode * a > b if mode else abs(a) <= b
            if fits:
                consistent.append(list(modes))
        assert consistent == [solver.modes]


def test_a_reversal_within_one_long_step_is_seen(build):
    """Speed 0.3 under sin t - 0.1 sgn v from t = 5.4 turns back before 2 pi, and forward again before 7.4."""
    events = []
    for step in (2.0, 0.01):
        solver = build("driven").solver(method=RK4, step=step)
        assert solver.set(5.4, [0.3, 0, 0], p=only_first(0.1)) == OK
        assert solver.advance(7.4) == OK
        assert solver.modes == [1, 0, 0]
        events.append(solver.counts["events"])
    assert events[0] == events[1] > 1


@pytest.mark.parametrize("c", [0.0, 1e-300, 1e-12])
@pytest.mark.parametrize("x0", [[0.0, 0.0], [1.0, 0.0], [0.0, -0.5]])
@pytest.mark.parametrize("u", [0.0, 0.3, -1.0])
def test_without_friction_it_is_a_smooth_system(build, c, x0, u):
    solver = build("oscillator").solver(rtol=1e-9)
    assert solver.set(0.0, x0, [u], [3.0, c]) == OK
    assert solver.advance(20.0) == OK
    rest = u / 9.0
    expected = rest + (x0[0] - rest) * np.cos(60.0) + x0[1] / 3.0 * np.sin(60.0)
    assert solver.states[0] == pytest.approx(expected, abs=2e-8)
    if c == 0.0:
        assert solver.counts["events"] == 0
        assert solver.modes != [0]


def test_coulomb_damping_takes_the_same_amplitude_each_half_turn(build):
    times = np.linspace(0.0, 15.0, 1501)
    run = build("oscillator").simulate(times, [1.0, 0.0], [3.0, 0.4], np.zeros((1501, 1)), rtol=1e-9)
    for half_turn in range(11):
        at = half_turn * np.pi / 3.0
        x = np.interp(at, times, run.states[:, 0])
        assert abs(x) == pytest.approx(1.0 - half_turn * 2 * 0.4 / 9.0, abs=2e-4)
    assert run.states[-1, 0] == pytest.approx(-(1.0 - 11 * 0.8 / 9.0), abs=1e-8)
    assert run.states[-1, 1] == 0.0


@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"rtol": 1e-9}, {"method": RK4, "step": 0.01}])
def test_energy_never_grows_without_input(build, options):
    times = np.linspace(0.0, 15.0, 1501)
    run = build("oscillator").simulate(times, [1.0, 0.7], [3.0, 0.4], np.zeros((1501, 1)), **options)
    energy = 0.5 * run.states[:, 1] ** 2 + 4.5 * run.states[:, 0] ** 2
    assert np.diff(energy).max() <= 1e-2 * options.get("rtol", 1e-6) * energy[0]


def test_input_that_jumps_over_breakaway_starts_a_slip_at_once(build):
    solver = build("oscillator").solver(rtol=1e-9)
    assert solver.set(0.0, [0.0, 0.0], [0.3], [0.0, 0.4]) == OK
    assert solver.advance(1.0) == OK
    assert (solver.modes, solver.states.tolist()) == ([0], [0.0, 0.0])
    assert solver.set(1.0, u=[0.6]) == OK
    assert solver.modes == [1]
    assert solver.advance(3.0) == OK
    assert solver.states == pytest.approx([0.5 * 0.2 * 4.0, 0.4], rel=1e-9)
    assert solver.set(3.0, u=[0.0]) == OK
    assert solver.advance(3.5) == OK
    assert solver.advance(10.0) == OK  # stops at 4.0 after 0.4 * 1 / 2
    assert solver.states == pytest.approx([0.6, 0.0], abs=1e-8)
    assert solver.modes == [0]


def test_model_at_odds_with_itself_ends_with_an_error(build):
    for options in ({"rtol": 1e-6}, {"method": RK4, "step": 0.1}):
        solver = build("contradiction").solver(**options)
        assert solver.set(0.0, [0.0]) == OK
        assert solver.advance(1.0) == STEP_TOO_SMALL
        assert solver.time < 0.1
