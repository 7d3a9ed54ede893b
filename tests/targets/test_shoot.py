"""Windows simulated by compiled code are those simulated by NumPy, and those of SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol.models.vehicles import c17_simulation
from hovercontrol.targets import shoot as module
from hovercontrol.targets.shoot import shoot

W, K, S, C = 21, 9, 4, 3
DT = 0.05


@pytest.fixture(scope="module")
def case():
    block = c17_simulation().plant()
    rng = np.random.default_rng(0)
    lengths = rng.dirichlet(np.full(S, 5.0), (K - 1, W))
    step = DT * np.moveaxis(lengths, 2, 0)[:, :, None]
    begin = np.arange(K - 1)[:, None] * DT
    time = np.cumsum(step, axis=0)[:, :, 0] - step[:, :, 0] + begin
    inputs = np.repeat(rng.uniform(0.5, 2.0, (2, 1, K - 1, 1, W)), S, axis=1)
    start = rng.normal(0.0, 0.5, (len(block.states), C, W))
    parameters = np.repeat(np.array(block.parameter_values(None))[:, None], C, axis=1)
    parameters *= rng.uniform(0.9, 1.1, parameters.shape)
    return block, time, step, inputs, parameters, start


def by_numpy(case, known, monkeypatch):
    block, time, step, inputs, parameters, start = case
    with monkeypatch.context() as patch:
        patch.setattr(module, "_compiled", lambda block: None)
        return shoot(block, time, step, inputs, known, parameters, start)


def by_compiler(case, known):
    block, time, step, inputs, parameters, start = case
    library = module._build(block)
    if library.exception():  # waits for the compiler
        pytest.skip(str(library.exception()))
    return shoot(block, time, step, inputs, known, parameters, start)


@pytest.mark.parametrize("ways", [1, C])
def test_compiled_windows_are_those_of_numpy(case, ways, monkeypatch):
    rng = np.random.default_rng(1)
    block, time, step, inputs, parameters, start = case
    steps = step * rng.uniform(0.9, 1.1, (1, 1, ways, 1))
    case = (block, time, steps, np.repeat(inputs, ways, axis=3), parameters, start)
    known = {4: rng.normal(size=(S, K - 1, ways, W))}
    for given in ({}, known):
        ours, theirs = by_compiler(case, given), by_numpy(case, given, monkeypatch)
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-13)


def test_windows_follow_the_exact_motion(case, monkeypatch):
    block, _, _, inputs, parameters, start = case
    found = by_numpy(case, {}, monkeypatch)
    f = block.to_numpy()
    for w, c in ((0, 0), (20, 2)):
        params = dict(zip(block.default_parameters, parameters[:, c], strict=True))
        x = start[:, c, w]
        for k in range(K - 1):
            u = inputs[:, 0, k, 0, w]
            x = solve_ivp(
                lambda t, x, u=u, params=params: f.derivatives(t, x, u, params),
                (0, DT),
                x,
                rtol=1e-9,
                atol=1e-11,
            ).y[:, -1]
            np.testing.assert_allclose(found[k + 1, :, c, w], x, rtol=0, atol=2e-3)  # a step over standstill


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
    states = arrays[-1]
    states[1:] = np.nan
    assert [work(job) for work, job in begun] == [0, 0]  # nobody but the jobs holds the arrays now
    assert np.isfinite(states).all()
