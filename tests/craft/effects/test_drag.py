"""Drag acts against the motion, in its own axis and in no other."""

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.model import Model

AXES = {"surge": 3, "sway": 4, "yaw": 5}


def added(name, value, state):
    with_it = Model("one", [effect(name, value)]).plant().to_numpy().derivatives(0.0, state)
    return with_it - Model("none").plant().to_numpy().derivatives(0.0, state)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_coulomb_friction_has_constant_size_and_opposes_the_motion(axis, sign):
    for speed in (0.5, 3.0):
        state = np.full(6, 0.7)
        state[AXES[axis]] = sign * speed
        force = added(f"{axis}_coulomb", 1.35, state)
        assert force[AXES[axis]] == pytest.approx(-sign * 1.35)
        assert np.count_nonzero(np.abs(force) > 1e-15) == 1


@pytest.mark.parametrize("axis", AXES)
def test_linear_drag_is_proportional_and_opposes_the_motion(axis):
    state = np.full(6, 0.7)
    state[AXES[axis]] = -2.0
    force = added(f"{axis}_linear_drag", 1.2, state)
    assert force[AXES[axis]] == pytest.approx(2.4)
    assert np.count_nonzero(np.abs(force) > 1e-15) == 1
