"""Identification of a model's coefficients from logs, and validation of the model's predictions."""

from hovercontrol.identification.engine.measure import Measured, measure
from hovercontrol.identification.identify.display import plot_free_run
from hovercontrol.identification.identify.fit import identify
from hovercontrol.identification.identify.predict import FreeRun, Prediction, free_run, window_prediction
from hovercontrol.identification.identify.result import Fitted, Identified, Remaining

__all__ = [
    "identify", "Identified", "Fitted", "Remaining",
    "measure", "Measured",
    "free_run", "FreeRun", "window_prediction", "Prediction",
    "plot_free_run",
]  # fmt: skip
