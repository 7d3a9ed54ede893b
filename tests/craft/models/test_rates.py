"""Effects in a sampled model: its next values are those of a loop written by hand."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.blockmodel import BlockModel

T = 0.1
N = 60


def model():
    v, u, c = hc.Signal("v", "m/s"), hc.Signal("u", "m/s^2"), hc.Signal("c", "1/s", start=0.5)
    period = hc.Signal("T", "s", start=T)
    steps = {"v": v.symbol + period.symbol * (u.symbol - c.symbol * v.symbol)}
    return BlockModel(hc.Block("cart", [v], [u], [v], [c, period], steps, period=T))


def simulated(plant, u):
    step = plant.to_numpy()
    x, found = np.array([s.start for s in plant.states]), []
    for k, command in enumerate(u):
        found.append(x[0])
        x = step.derivatives(k * T, x, [command])
    return np.array(found)


def by_hand(u, lag=0.0, delay=0.0, friction=0.0):
    v, late, found = 0.0, 0.0, []
    n, r = divmod(delay / T, 1.0)
    past = np.r_[np.zeros(int(n) + 1), u]
    for k in range(u.size):
        found.append(v)
        arriving = (1 - r) * past[k + 1] + r * past[k]
        pushing = late if lag else arriving
        if lag:
            late += (1 - np.exp(-T / lag)) * (arriving - late)
        v += T * (pushing - 0.5 * v - friction * v * abs(v))
    return np.array(found)


@pytest.mark.parametrize(
    ("effect", "value", "hand"),
    [
        ("u_lag", 0.25, {"lag": 0.25}),
        ("u_lag", 0.02, {"lag": 0.02}),
        ("input_delay", 0.3, {"delay": 0.3}),
        ("input_delay", 0.24, {"delay": 0.24}),
        ("v_quadratic_drag", 0.7, {"friction": 0.7}),
    ],
)
def test_an_effect_acts_as_in_a_loop_written_by_hand(effect, value, hand):
    u = np.random.default_rng(0).uniform(-1, 1, N)
    cls = model().effect_class(effect)
    plant = model().with_effects([cls(**dict.fromkeys(cls.numbers, value))]).plant()
    np.testing.assert_allclose(simulated(plant, u), by_hand(u, **hand), rtol=1e-9, atol=1e-12)


def test_modes_of_a_sampled_model_are_refused_in_one_line():
    v, mode = hc.Signal("v", "m/s"), hc.Signal("mode", modes=("idle", "run"))
    block = hc.Block("cart", [v, mode], [], [v], derivatives={"v": v.symbol, "mode": mode.symbol}, period=T)
    with pytest.raises(InputError, match="'mode' is a mode: the states of a sampled model are real numbers"):
        BlockModel(block)
