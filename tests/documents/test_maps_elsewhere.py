"""Maps that are simulated on an executor, or resumed from a folder, are those of one machine to the bit."""

from concurrent.futures import Executor, ThreadPoolExecutor

import pytest

from hovercontrol.documents.c17.gain_region import gain_region
from hovercontrol.documents.c17.interconnection import region_of_attraction
from hovercontrol.documents.c17.zero_dynamics import arm_region
from hovercontrol.documents.k06.law_regions import forward_region, reverse_region
from hovercontrol.documents.k06.turn_basins import turn_basins

MAPS = {
    "gains": (gain_region, {"points": 5}),
    "arms": (arm_region, {"points": 5, "duration": 10.0}),
    "attraction": (region_of_attraction, {"cells": 2, "runs": 5, "duration": 8.0}),
    "forward": (forward_region, {"points": 4, "duration": 20.0}),
    "reverse": (reverse_region, {"points": 4, "duration": 20.0}),
    "basins": (turn_basins, {"points": 6}),
}


class Refuses(Executor):
    """Has nothing to do when all is done."""

    def submit(self, *args, **kwargs):
        raise AssertionError("a run was done twice")


def assert_same(one, other):
    pairs = zip(one, other, strict=True) if isinstance(one, tuple) else [(one, other)]
    for a, b in pairs:
        assert {name: v.tobytes() for name, v in a.maps.items()} == {
            n: v.tobytes() for n, v in b.maps.items()
        }


@pytest.mark.slow("arms", "reverse", "gains")
@pytest.mark.parametrize("name", MAPS)
def test_a_map_on_an_executor_has_the_bits_of_one_machine_and_resumes(name, tmp_path):
    region, small = MAPS[name]
    with ThreadPoolExecutor(2) as threads:
        elsewhere = region(**small, executor=threads, checkpoint=tmp_path)
    assert_same(elsewhere, region(**small))
    assert_same(elsewhere, region(**small, executor=Refuses(), checkpoint=tmp_path))
