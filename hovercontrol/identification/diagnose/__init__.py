"""Discrepancy: where a model and measured logs disagree, which effect is missing, and the amended model."""

from hovercontrol.identification.diagnose.diagnose import diagnose
from hovercontrol.identification.diagnose.diagnosis import Diagnosis, Found

__all__ = ["Diagnosis", "Found", "diagnose"]
