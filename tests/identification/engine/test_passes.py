"""A Newton step of the unknowns."""

from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.identification.engine.passes import newton
from hovercontrol.identification.engine.prior import Prior


def test_an_unknown_of_which_the_logs_tell_nothing_does_not_move():
    """The information on the second one is a rounding error; steps of 1e133 had led to diverging models."""
    none = np.zeros(2, bool)
    problem = SimpleNamespace(
        inside=lambda p: p, outside=lambda z: z, held=lambda p, slope: none, log_scale=none
    )
    S, g = np.diag([4.0, 1e-266])[None], np.array([[8.0, 1e-133]])
    step, predicted = newton(problem, Prior(*np.zeros((3, 2))), np.zeros(2), S, g)
    assert step == pytest.approx([2.0, 0.0]) and predicted == pytest.approx(16.0)
