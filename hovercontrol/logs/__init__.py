"""Files to Logs: reading and joining them, and velocities from tracked positions.

May import ``blocks`` and ``base``. Begin with ``log.py`` and ``read.py``; each format is one file in
``readers/``.

A log with the pose is processed in this order::

    read_log -> join_logs (if commands are in a separate file) -> BenchTable.apply -> smooth_pose

A log with ``u, v, r`` needs only the first step.
"""

from hovercontrol.logs.bench import BenchTable
from hovercontrol.logs.clock import Clock, fit_clock, steady
from hovercontrol.logs.gather import Condition, gather
from hovercontrol.logs.join import join_logs
from hovercontrol.logs.log import POSE, VELOCITY, Log
from hovercontrol.logs.read import read_log
from hovercontrol.logs.smooth import Smoothed, Span, smooth_pose

__all__ = [
    "Log", "POSE", "VELOCITY",
    "read_log", "join_logs", "BenchTable", "gather", "Condition",
    "Clock", "fit_clock", "steady",
    "Smoothed", "Span", "smooth_pose",
]  # fmt: skip
