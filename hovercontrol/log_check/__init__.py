"""Quality checks of a log before a fit: timing, noise, outliers, units, excitation."""

from hovercontrol.log_check.check import Checked, check
from hovercontrol.log_check.facts import Column, LogFacts, Timing, facts

__all__ = ["check", "Checked", "facts", "LogFacts", "Timing", "Column"]
