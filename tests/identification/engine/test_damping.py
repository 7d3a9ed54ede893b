"""Damping: steps that undo each other come to rest, steps that creep get there, good ones stay."""

import numpy as np
import pytest

from hovercontrol.identification.engine.damping import LEAST, Damping, Relaxation


def ends(damping, propose, x, times):
    """Return where an iteration ends, and how far it went in each step."""
    went = []
    for _ in range(times):
        taken = damping.taken(propose(x))
        x = x + taken
        went.append(taken)
    return x, np.array(went)


@pytest.mark.parametrize("rate", [-2.5, -1.0, -0.7, 0.0, 0.3])
def test_a_linear_iteration_ends_in_three_steps(rate):
    x, _ = ends(Damping(most=2.5), lambda x: (rate - 1.0) * (x - 3.0), np.array([0.0]), 3)
    assert x == pytest.approx(3.0, abs=1e-9)


def test_each_element_has_a_damping_of_its_own():
    rate = np.array([-1.0, 0.0])
    x, went = ends(Damping(), lambda x: (rate - 1.0) * (x - 1.0), np.zeros(2), 2)
    assert np.allclose(x, 1.0) and np.allclose(went[1], [-1.0, 0.0])


def test_where_no_more_than_a_whole_step_is_wanted_creeping_steps_stay():
    _, went = ends(Damping(), lambda x: -0.5 * x, np.array([1.0]), 3)
    assert np.allclose(went[:, 0], [-0.5, -0.25, -0.125])


def test_a_step_of_another_shape_begins_anew():
    damping = Damping()
    damping.taken(np.array([1.0]))
    assert np.array_equal(damping.taken(np.array([-1.0, 1.0])), [-1.0, 1.0])


@pytest.mark.parametrize("rate", [-2.5, -1.0, -0.7, 0.0])
def test_a_whole_step_that_goes_to_and_fro_is_relaxed(rate):
    relaxation, x = Relaxation(), np.array([0.0, 5.0])
    for _ in range(3):
        step = (rate - 1.0) * (x - np.array([3.0, -1.0]))
        x = x + relaxation.of(step) * step
    assert x == pytest.approx([3.0, -1.0], abs=1e-9)


def test_a_relaxed_step_keeps_its_direction_and_is_never_lengthened():
    relaxation = Relaxation()
    parts = [relaxation.of(np.array(step)) for step in ([1.0, 0.0], [0.9, 0.1], [-8.0, 0.0], [-9.0, 0.0])]
    assert parts == [1.0, 1.0, LEAST, 1.0]
