"""Estimators of coefficients, for any Block that is linear in them (C17 section III)."""

from hovercontrol.estimators.history import CoefficientHistory, estimate_from_log
from hovercontrol.estimators.kalman_bucy import kalman_bucy
from hovercontrol.estimators.regression import Regression, regression
from hovercontrol.estimators.regressors import Regressors
from hovercontrol.estimators.sampled import SampledEstimator
from hovercontrol.estimators.ticking import sampled_estimator

__all__ = [
    "Regression", "regression", "Regressors",
    "kalman_bucy", "sampled_estimator", "SampledEstimator", "estimate_from_log", "CoefficientHistory",
]  # fmt: skip
