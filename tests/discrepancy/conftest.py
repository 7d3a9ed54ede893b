"""One diagnosis that several files of tests look at."""

from typing import NamedTuple

import pytest

from hovercontrol.discrepancy import Diagnosis, diagnose

from .generator import Case, Conditions, make


class Diagnosed(NamedTuple):
    case: Case
    found: Diagnosis


@pytest.fixture(scope="session")
def sloping() -> Diagnosed:
    """A craft on a slope that its model does not have."""
    case = make(11, ["slope"], Conditions(duration=20.0, logs=1))
    return Diagnosed(
        case, diagnose(case.model, case.logs, case.holdout, names=["slope", "wind", "thrust_lag"])
    )
