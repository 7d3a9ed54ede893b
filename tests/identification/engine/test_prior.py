"""What is held of coefficients beforehand: the model's value to itself, or to a third of all that is seen."""

import numpy as np
import pytest

from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem


def believed(model, log):
    """The prior, and its standard deviations by coefficient."""
    problem = Problem(model, gather(model, [log]), pieces=1)
    prior = prior_of(problem, model)
    return prior, dict(zip(problem.names, 1.0 / np.sqrt(prior.precision), strict=True))


def test_a_coefficient_is_known_to_its_own_size(cart_model, cart_log):
    prior, std = believed(cart_model.with_coefficients({"drag": 5.0, "gain": 10.0}), cart_log(1))
    assert std["drag"] == pytest.approx(5.0) and std["gain"] == pytest.approx(10.0)
    off = prior.centre + 0.6 * (np.array(list(std)) == "drag")
    assert prior.cost(off) == pytest.approx((0.6 / 5.0) ** 2)
    assert prior.slope(off) == pytest.approx((off - prior.centre) / 5.0**2)


def test_one_near_zero_is_known_to_a_third_of_what_would_make_all_accelerations(cart_model, cart_log):
    log = cart_log(1, drag=0.0, gain=1.7, noise=1e-4)  # all accelerations are the command's
    _, std = believed(cart_model.with_coefficients({"gain": 1e-6}), log)
    assert std["gain"] == pytest.approx(1.7 / 3.0, rel=0.3)
