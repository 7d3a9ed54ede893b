"""Logs with few events: blocks are too few to agree, and the held-out log decides."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.blocks import scatter
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.holdout import Gained, Horizons
from hovercontrol.identification.diagnose.search.searched import shown

from .machines import MACHINES, logs, right

BLOCKS = scatter(np.ones(4), np.ones(4), np.zeros(4, int))


@pytest.mark.parametrize(
    ("gain", "scatter_of_gain", "taken", "is_shown"),
    [
        (200.0, 50.0, 0.0, True),  # t = 4
        (200.0, 200.0, 0.0, False),  # t = 1, and little of the error
        (200.0, 200.0, 0.8, True),  # most of the error, in a few events
        (10.0, 1.0, 0.8, False),  # the likelihood rises too little
        (-50.0, 10.0, 0.8, False),
    ],
)
def test_what_a_held_out_log_shows(gain, scatter_of_gain, taken, is_shown):
    own = Evidence(500.0, BLOCKS, Horizons(taken=(0.1, taken)), Gained(gain, scatter_of_gain))
    assert shown(own, CRITERIA) == is_shown


def test_without_a_held_out_log_nothing_is_shown():
    assert not shown(Evidence(500.0, BLOCKS), CRITERIA)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_dead_zone_and_a_delay_of_a_motor_with_few_steps_are_named(seed):
    kind = MACHINES["motor"]()
    train, kept = logs(kind, seed)
    found = hc.diagnose(kind.model, [train], kept)
    assert right(kind, {e.effect for e in found.effects})
    assert found.verdict in ("partial", "ambiguous")  # a random load is in no catalogue


@pytest.mark.slow
def test_play_is_no_late_clock():
    """A kept time constant of 1 ms in the play was read as an offset of the clock by as much."""
    kind = MACHINES["servo"]()
    train, kept = logs(kind, 0)
    assert {e.effect for e in hc.diagnose(kind.model, [train], kept).effects} == {"target_backlash"}
