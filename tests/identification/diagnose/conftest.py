"""Diagnoses that several files of tests look at: one of each verdict, of short logs."""

from typing import NamedTuple

import pytest

from hovercontrol.identification.diagnose import Diagnosis, diagnose

from .generator import Case, Conditions, make, outside


class Diagnosed(NamedTuple):
    case: Case
    found: Diagnosis


def diagnosed(case: Case, names: list[str]) -> Diagnosed:
    return Diagnosed(case, diagnose(case.model, case.logs, case.holdout, names=names))


@pytest.fixture(scope="session")
def sloping() -> Diagnosed:
    """A craft on a slope that its model does not have."""
    case = make(11, ["slope"], Conditions(duration=20.0, logs=1))
    return diagnosed(case, ["slope", "wind", "thrust_lag"])


@pytest.fixture(scope="session")
def gusty() -> Diagnosed:
    """The same in gusts, which no effect explains."""
    case = make(11, ["slope"], Conditions(duration=20.0, gusts=True))
    return diagnosed(case, ["slope", "yaw_quadratic_drag"])


@pytest.fixture(scope="session")
def complete() -> Diagnosed:
    """A craft whose model lacks nothing."""
    return diagnosed(make(40, (), Conditions(duration=12.0, logs=1)), ["slope", "gyro_bias"])


@pytest.fixture(scope="session")
def windy() -> Diagnosed:
    """A craft in a wind that a short log cannot tell from a slope."""
    return diagnosed(make(11009, ["wind"], Conditions(duration=10.0, logs=1)), ["wind", "slope"])


@pytest.fixture(scope="session")
def late() -> Diagnosed:
    """A craft whose commands arrive late, which looks like a clock that is."""
    case = make(16, ["input_delay"], Conditions(duration=12.0, logs=1))
    return diagnosed(case, ["input_delay", "time_offset"])


@pytest.fixture(scope="session")
def patched() -> Diagnosed:
    """A craft on a floor with rough stripes, which is no effect of the catalogue."""
    case = outside(3, "patch", Conditions(duration=20.0, logs=1))
    return diagnosed(case, ["slope", "yaw_quadratic_drag", "surge_quadratic_drag"])


@pytest.fixture(scope="session")
def every(sloping, gusty, complete, windy, late, patched) -> dict[str, Diagnosed]:
    """One diagnosis of each kind."""
    return {
        "effect": sloping,
        "partial": gusty,
        "none": complete,
        "ambiguous": windy,
        "two readings": late,
        "unexplained": patched,
    }
