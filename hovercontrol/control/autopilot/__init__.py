"""K06's autopilot with all components between the control law and the craft (section 6.1.1): the real loop.

:func:`autopilot` builds it as one hybrid Block. :class:`Imperfections` lists the imperfections that can be
switched off. :func:`seeds` gives the runs of a sweep their random numbers. :func:`beside_ideal` runs the real
and the ideal loop in parallel. :func:`error_model` is K06's model of the navigation's errors.
:func:`nearest_heading` adapts guidance to a craft that turns more than once.
"""

from hovercontrol.control.autopilot.error_model import error_model
from hovercontrol.control.autopilot.heading import nearest_heading
from hovercontrol.control.autopilot.imperfections import SWITCHES, Imperfections
from hovercontrol.control.autopilot.loop import autopilot, seeds
from hovercontrol.control.autopilot.parallel import beside_ideal

__all__ = [
    "Imperfections",
    "SWITCHES",
    "autopilot",
    "beside_ideal",
    "error_model",
    "nearest_heading",
    "seeds",
]
