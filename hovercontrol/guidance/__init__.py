"""Guidance: references for a controller from a pilot's stick, from waypoints or from a path."""

from hovercontrol.guidance.commands import command_filter
from hovercontrol.guidance.course import course_control
from hovercontrol.guidance.path import path_tracker
from hovercontrol.guidance.reference import steering_reference
from hovercontrol.guidance.steering import steering_law
from hovercontrol.guidance.waypoints import line_of_sight
from hovercontrol.guidance.weave import weaving

__all__ = [
    "command_filter",
    "course_control",
    "line_of_sight",
    "path_tracker",
    "steering_law",
    "steering_reference",
    "weaving",
]
