"""Identification of a model's coefficients from logs, and how well the model then predicts them."""

from hovercontrol.identify.fit import identify
from hovercontrol.identify.measure import Measured, measure
from hovercontrol.identify.plot import plot_free_run
from hovercontrol.identify.predict import FreeRun, Prediction, free_run, window_prediction
from hovercontrol.identify.result import Fitted, Identified

__all__ = [
    "identify", "Identified", "Fitted",
    "measure", "Measured",
    "free_run", "FreeRun", "window_prediction", "Prediction",
    "plot_free_run",
]  # fmt: skip
