"""An importer that makes random calls in any order that FMI permits arrives where the equations do."""

import pytest

from tests.fmi.adversary import sled, worst


@pytest.mark.parametrize("version", [2, 3])
def test_every_permitted_order_of_calls_ends_in_the_same_trajectory(version, tmp_path):
    path = sled().to_fmu(tmp_path / "sled.fmu", version=version, friction="events")
    most, choices = worst(path, range(12))
    assert most < 1e-9
    assert choices > 2000
