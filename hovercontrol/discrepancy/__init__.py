"""Discrepancy: where a model and measured logs disagree, which effect is missing, and the amended model."""

from hovercontrol.discrepancy.diagnose import Diagnosis, Found, diagnose

__all__ = ["Diagnosis", "Found", "diagnose"]
