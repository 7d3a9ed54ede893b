"""A linearised problem is the slope of what it computes."""

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from tests.identification.diagnose.generator import Conditions, make

EFFECTS = (
    effect("thrust_lag", seconds=0.1),
    effect("input_delay", seconds=0.03),
    effect("rudder_backlash", width=0.1),
    effect("gyro_scale", value=0.05),
    effect("sensor_lever_arm", value=0.1),
    effect("lugre_yaw", stiffness=100.0, damping=10.0, coulomb=0.3, static=0.5, speed=0.1),
)


@pytest.mark.parametrize("e", EFFECTS, ids=lambda e: e.name)
def test_slopes_are_those_of_the_rows_ahead_and_of_the_channels(fitted, e):
    case = make(5, [], Conditions(duration=8.0, logs=1))
    widths = {k: 0.2 for k in case.truth.coefficients() if k.endswith("_width")}
    model = case.truth.with_coefficients(widths).with_effects([e])
    fit = fitted(model, case.logs, pieces=8, frozen=True, levels=False)
    problem, x = fit.problem, fit.path
    p = np.where(problem.log_scale, 0.9, 1.0) * fit.p  # not at a bound
    linear = problem.linearise(x, p)
    moving = problem.dt > 0

    def compare(state, channels, there, step):
        (ahead, seen), (behind, shown) = there
        difference = (ahead - behind)[moving] / (2.0 * step)
        close(state[moving], difference)
        close(channels, np.where(problem.seen, (seen - shown) / (2.0 * step), 0.0))

    def computed(path, unknowns):
        return problem.advance(path, unknowns, jacobian=False)[0], problem.observe(path, unknowns)[0]

    for j, i in enumerate(problem.free):
        step = 1e-6 * problem.block.states[i].nominal
        push = step * (np.arange(x.shape[-1]) == i)
        compare(linear.A[..., j], linear.H[..., j], [computed(x + s * push, p) for s in (1, -1)], step)
    z = problem.inside(p)
    for j in range(len(p)):
        step = 1e-5 * max(abs(z[j]), 0.1)
        push = step * (np.arange(len(p)) == j)
        there = [computed(x, problem.outside(z + s * push)) for s in (1, -1)]
        compare(linear.B[..., j], linear.D[..., j], there, step)


def close(ours, theirs):
    """Nearly all alike: one-sided differences of commands that jump, and kinks, are not."""
    scale = max(float(np.abs(theirs).max()), 1e-3)
    off = np.abs(ours - theirs) > 1e-3 * scale
    assert off.mean() < 0.02


def test_bristles_begin_where_they_follow_the_motion(fitted):
    """Not seen, they are no unknown that may be anywhere: from zero a fit of six LuGre cases lost its way."""
    case = make(5, [], Conditions(duration=8.0, logs=1, noise=0.0))
    model = case.truth.with_effects([EFFECTS[-1]])
    problem = fitted(model, case.logs, pieces=16, frozen=True, levels=False).problem
    (z,) = problem.bristles
    r = [s.name for s in problem.block.states].index("r")
    path = problem.with_bristles(problem.guess, problem.start)[..., z]
    sliding = np.abs(problem.guess[..., r]) > 0.6  # there they have the length that holds their force
    level = 0.3 / 100.0 * np.sign(problem.guess[..., r])
    sliding[:8] = False  # from rest
    assert sliding.sum() >= 20
    assert np.median(np.abs(path - level)[sliding]) < 2e-5
    start = problem.linearise(problem.with_bristles(problem.guess, problem.start), problem.start).start
    assert start[problem.free.index(z)] == pytest.approx(path.std(), rel=1e-6)


@pytest.mark.parametrize(("dt", "pieces"), [(0.02, 16), (0.1, 64)])
def test_bristles_bear_the_sub_steps_that_they_get(fitted, dt, pieces):
    """They slide at rates of thousands in a second: steps of ten milliseconds throw them off."""
    case = make(5, [], Conditions(duration=8.0, logs=1, dt=dt))
    fit = fitted(case.truth.with_effects([EFFECTS[-1]]), case.logs, frozen=True, levels=False)
    assert pieces <= fit.problem.pieces <= pieces + 1
    (z,) = fit.problem.bristles
    assert np.abs(fit.path[..., z]).max() < 3 * 0.5 / 100.0  # thrown off they go beyond any bound
