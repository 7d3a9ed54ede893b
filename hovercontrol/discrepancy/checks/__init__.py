"""What logs and a first fit must satisfy before a diagnosis."""

from hovercontrol.discrepancy.checks.excitation import check_fitted
from hovercontrol.discrepancy.checks.logs import check_logs

__all__ = ["check_fitted", "check_logs"]
