"""Estimators of coefficients (C17 section III) and state observers for any Block."""

from hovercontrol.estimators.disturbance import disturbance_observer, with_disturbances
from hovercontrol.estimators.extended import extended_kalman
from hovercontrol.estimators.history import CoefficientHistory, estimate_from_log
from hovercontrol.estimators.kalman_bucy import kalman_bucy
from hovercontrol.estimators.observability import Observability, observability
from hovercontrol.estimators.regression import Regression, regression
from hovercontrol.estimators.regressors import Regressors
from hovercontrol.estimators.sampled import SampledEstimator
from hovercontrol.estimators.ticking import sampled_estimator
from hovercontrol.estimators.unscented import unscented_kalman

__all__ = [
    "Regression", "regression", "Regressors",
    "kalman_bucy", "sampled_estimator", "SampledEstimator", "estimate_from_log", "CoefficientHistory",
    "extended_kalman", "unscented_kalman",
    "disturbance_observer", "with_disturbances", "observability", "Observability",
]  # fmt: skip
