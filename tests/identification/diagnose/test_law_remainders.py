"""A remainder that is noise to a model, and one that is not."""

import numpy as np
import pytest

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.whiteness import random_remainder
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.logs import Log

DT, ROWS = 0.02, 1500


def gusts(rng):
    """Return an acceleration with a correlation time of 0.3 s, as process noise has it."""
    fade, found = np.exp(-DT / 0.3), np.zeros(ROWS)
    for k in range(1, ROWS):
        found[k] = fade * found[k - 1] + np.sqrt(1 - fade**2) * rng.normal()
    return found


def swings(rng):
    """Return the acceleration by a load that swings at 3 Hz."""
    return 1.4 * np.sin(2 * np.pi * 3.0 * DT * np.arange(ROWS) + rng.uniform(0, 6))


@pytest.mark.parametrize(("push", "random"), [(gusts, True), (swings, False)])
def test_gusts_are_noise_to_a_model_and_a_load_that_swings_is_not(push, random):
    """Of a mass with drag, v' = a force - d v, solved exactly from row to row."""
    v, force = Signal("v", "m/s"), Signal("force", "N")
    a, d = Signal("a", "1/kg", start=1.0), Signal("d", "1/s", start=0.5)
    rate = a.symbol * force.symbol - d.symbol * v.symbol
    model = BlockModel(Block("mass", [v], [force], [v], [a, d], {"v": rate}))
    rng = np.random.default_rng(4)
    command = np.repeat(rng.uniform(-2.0, 2.0, ROWS // 50), 50)
    pushed, true, fade = command + push(rng), np.zeros(ROWS), np.exp(-0.5 * DT)
    for k in range(1, ROWS):
        true[k] = fade * true[k - 1] + (1 - fade) / 0.5 * pushed[k - 1]
    seen = true + 2e-3 * rng.normal(size=ROWS)
    fit = base_fit(model, gather(model, [Log("run", DT * np.arange(ROWS), {"v": seen, "force": command})]))
    assert CRITERIA.left(fit).any()
    assert random_remainder(fit, CRITERIA.level) == random
