"""Levels of noise: each step makes the logs likelier, and they come back."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.identification.engine.damping import Damping
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import first_noise
from hovercontrol.identification.engine.kalman import run_filter, run_smoother
from hovercontrol.identification.engine.noise import ONWARD, Noise, augment, averaged, moved, timed
from hovercontrol.identification.engine.problem import Problem


def cost(problem, linear, noise):
    return run_filter(augment(problem, linear, noise, unknowns=False)).cost


@pytest.fixture
def pushed(cart_model, pushed_log):
    """Return a function for the cart in pushes with its true coefficients.

    It is linear, so the path does not matter.
    """

    def make(**how):
        model = cart_model.with_coefficients({"drag": 0.6, "gain": 1.7})
        problem = Problem(model, gather(model, [pushed_log(seconds=60.0, **how)]))
        return problem, problem.linearise(problem.guess.copy(), problem.start, unknowns=False)

    return make


@pytest.fixture
def linearised(pushed):
    return pushed()


def test_each_move_raises_the_likelihood_until_the_truth_comes_back(linearised):
    problem, linear = linearised
    noise = replace(first_noise(problem), seconds=np.array([0.3]))
    noise = replace(noise, measured=3.0 * noise.measured)
    costs, damping = [], Damping(most=ONWARD)
    for _ in range(12):
        system = augment(problem, linear, noise, unknowns=False)
        filtered = run_filter(system)
        costs.append(filtered.cost)
        noise = moved(
            problem, noise, system, run_smoother(system, filtered, np.ones(1)), np.empty(0), damping
        )
    assert np.all(np.diff(costs[:4]) < 0.0) and costs[-1] == pytest.approx(min(costs), abs=0.01)
    assert noise.measured[0] == pytest.approx(0.01, rel=0.1)
    assert noise.process[0] == pytest.approx(0.5, rel=0.3)
    for size in (0.95, 1.05):  # nothing beside it is likelier
        assert cost(problem, linear, replace(noise, process=size * noise.process)) > costs[-1]
        assert cost(problem, linear, replace(noise, measured=size * noise.measured)) > costs[-1]


@pytest.mark.parametrize(("seconds", "truth"), [(0.06, 0.4), (0.6, 0.1)])
def test_another_correlation_time_is_taken_where_it_is_likelier(pushed, seconds, truth):
    problem, linear = pushed(lasting=truth, push=1.0)
    noise = Noise(np.array([0.01]), np.ones((1, 1)), np.array([1.0]), np.array([seconds]), ("v",))
    found, further = timed(problem, linear, noise, 2.0)
    assert further and abs(np.log(found.seconds[0] / truth)) < abs(np.log(seconds / truth))
    assert cost(problem, linear, found) < cost(problem, linear, noise)


def test_no_correlation_time_is_sought_where_nothing_is_missing(linearised):
    problem, linear = linearised
    none = Noise(np.array([0.01]), np.ones((1, 1)), np.zeros(1), np.array([0.3]), ("v",))
    assert timed(problem, linear, none, 2.0) == (none, False)


def test_the_mean_of_a_missing_acceleration_is_smaller_the_longer_it_is_taken():
    noise = Noise(np.ones(1), np.ones((1, 1)), np.array([2.0, 2.0]), np.array([0.1, 1e4]), ("u", "v"))
    short, long = averaged(noise, 0.4)
    s = np.linspace(0.0, 0.4, 801)
    dense = np.exp(-np.abs(s[:, None] - s) / 0.1).mean()
    assert short == pytest.approx(2.0 * np.sqrt(dense), rel=5e-3)
    assert long == pytest.approx(2.0, rel=1e-4)
