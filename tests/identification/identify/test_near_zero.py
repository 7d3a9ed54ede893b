"""Coefficients that are nearly zero, and logs of unlike noise: intervals hold the truth, and are no wider."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log

CRAFT = hc.vehicle("c17_simulation")
SMALL = {"surge_linear_drag": 0.02, "yaw_coulomb": 0.02}


def with_small(part):
    """The craft with `part` of two drags that are nearly zero."""
    own = [hc.effect(name, part * value) for name, value in SMALL.items()]
    return CRAFT.without_effects(list(SMALL)).with_effects(own)


TRUTH, GIVEN = with_small(1.0), with_small(0.1)  # ten times too small: 30 % of it is no width for a prior
PLANT = TRUTH.plant().compile()


def log(rng, noise):
    t = np.arange(0.0, 20.0, 0.05)
    commands = [np.repeat(rng.uniform(*span, 20), 20) for span in ((1, 4), (-0.4, 0.4))]
    run = PLANT.simulate(t, commands)
    seen = {
        k: y + noise * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs, strict=True)
    }
    return Log(f"noise {noise:g}", t, seen | dict(zip(("thrust", "rudder"), commands, strict=True)))


@pytest.mark.slow
def test_intervals_hold_the_truth_near_zero():
    inside = {name: 0 for name in TRUTH.linear_coefficients()}
    for seed in range(20):
        rng = np.random.default_rng(100 + seed)
        found = identify(GIVEN, [log(rng, 2e-3)])
        for name in inside:
            inside[name] += abs(found[name].value - TRUTH.coefficients()[name]) < 1.96 * found[name].std
    assert min(inside.values()) >= 16, inside  # of 20; fewer has a chance of 0.3 %
    assert sum(inside.values()) >= 0.9 * 20 * len(inside), inside


@pytest.mark.slow
def test_each_log_counts_by_its_own_noise():
    rng = np.random.default_rng(3)
    quiet, loud = log(rng, 1e-3), log(rng, 2e-2)
    alone, both = identify(GIVEN, [quiet]), identify(GIVEN, [quiet, loud])
    for name, value in TRUTH.coefficients().items():
        if name in TRUTH.linear_coefficients():
            assert both[name].std < 3.0 * alone[name].std, name  # by one noise it would be ten times as large
            assert abs(both[name].value - value) < 4.0 * both[name].std, name
