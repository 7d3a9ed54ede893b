"""The magnetometer's heading against K06 (3.43)-(3.44) written by hand, and what iron and steel do to it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.sensors import k06_magnetometer, magnetic_heading, magnetometer

FIELD = 2.1e-5
angles = st.floats(-3.1, 3.1)


def tick(sensor, psi, **params):
    sensor = sensor if isinstance(sensor, Ticking) else Ticking(sensor)
    sensor.set_parameters({f"magnetometer.{key}": value for key, value in params.items()})
    return sensor.tick(0.0, {"psi": psi})


COMPASS = Ticking(magnetometer())
KNOWING = magnetic_heading().to_numpy()


@given(angles, st.floats(-3.1, 3.1))
def test_heading_is_3_43_with_the_sign_of_3_44(psi, direction):
    known = (FIELD * math.cos(direction), FIELD * math.sin(direction))
    told = tick(COMPASS, psi, field_x=known[0], field_y=known[1])
    B = np.array([told["magnetic_x"], told["magnetic_y"]])
    ub, uB = np.array(known) / np.linalg.norm(known), B / np.linalg.norm(B)
    size = abs(math.acos(max(-1.0, min(1.0, uB @ ub))))
    cross = uB[0] * ub[1] - uB[1] * ub[0]
    assert told["heading_magnetic"] == pytest.approx(math.copysign(size, cross), abs=1e-6)
    assert told["heading_magnetic"] == pytest.approx(psi, abs=1e-12)
    field = {f"magnetic_heading.field_{axis}": value for axis, value in zip("xy", known, strict=True)}
    alone = KNOWING.outputs(0.0, (), B, field)[0]
    assert alone == told["heading_magnetic"]


def test_heading_wraps_and_knows_backwards():
    assert abs(tick(magnetometer(), math.pi)["heading_magnetic"]) == pytest.approx(math.pi)
    assert tick(magnetometer(), 7.0)["heading_magnetic"] == pytest.approx(7.0 - 2 * math.pi)


@pytest.mark.parametrize(
    ("error", "harmonic"),
    [
        ({"hard_iron": (0.05 * FIELD, 0.02 * FIELD)}, 1),
        ({"disturbance": (0.0, 0.05 * FIELD)}, 0),
        ({"soft_iron": (0.05, -0.05, 0.02)}, 2),
    ],
)
def test_iron_errs_with_its_own_harmonic_of_the_heading(error, harmonic):
    """What compass adjusters know: hard iron errs once a turn, soft iron twice, the place always the same."""
    psi = np.linspace(0, 2 * math.pi, 72, endpoint=False)
    block = Ticking(magnetometer(**error))
    told = np.array([tick(block, p)["heading_magnetic"] for p in psi])
    wrong = np.angle(np.exp(1j * (told - psi)))
    spectrum = np.abs(np.fft.rfft(wrong)) / len(psi)
    assert int(np.argmax(spectrum)) == harmonic
    assert np.abs(wrong).max() == pytest.approx(0.05, abs=0.008)  # about what is added to the field


def test_k06s_noise_gives_the_variance_that_its_filter_expects():
    n = 3000
    sensor = Ticking(k06_magnetometer())
    told = np.array([sensor.tick(0.0, {"psi": 0.7})["heading_magnetic"] for _ in range(n)])
    assert np.var(told) == pytest.approx(1.6e-4, rel=5 * math.sqrt(2 / n))
    assert told.mean() == pytest.approx(0.7, abs=5 * math.sqrt(1.6e-4 / n))


@pytest.mark.parametrize(
    ("make", "wrong", "said"),
    [
        (magnetometer, {"field": (0.0, 0.0)}, "it has no direction"),
        (magnetic_heading, {"field": (0.0, 0.0)}, "it has no direction"),
        (magnetometer, {"noise": -1.0}, "must not be negative"),
        (magnetometer, {"period": 0.0}, "must be positive"),
        (magnetometer, {"hard_iron": 1.0}, "hard_iron: expected a sequence, each a number"),
        (magnetometer, {"soft_iron": (1.0, 2.0)}, "expected three numbers"),
    ],
)
def test_wrong_numbers_are_refused(make, wrong, said):
    with pytest.raises(InputError, match=said):
        make(**wrong)
