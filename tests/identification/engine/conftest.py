"""Logs of simulated craft whose coefficients are known, and what a fit is made of."""

import numpy as np
import pytest

from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import estimate, first_noise
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.logs import Log
from tests.identification.identify.conftest import cart, cart_log, rudder_log

__all__ = ["cart", "cart_log", "rudder_log"]


@pytest.fixture
def fitted():
    """Return a function that fits a model to logs."""

    def fit(model, logs, *, pieces=1, **options):
        problem = Problem(model, gather(model, logs), pieces=pieces)
        return estimate(problem, prior_of(problem, model), first_noise(problem), **options)

    return fit


@pytest.fixture
def pushed_log(cart):
    """Return a function that simulates the cart (drag 0.6, gain 1.7) in pushes that no command says."""

    def make(push=0.5, lasting=0.3, seconds=20.0, noise=0.01, seed=1):
        rng, dt, parts = np.random.default_rng(seed), 0.05, 10
        t = np.arange(0.0, seconds, dt)
        force = rng.uniform(-1.0, 1.0, t.size // 12 + 1)[np.arange(t.size) // 12]
        h, p, v = dt / parts, 0.0, 0.0
        fade = np.exp(-h / lasting)
        a, seen = push * rng.normal(), []
        for k in range(t.size):
            seen.append(p)
            for _ in range(parts):
                slope = 1.7 * force[k] + a - 0.6 * v
                p, v = p + h * v + 0.5 * h**2 * slope, v + h * slope * (1.0 - 0.3 * h)
                a = fade * a + push * np.sqrt(1.0 - fade**2) * rng.normal()
        return Log("pushed", t, {"p": np.array(seen) + noise * rng.normal(size=t.size), "F": force})

    return make


@pytest.fixture
def cart_model(cart):
    return BlockModel(cart, ["input_delay"])
