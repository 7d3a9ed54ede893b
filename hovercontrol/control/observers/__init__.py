"""Estimators of coefficients (C17 section III) and state observers for any Block."""

from hovercontrol.control.observers.disturbance import disturbance_observer, with_disturbances
from hovercontrol.control.observers.extended import extended_kalman
from hovercontrol.control.observers.kalman_bucy import kalman_bucy
from hovercontrol.control.observers.observability import Observability, observability
from hovercontrol.control.observers.regression import Regression, regression
from hovercontrol.control.observers.regressors import regressors_along
from hovercontrol.control.observers.ticking import sampled_estimator
from hovercontrol.control.observers.unscented import unscented_kalman

__all__ = [
    "Regression", "regression", "regressors_along",
    "kalman_bucy", "sampled_estimator",
    "extended_kalman", "unscented_kalman",
    "disturbance_observer", "with_disturbances", "observability", "Observability",
]  # fmt: skip
