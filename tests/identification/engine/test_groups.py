"""Products and sums of parameters that logs determine, from the null space of an information matrix."""

import numpy as np
import pytest

from hovercontrol.identification.engine.excitation import covariance, unexcited_directions
from hovercontrol.identification.engine.groups import groups


def found(J, values, units, last=()):
    """Return the groups for measurements with sensitivities J to absolute steps of the parameters."""
    size = np.abs(np.array(list(values.values())))
    S = J.T @ J
    C = covariance(S, size, np.ones(size.size))
    return groups(unexcited_directions(C, size), C, 0.0 * C, size, values, units, last)


def of_powers(exponents, values, std=1e-3, rows=200):
    """Return sensitivities of measurements that depend on products of powers alone."""
    p = np.array(list(values.values()))
    mix = np.random.default_rng(0).normal(size=(rows, len(exponents))) / (std * rows**0.5)
    return mix @ (np.array(exponents, dtype=float) / p)


def test_a_motor_shows_its_coefficients_over_the_inertia():
    values, units = {"k": 2.0, "b": 0.3, "J": 0.05}, {"k": "N*m/A", "b": "N*m*s", "J": "kg*m^2"}
    one, two = found(of_powers([[1, 0, -1], [0, 1, -1]], values), values, units, ["J"])
    assert (one.name, two.name) == ("k/J", "b/J") and (one.unit, two.unit) == ("1/s^2/A", "1/s")
    assert one.value == pytest.approx(40.0) and two.value == pytest.approx(6.0)
    assert one.std / one.value == pytest.approx(1e-3, rel=0.2)  # as the measurements were made
    assert one.of({"k": 1.0, "b": 1.0, "J": 4.0}) == 0.25


@pytest.mark.parametrize(
    "exponents, name", [([1, 1], "a*b"), ([2, -1], "a^2/b"), ([1, -3], "a/b^3"), ([-1, -1], "a*b")]
)
def test_exponents_are_found_as_small_integers(exponents, name):
    values = {"a": -1.7, "b": 0.02}
    (one,) = found(of_powers([exponents], values), values, {"a": "1", "b": "1"})
    assert one.name == name


def test_masses_that_move_together_are_a_sum():
    values, J = {"m1": 1.3, "m2": 0.4}, 1e3 * np.ones((4, 2))
    (one,) = found(J, values, {"m1": "kg", "m2": "kg"})
    assert (one.name, one.unit) == ("m1 + m2", "kg") and one.value == pytest.approx(1.7)
    assert one.std == pytest.approx(1e-3 / 2, rel=1e-2)  # four measurements of the sum, each with 1e-3


def test_what_no_product_or_sum_says_is_no_group():
    values = {"m": 0.5, "l": 0.4, "J": 0.05}  # of m l and J + m l^2 only the first is a product
    J = of_powers([[1, 1, 0]], values)
    slope = np.array([0.16, 2 * 0.5 * 0.4, 1.0])  # of J + m l^2
    J = np.vstack([J, np.random.default_rng(1).normal(size=(200, 1)) * 1e3 * slope])
    assert [g.name for g in found(J, values, {"m": "kg", "l": "m", "J": "kg*m^2"})] == ["m*l"]
    J = np.random.default_rng(2).normal(size=(50, 3)) * 1e3
    assert not found(J, values, {"m": "kg", "l": "m", "J": "kg*m^2"})
