"""Why a run ended, by its status: the same words whether Python or machine code ran it."""

#: In the order of hc_solver.h.
REASONS = (
    "done",
    "no memory",
    "a derivative is not a number",
    "the step becomes too small to meet the tolerance",
    "too many steps",
    "its worker failed",  # of :mod:`hovercontrol.targets.executors`
)
