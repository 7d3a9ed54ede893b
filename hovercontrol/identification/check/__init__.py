"""Quality checks of a log before a fit: timing, noise, outliers, units, excitation."""

from hovercontrol.identification.check.check import Checked, check
from hovercontrol.identification.check.facts import Column, LogFacts, Timing, facts

__all__ = ["check", "Checked", "facts", "LogFacts", "Timing", "Column"]
