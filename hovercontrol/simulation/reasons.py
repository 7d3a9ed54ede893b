"""Texts of a run's status, for Python and machine code alike."""

#: In the order of hc_solver.h.
REASONS = (
    "done",
    "no memory",
    "a derivative is not a number",
    "the step size is too small to meet the tolerance",
    "too many steps",
    "its worker failed",  # of :mod:`hovercontrol.targets.executors`
)
