"""Checks of the logs and of a first fit before a diagnosis."""

from hovercontrol.identification.diagnose.checks.excitation import check_fitted
from hovercontrol.identification.diagnose.checks.logs import as_logs, check_logs
from hovercontrol.identification.diagnose.checks.timing import slow_rows

__all__ = ["as_logs", "check_fitted", "check_logs", "slow_rows"]
