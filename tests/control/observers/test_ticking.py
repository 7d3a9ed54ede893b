"""The sampled estimator as a Block: the filter that SampledEstimator steps, switched on when it is told."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.hybrid import Ticking
from hovercontrol.control.observers import SampledEstimator, sampled_estimator
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation

TUNING = {"R": [0.1, 0.2, 0.01], "Q": np.linspace(0.1, 0.3, 11), "P0": np.linspace(1.0, 2.0, 11)}


def _random_run(estimator, ticks, until):
    """The Block's estimates on random signals, and the commands that held before each sample."""
    rng = np.random.default_rng(4)
    held, rows = np.zeros(2), []
    for k in range(until):
        motion, commands = rng.normal(size=3), rng.normal(size=2)
        signals = dict(zip(("u", "v", "r", "thrust", "rudder"), (*motion, *commands), strict=True))
        told = ticks.tick(0.01 * k, signals)
        rows.append((list(told.values()), motion, held))
        held = commands
    return rows


def test_it_is_the_filter_that_is_stepped_by_hand():
    plant = c17_experiment().plant()
    step = SampledEstimator(plant, dt=0.01, **TUNING)
    ticks = Ticking(sampled_estimator(plant, **TUNING))
    for k, (told, motion, held) in enumerate(_random_run(step, ticks, 120)):
        np.testing.assert_allclose(told, step.step(0.01 * k, motion, held), rtol=0, atol=1e-11)
    states = dict(zip((s.name for s in ticks.block.states), ticks.state, strict=True))
    P = np.array([[states[f"last_P[{min(i, j)},{max(i, j)}]"] for j in range(11)] for i in range(11)])
    np.testing.assert_allclose(P, step.covariance, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_before_its_start_nothing_changes_and_then_it_begins_as_at_zero():
    plant = c17_experiment().plant()
    step = SampledEstimator(plant, dt=0.01, **TUNING)
    ticks = Ticking(sampled_estimator(plant, start=0.5, **TUNING))
    prior = [p.start for p in plant.parameters if p.name.rpartition(".")[2] in step.names]
    for k, (told, motion, held) in enumerate(_random_run(step, ticks, 80)):
        wanted = prior if k < 50 else step.step(0.01 * k, motion, held)
        np.testing.assert_allclose(told, wanted, rtol=0, atol=1e-11)


def test_what_is_not_estimated_stays_a_parameter():
    drag = [n for n in c17_simulation().coefficients() if n.endswith(("coulomb", "drag"))]
    block = sampled_estimator(c17_simulation().plant(), drag)
    assert [s.name for s in block.outputs] == [f"{n}_hat" for n in drag]
    assert {"estimator.thrust", "estimator.rudder_torque"} <= set(block.default_parameters)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"period": 0.0}, "period must be positive"),
        ({"start": float("inf")}, "start must be finite"),
        ({"R": 0.0}, "R must be finite and positive"),
        ({"estimate": ["thrst"]}, "did you mean 'thrust'"),
    ],
)
def test_wrong_values_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        sampled_estimator(c17_simulation().plant(), **given)
