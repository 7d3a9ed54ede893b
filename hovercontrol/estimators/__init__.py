"""Estimators of coefficients, for any Block that is linear in them (C17 section III)."""

from hovercontrol.estimators.kalman_bucy import kalman_bucy
from hovercontrol.estimators.regression import Regression, regression

__all__ = ["Regression", "kalman_bucy", "regression"]
