"""Windows simulated by compiled code are those simulated by NumPy and by SciPy; so are their slopes."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from hovercontrol import Block, Signal
from hovercontrol.blocks.backends import shoot as module
from hovercontrol.blocks.backends.shoot import Columns, shoot, shoot_with_slopes
from hovercontrol.craft.models.vehicles import c17_simulation

W, K, S = 21, 9, 4
DT = 0.05


@pytest.fixture(scope="module")
def case():
    block = c17_simulation().plant()
    rng = np.random.default_rng(0)
    lengths = rng.dirichlet(np.full(S, 5.0), (K - 1, W))
    step = DT * np.moveaxis(lengths, 2, 0)
    begin = np.arange(K - 1)[:, None] * DT
    time = np.cumsum(step, axis=0) - step + begin
    inputs = np.repeat(rng.uniform(0.5, 2.0, (2, 1, K - 1, W)), S, axis=1)
    start = rng.normal(0.0, 0.5, (len(block.states), W))
    parameters = np.array(block.parameter_values(None))
    parameters *= rng.uniform(0.9, 1.1, parameters.shape)
    return block, time, step, inputs, parameters.tolist(), start


@pytest.fixture(scope="module")
def columns(case):
    """All states but the fourth, then three parameters, two of which share a column."""
    states, parameters = len(case[0].states), len(case[0].parameters)
    of_parameter = np.full(parameters, -1)
    of_parameter[:3] = states - 1, states, states
    return Columns([i if i < 3 else i - 1 if i > 3 else -1 for i in range(states)], of_parameter.tolist())


def by_numpy(case, known, monkeypatch, columns=None):
    block, time, step, inputs, parameters, start = case
    with monkeypatch.context() as patch:
        patch.setattr(module, "_compiled", lambda block: None)
        if columns:
            return shoot_with_slopes(block, time, step, inputs, known, parameters, start, columns)
        return shoot(block, time, step, inputs, known, parameters, start)


def by_compiler(case, known, columns=None):
    block, time, step, inputs, parameters, start = case
    library = module._compiled.future(block)
    if library.exception():  # waits for the compiler
        pytest.skip(str(library.exception()))
    if columns:
        return shoot_with_slopes(block, time, step, inputs, known, parameters, start, columns)
    return shoot(block, time, step, inputs, known, parameters, start)


def test_compiled_windows_are_those_of_numpy(case, columns, monkeypatch):
    rng = np.random.default_rng(1)
    known = {4: rng.normal(size=(S, K - 1, W))}
    for given in ({}, known):
        ours, theirs = by_compiler(case, given), by_numpy(case, given, monkeypatch)
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-13)
        for one, other in zip(
            by_compiler(case, given, columns), by_numpy(case, given, monkeypatch, columns), strict=True
        ):
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-12)


def test_slopes_are_the_differences_of_windows(case, columns, monkeypatch):
    block, time, step, inputs, parameters, start = case
    states, slopes = by_numpy(case, {}, monkeypatch, columns)
    np.testing.assert_allclose(states, by_numpy(case, {}, monkeypatch), rtol=1e-13, atol=1e-14)
    assert slopes.shape == (len(start), columns.count, W)
    for column in range(columns.count):
        there = []
        for sign in (1.0, -1.0):
            x, p = start.copy(), np.array(parameters)
            x[np.array(columns.of_state) == column] += sign * 1e-6
            p[np.array(columns.of_parameter) == column] += sign * 1e-6
            there.append(by_numpy((block, time, step, inputs, p.tolist(), x), {}, monkeypatch)[-1])
        difference = (there[0] - there[1]) / 2e-6
        scale = max(float(np.abs(difference).max()), 1.0)
        np.testing.assert_allclose(slopes[:, column], difference, rtol=0, atol=1e-5 * scale)


def test_given_states_have_no_slopes(case, columns):
    _, slopes = by_compiler(case, {4: np.ones((S, K - 1, W))}, columns)
    assert not slopes[4].any() or columns.of_state[4] >= 0
    rest = np.delete(np.arange(columns.count), columns.of_state[4])
    assert not slopes[4, rest].any()


def test_a_partial_derivative_that_is_not_finite_counts_as_zero(monkeypatch):
    v, w, k = Signal("v", "m/s"), Signal("w", "m/s"), Signal("k", "1/m", start=0.5)
    speed = sp.sqrt(v.symbol**2 + w.symbol**2)  # has no slope at rest
    drag = {s.name: -k.symbol * speed * s.symbol for s in (v, w)}
    block = Block("drag", [v, w], [], [v, w], [k], drag)
    time = np.zeros((1, 1, 3))
    start = np.array([[0.0, 1.0, 2.0], [0.0, 0.0, 1.0]])
    case = (block, time, np.full((1, 1, 3), 0.1), np.empty((0, 1, 1, 3)), [0.5], start)
    for _, slopes in (
        by_numpy(case, {}, monkeypatch, Columns([0, 1], [2])),
        by_compiler(case, {}, Columns([0, 1], [2])),
    ):
        assert np.isfinite(slopes).all()
        np.testing.assert_array_equal(slopes[..., 0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        exact = 1.0 / (1.0 + 0.5 * 0.1 * start[0, 1]) ** 2  # v = v0 / (1 + k v0 t), w at zero
        assert slopes[0, 0, 1] == pytest.approx(exact, abs=1e-6)


def test_windows_follow_the_exact_motion(case, monkeypatch):
    block, time, step, inputs, parameters, start = case
    smooth = [0.2 if "width" in p.name else v for p, v in zip(block.parameters, parameters, strict=True)]
    found = by_numpy((block, time, step, inputs, smooth, start), {}, monkeypatch)
    f = block.to_numpy()
    params = dict(zip(block.default_parameters, smooth, strict=True))
    for w in (0, 20):
        x = start[:, w]
        for k in range(K - 1):
            u = inputs[:, 0, k, w]
            x = solve_ivp(
                lambda t, x, u=u: f.derivatives(t, x, u, params),
                (0, DT),
                x,
                rtol=1e-9,
                atol=1e-11,
            ).y[:, -1]
            np.testing.assert_allclose(found[k + 1, :, w], x, rtol=0, atol=1e-5)


def test_two_threads_say_what_one_says(case, monkeypatch):
    block, time, step, inputs, parameters, start = case
    many = [np.tile(a, 8) for a in (time, step, inputs, start)]
    wide = (block, many[0], many[1], many[2], parameters, many[3])
    monkeypatch.setattr(module, "threads", lambda: 1)
    one = by_compiler(wide, {})
    monkeypatch.setattr(module, "threads", lambda: 2)
    np.testing.assert_array_equal(by_compiler(wide, {}), one)
    np.testing.assert_array_equal(one[..., :W], one[..., W : 2 * W])


def test_threads_that_outlive_an_interrupt_write_into_arrays_that_are_theirs(case, monkeypatch):
    begun = []

    class Interrupted:
        def map(self, work, jobs):
            begun.extend((work, job) for job in jobs)
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "pool", Interrupted)
    monkeypatch.setattr(module, "threads", lambda: 2)
    monkeypatch.setattr(module, "SHARE", 1)
    with pytest.raises(KeyboardInterrupt):
        by_compiler(case, {})
    _, (_, arrays, _, _) = begun[0]
    states = arrays[6]
    states[1:] = np.nan
    assert [work(job) for work, job in begun] == [0, 0]  # nobody but the jobs holds the arrays now
    assert np.isfinite(states).all()


def test_euler_steps_of_rates_are_the_next_values(monkeypatch):
    y, u, a = Signal("y", "1"), Signal("u", "1/s"), Signal("a", "1/s", start=0.3)
    block = Block("map", [y], [u], [y], [a], {"y": u.symbol - a.symbol * y.symbol**2})
    h = np.array([0.5, 0.5, 0.0])[:, None, None] * np.ones((1, 1, W))  # a step of length zero changes nothing
    inputs = np.random.default_rng(3).normal(size=(1, 3, 1, W))
    given = (block, np.zeros_like(h), h, inputs, {}, [0.3], np.linspace(-1.0, 1.0, W)[None])
    x, by_start, by_a = given[-1][0], np.ones(W), np.zeros(W)
    for k in range(2):  # y+ = y + h (u - a y^2), and its slopes by the chain rule
        by_a = by_a * (1.0 - 0.3 * x) - 0.5 * x**2
        by_start = by_start * (1.0 - 0.3 * x)
        x = x + 0.5 * (inputs[0, k, 0] - 0.3 * x**2)
    library = module._compiled.future(block)
    for compiled in (False, not library.exception()):
        with monkeypatch.context() as patch:
            if not compiled:
                patch.setattr(module, "_compiled", lambda block: None)
            states, slopes = shoot_with_slopes(*given, Columns([0], [1]), euler=True)
        np.testing.assert_allclose(states[1, 0], x, rtol=1e-13)
        np.testing.assert_allclose(slopes[0], [by_start, by_a], rtol=1e-12, atol=1e-14)
