"""What a log is worth before anything is fitted to it: timing, noise, outliers, units, what it excites."""

from hovercontrol.log_check.check import Checked, check
from hovercontrol.log_check.facts import Column, LogFacts, Timing, facts

__all__ = ["check", "Checked", "facts", "LogFacts", "Timing", "Column"]
