"""Guidance: references for a controller from a pilot's stick, from waypoints or from a path."""

from hovercontrol.control.guidance.commands import command_filter
from hovercontrol.control.guidance.course import course_control
from hovercontrol.control.guidance.path import path_tracker
from hovercontrol.control.guidance.reference import steering_reference
from hovercontrol.control.guidance.steering import steering_law
from hovercontrol.control.guidance.waypoints import line_of_sight
from hovercontrol.control.guidance.weave import weaving

__all__ = [
    "command_filter",
    "course_control",
    "line_of_sight",
    "path_tracker",
    "steering_law",
    "steering_reference",
    "weaving",
]
