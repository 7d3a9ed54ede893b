"""Linear systems of python-control as Blocks: their frequency responses, parameters, units and names."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError

OMEGA = np.geomspace(0.01, 3.0, 9)


def response(system):
    points = np.exp(1j * OMEGA * system.dt) if system.dt else 1j * OMEGA
    return np.array([np.atleast_2d(system(s)) for s in points])


def random_system(seed, dt):
    rng = np.random.default_rng(seed)
    A, B, C, D = (rng.normal(size=shape) for shape in ((4, 4), (4, 2), (3, 4), (3, 2)))
    A[1, 2], B[0, 0], C[2, 1] = 1.0, 1.0, 0.0
    return ct.ss(A, B, C, D, dt)


@pytest.mark.parametrize(
    "system",
    [
        random_system(1, 0),
        random_system(2, 0.2),
        ct.tf([3.0, 1.0, 2.0], [2.0, 0.5, 4.0]),
        ct.tf([0.3, 0.1], [1.0, -1.2, 0.9], 0.1),
        ct.tf(
            [[[1.0], [1.0, 2.0]], [[3.0, 1.0], [0.0]]], [[[1.0, 1.0], [1.0, 2.0, 1.0]], [[1.0, 1.0], [2.0]]]
        ),
        ct.tf([4.0], [2.0]),
    ],
    ids=["ss", "discrete ss", "tf", "discrete tf", "mimo tf", "gain"],
)
def test_the_round_trip_keeps_the_frequency_response(system):
    block = hc.from_control(system)
    again = block.to_control().linearize(np.zeros(len(block.states)))
    assert block.period == (system.dt or 0.0)
    assert response(again) == pytest.approx(response(system), abs=1e-12, rel=1e-12)


def test_a_transfer_function_has_its_coefficients_as_parameters_even_those_that_are_one():
    block = hc.from_control(ct.tf([1.0, 0.5], [1.0, -1.0, 0.25], 0.1, name="filter"))
    assert block.default_parameters == {
        "filter.A[0,0]": 1.0, "filter.A[0,1]": -0.25, "filter.C[0,0]": 1.0, "filter.C[0,1]": 0.5,
    }  # fmt: skip
    assert block.linearize(np.zeros(2), params={"filter.C[0,1]": 0.7})(1.0) == pytest.approx(1.7 / 0.25)


def test_labels_become_names_and_units_follow():
    system = ct.ss(
        [[0, 1], [-2, -3]], [[0], [0.5]], [[1, 0], [0, 2]], 0,
        states=["pos", "F"], inputs=["F"], outputs=["pos", "speed"], name="cart",
    )  # fmt: skip
    block = hc.from_control(system, units={"pos": "m", "F": "N", "speed": "m/s"})
    assert (block.name, [s.name for s in block.states]) == ("cart", ["pos", "x_F"])
    assert block.equations().splitlines()[0] == "pos' = x_F"
    assert {s.name: s.unit for s in block.parameters} == {
        "A[1,0]": "1/s^2", "A[1,1]": "1/s", "B[1,0]": "1/kg", "C[1,1]": "1",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (ct.tf([1, 2, 3], [1, 1]), "improper: its numerator has degree 2, its denominator 1"),
        (ct.ss([[0.5]], [[1]], [[1]], 0, True), "the step of the system is unknown"),
        (ct.nlsys(lambda t, x, u, p: -x, None, inputs=1, outputs=1, states=1), "control.linearize"),
        (ct.ss([[np.inf]], [[1]], [[1]], 0), "finite coefficients"),
        (ct.ss([[1]], [[1]], [[1]], 0, states=["a b"]), "'a b' is not a valid signal name"),
        (2.0, "expected a StateSpace or TransferFunction, found float"),
    ],
)  # fmt: skip
def test_other_systems_are_refused_in_one_line(given, text):
    with pytest.raises(InputError) as caught:
        hc.from_control(given)
    assert text in str(caught.value) and "\n" not in str(caught.value)
