"""Identification of a model's coefficients from logs, and how well the model then predicts them."""

from hovercontrol.identify.fit import identify
from hovercontrol.identify.measure import Measured, measure
from hovercontrol.identify.result import Fitted, Identified

__all__ = ["identify", "Identified", "Fitted", "measure", "Measured"]
