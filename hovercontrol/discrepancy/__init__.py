"""Discrepancy: where a model and measured logs disagree, which effect is missing, and the amended model."""

from hovercontrol.discrepancy.diagnose import diagnose
from hovercontrol.discrepancy.diagnosis import Diagnosis, Found

__all__ = ["Diagnosis", "Found", "diagnose"]
