"""States that follow from given signals: NumPy and C agree, and a lag is exact."""

import numpy as np
import pytest

from hovercontrol.blocks.backends import follow as module
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.backends.follow import follow
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import c17_simulation

M, W = 60, 3


def signals(block, rng):
    time = np.repeat(0.02 * np.arange(M)[:, None], W, axis=1)
    states = rng.normal(size=(len(block.states), M, W))
    inputs = rng.uniform(-1.0, 3.0, size=(len(block.inputs), M, W))
    return time, np.full((M, W), 0.02), states, inputs


@pytest.fixture
def built():
    """Return a call that waits until the library of some followers is there."""
    try:
        find_compiler()
    except NoCompilerError:
        pytest.skip("there is no C compiler")
    return lambda block, which: module._compiled.future(block, which).result(timeout=60)


@pytest.mark.parametrize(
    ("name", "values", "state"),
    [
        ("thrust_lag", {"seconds": 0.1}, "thrust_lagged"),
        ("rudder_backlash", {"width": 0.2}, "rudder_played"),
        ("thrust_rate_limit", {"limit": 3.0}, "thrust_rate_limited"),
    ],
)
def test_c_and_numpy_agree(name, values, state, rng, built):
    block = c17_simulation().with_effects([effect(name, **values)]).plant()
    which = ([s.name for s in block.states].index(state),)
    given = signals(block, rng)
    parameters = list(block.default_parameters.values())
    built(block, which)
    found = follow(block, which, *given, parameters)
    plain = np.zeros_like(found)
    module._step(block, list(which), *given, parameters, plain)
    np.testing.assert_allclose(found, plain, atol=1e-6 * np.abs(plain).max())
    assert np.abs(found).max() > 0.1


def test_a_lag_is_exact(rng):
    block = c17_simulation().with_effects([effect("thrust_lag", seconds=0.1)]).plant()
    which = (len(block.states) - 1,)
    time, step, states, inputs = signals(block, rng)
    found = follow(block, which, time, step, states, inputs, list(block.default_parameters.values()))
    y, fade = np.zeros(W), np.exp(-0.02 / 0.1)
    for k in range(M):
        y = inputs[0, k] + (y - inputs[0, k]) * fade
        np.testing.assert_allclose(found[0, k + 1], y, rtol=1e-5)
