"""Whole simulations and sweeps: inputs that jump, figures, failed runs, threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from .support import NOT_FINITE, OK, RK4

TIMES = np.linspace(0.0, 20.0, 801)


def steps(n):
    """An input that jumps now and then."""
    return np.repeat([0.0, 1.0, -2.0, 0.2], -(-n // 4))[:n, None]


@pytest.mark.parametrize("options", [{"rtol": 1e-9}, {"method": RK4, "step": 0.004}])
def test_inputs_hold_from_row_to_row(build, options):
    """A frictionless mass without a spring: v is the sum of the held inputs, exactly."""
    u = np.sin(np.arange(801.0))[:, None]
    run = build("oscillator").simulate(TIMES, [0.0, 0.0], [0.0, 0.0], u, **options)
    v = np.concatenate([[0.0], np.cumsum(u[:-1, 0] * np.diff(TIMES))])
    assert run.states[:, 1] == pytest.approx(v, abs=1e-11)


@pytest.mark.parametrize("options", [{"rtol": 1e-7}, {"method": RK4, "step": 0.01}])
def test_simulation_is_what_advancing_by_hand_gives(build, options):
    u, p = steps(801), [3.0, 0.4]
    run = build("oscillator").simulate(TIMES, [1.0, 0.0], p, u, **options)
    solver = build("oscillator").solver(**options)
    assert solver.set(0.0, [1.0, 0.0], u[0], p) == OK
    worst = 0.0
    for i in range(1, 801):
        assert solver.advance(TIMES[i]) == OK
        if u[i] != u[i - 1]:
            assert solver.set(TIMES[i], u=u[i]) == OK
        worst = max(worst, np.abs(solver.states - run.states[i]).max())
    assert worst < 5e-6
    assert np.array_equal(run.states, run.outputs)
    assert np.array_equal(run.states[-1], run.last)


def figures(times, y, start, band):
    inside = times >= times[0] + start
    t, y = times[inside], y[inside]
    outside = np.flatnonzero(np.abs(y - y[-1]) > band)
    settling = t[outside[-1] + 1] if len(outside) else t[0]
    mean = np.trapezoid(y**2, t) / (t[-1] - t[0])
    return [y[-1], y.max(), y.min(), np.sqrt(mean), settling]


@pytest.mark.parametrize("start", [0.0, 3.3])
def test_figures_of_a_sweep_are_those_of_each_run(build, rng, start):
    x = rng.normal(size=(12, 2))
    p = np.column_stack([rng.uniform(1, 4, 12), rng.uniform(0, 0.5, 12)])
    u, band = steps(801), [0.05, 0.2]
    found, final, status = build("oscillator").sweep(TIMES, x, p, band, u, start)
    assert np.all(status == OK)
    for i in range(12):
        run = build("oscillator").simulate(TIMES, x[i], p[i], u)
        expected = [figures(TIMES, run.outputs[:, j], start, band[j]) for j in range(2)]
        assert found[i] == pytest.approx(np.array(expected), rel=1e-12, abs=1e-14)
        assert np.array_equal(found[i][:, [0, 1, 2, 4]], np.array(expected)[:, [0, 1, 2, 4]])
        assert np.array_equal(final[i], run.last)


def test_failed_run_leaves_the_others_alone(build):
    x = np.tile([1.0, 0.0, 2.0, 0.0, 0.5, 0.0], (3, 1))
    p = np.array([[1.0, 0.5, 100.0], [1.0, 0.5, 5.0], [1.0, 0.5, 100.0]])
    found, final, status = build("smooth").sweep(np.linspace(0, 10, 101), x, p, np.full(6, 0.1))
    assert status.tolist() == [OK, NOT_FINITE, OK]
    assert np.isnan(found[1]).all()
    assert np.array_equal(found[0], found[2])
    assert np.array_equal(final[0], final[2])


def test_eight_threads_give_the_same_bits(build, rng):
    x = rng.normal(size=(40, 6)) * 0.3
    p = np.tile([30.0, 5.0, 5.0, 2.0, 1.0, 0.5], (40, 1)) * rng.uniform(0.8, 1.2, (40, 6))
    band = np.full(9, 0.01)
    runtime = build("axes")
    alone = runtime.sweep(TIMES, x, p, band)
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda _: runtime.sweep(TIMES, x, p, band), range(8)))
        parts = list(
            pool.map(lambda xs, ps: runtime.sweep(TIMES, xs, ps, band), np.split(x, 8), np.split(p, 8))
        )
    for run in [*together, [np.concatenate(part) for part in zip(*parts, strict=True)]]:
        assert all(np.array_equal(one, other) for one, other in zip(alone, run, strict=True))


def test_one_time_is_no_time(build):
    run = build("oscillator").simulate([2.0], [1.0, 0.5], [3.0, 0.4], [[0.0]])
    assert (run.status, run.reached) == (OK, 2.0)
    assert run.states.tolist() == [[1.0, 0.5]]
